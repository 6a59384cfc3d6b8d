"""A protocol played on a simulated unit: the recording, the protocol that it follows, and the truth."""

from __future__ import annotations

import json
import math
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.earth import Site
from tumble.errors import OutputError, UsageError
from tumble.files import filled_folder, put_text, read_json
from tumble.workflows.progress import silent
from tumble.workflows.protocols import read_played
from tumble.workflows.site import given_site
from tumble.workflows.truth import FORMAT, Settings, case_columns, read_in_other_axes, truth_document

if TYPE_CHECKING:
    from tumble.arrays import AnyArray
    from tumble.protocol import Protocol, Step
    from tumble.recording import Recording
    from tumble.sensor import ImuModel
    from tumble.simulation import ChamberTruth, FixtureErrors, Grade, Imperfections, TableErrors, Truth

# What most people hold in their hands, with errors large enough for every procedure to find.
DEFAULT_GRADE = "consumer-mems"
# Where a protocol is played that names no place: nobody's, and said.
DEFAULT_LATITUDE = math.radians(45.0)
# Two hours and three quarters at 2 kHz, or 2.5 GB of memory.
LARGEST_SAMPLES = 20_000_000
# A unit in a chamber changes within minutes, and a test takes hours. Hz; stamps 0.1 s apart could be milliseconds.
CHAMBER_RATE = 12.5
UNITS = ("SI", "counts")
AXES = ("unit", "case")


@dataclass(slots=True)
class Simulated:
    """What `simulate` wrote: the folder, its files, the truth, sentences for the user, seconds by stage."""

    folder: Path
    files: list[Path]
    truth: dict[str, Any]
    remarks: list[str]
    seconds: dict[str, float] = field(default_factory=dict[str, float])


def simulate(
    protocol: str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    grade: str = DEFAULT_GRADE,
    seed: int = 0,
    unit: int | None = None,
    site: Site | None = None,
    rate: float | None = None,
    duration: float | None = None,
    units: str = "SI",
    axes: str = "unit",
    per_step: bool = False,
    placement: bool = True,
    noise: bool = True,
    nonlinear: bool = False,
    wander: bool = False,
    asymmetry: float = 0.0,
    turn_on: tuple[float, float] = (0.0, 0.0),
    imperfections: Imperfections | None = None,
    table: TableErrors | None = None,
    fixture: FixtureErrors | None = None,
    fixture_azimuth: float | None = None,
    lever_arm_b: AnyArray | None = None,
    progress: Callable[[str], None] | None = None,
) -> Simulated:
    """Play a protocol on a simulated unit, and write recording, protocol and truth into one folder.

    ``tumble calibrate --protocol FOLDER/protocol.yaml`` then needs nothing else, and never reads the
    truth. An earlier simulation in the folder is replaced as a whole; anything else there is left alone.

    Parameters
    ----------
    protocol : a protocol file, or the name of one; "rest" is a unit that lies still, for its noise.
    output : the folder; by default the protocol's name with ``-simulated``.
    grade : name of one of `tumble.simulation.GRADES`.
    seed : of placements, noise and losses; the same seed gives the same files bit for bit.
    unit : seed of the unit itself; None takes `seed`. The same unit in another session has another seed.
    site : where it is played; None takes the protocol's, or latitude 45°, height 0.
    rate : Hz; None takes the protocol's or the grade's usual one.
    duration : s that a unit at rest is recorded; None takes ten minutes.
    units : "SI" or "counts" of the recording.
    axes : "unit", b is the unit's own axes, or "case", forward, right, down of its case; the protocol
        then says how the columns, which stay the unit's own, are read.
    per_step : one file for each hold and each spin instead of one for all.
    placement : make the placement errors that the protocol's uncertainties allow.
    noise : add noise and converter.
    nonlinear : draw quadratic terms of the sheet's linearity, where it states one.
    wander : let biases wander within the run as the sheet's in-run stability says, where it states one.
    asymmetry : one sigma of every sensor's scale-factor asymmetry.
    turn_on : m/s² and rad/s, one sigma by which biases move when the unit is switched on; drawn with the session.
    imperfections : what the recording chain does.
    table : what is wrong with the table; the protocol that is written then has its display's angles.
    fixture : quality of a two-axis fixture that makes the protocol's sequences: one sigma of each error, from
        which the session's seed draws those of one; None for no fixture.
    fixture_azimuth : rad, where its outer axis points, clockwise from north; the protocol that is written
        says so. None leaves it as the protocol has it.
    lever_arm_b : m, from the table's centre to the unit, (3,), or (3, 3) with a row for each accelerometer.
    progress : is told in words what is being done.

    Raises
    ------
    UsageError, ProtocolError, SiteError
        If an option or the protocol is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.protocol import SpinStep
    from tumble.simulation import Imperfections, find_grade, find_thermal_grade, simulate_protocol
    from tumble.simulation.thermal_steps import has_chamber
    from tumble.workflows.thermal_truth import thermal_truth

    say, began = progress or silent, time.perf_counter()
    given = read_played(protocol, duration)
    chosen = find_grade(grade)
    remarks = _check_terms(chosen.name, nonlinear=nonlinear, wander=wander, axes=axes)
    place = given_site(site) or given.site
    if place is None:
        place = Site.from_latitude(DEFAULT_LATITUDE)
        remarks.append("No site was given: it is played at latitude 45°, height 0 m; --site says another.")
    if table is not None and not any(isinstance(step, SpinStep) for step in given.steps):
        remarks.append(
            f"The protocol {given.name} has no spins: what is wrong with the table changes nothing."
        )
    usual = CHAMBER_RATE if has_chamber(given) else chosen.rate
    hertz = rate if rate is not None else given.rate or usual
    if has_chamber(given):
        _check_chamber(units, table, fixture, lever_arm_b)
    _check(units, seed, unit, hertz, given, per_step)
    folder = Path(output) if output is not None else Path(f"{given.name}-simulated")
    _require_place(folder)

    say("playing the protocol")
    unit = seed if unit is None else unit
    played_by = chosen.with_wandering_biases() if wander else chosen
    chain = imperfections or Imperfections()
    if fixture is not None:
        given = _aimed(given, fixture_azimuth)
        fixture = fixture.drawn(_generator(seed, "fixture"))
    model = chosen.simulate_model(
        _generator(unit, "unit"), nonlinear=nonlinear, case_axes=axes == "case", asymmetry=asymmetry
    )
    model = _switched_on(model, turn_on, _generator(seed, "turn-on"))
    inside = None
    if has_chamber(given):
        recording, truth, inside = _in_chamber(
            given, hertz, seed, unit, place, model, chosen, played_by, noise, chain, placement
        )
    else:
        recording, truth = simulate_protocol(
            given,
            hertz,
            _generator(seed, "session"),
            site=place,
            grade=played_by,
            model=model,
            noise=noise,
            imperfections=chain,
            placement=placement,
            heading=fixture_azimuth if fixture is not None else None,
            lever_arm_b=lever_arm_b,
            table=table,
            fixture=fixture,
            units=units,
        )
    columns = None
    if axes == "case" and chosen.C_instrument_case is not None:
        # Read by these columns, the recording is in the axes that the poses are of.
        columns = case_columns(chosen.C_instrument_case)
        truth = read_in_other_axes(truth, chosen.C_instrument_case.T)
    settings = Settings(played_by, seed, unit, noise, placement, axes, chain, table, lever_arm_b)
    document = truth_document(given, recording, truth, settings)
    if inside is not None:
        document["thermal"] = thermal_truth(inside, find_thermal_grade(chosen.name))
    simulated = time.perf_counter()
    say("writing")
    said = "counts" if units == "counts" else "m/s^2,rad/s,s"
    played = replace(
        given, steps=truth.steps, site=place, recordings=(), rate=None, columns=columns, units=said
    )
    files = _write(folder, played, recording, truth, document, per_step)
    seconds = {"simulating": simulated - began, "writing": time.perf_counter() - simulated}
    return Simulated(folder, files, document, remarks, seconds)


def _check_chamber(
    units: str, table: TableErrors | None, fixture: FixtureErrors | None, lever_arm_b: AnyArray | None
) -> None:
    """Refuse what is not simulated in a chamber."""
    if units != "SI":
        raise UsageError(
            "--output-units counts: a unit in a chamber is simulated in SI; leave the option out."
        )
    if table is not None or fixture is not None or lever_arm_b is not None:
        raise UsageError(
            "The protocol has soaks or ramps, and there is no table in this chamber: leave its options out."
        )


def _in_chamber(
    protocol: Protocol,
    rate: float,
    seed: int,
    unit: int,
    site: Site,
    model: ImuModel,
    drawn_from: Grade,
    played_by: Grade,
    noise: bool,
    chain: Imperfections,
    placement: bool,
) -> tuple[Recording, Truth, ChamberTruth]:
    """Record a unit that changes with temperature; without noise its thermometer has none either."""
    from tumble.simulation import Chamber, find_thermal_grade, simulate_chamber

    grade = find_thermal_grade(drawn_from.name)
    return simulate_chamber(
        protocol,
        rate,
        _generator(seed, "session"),
        site=site,
        thermal=grade.simulate_model(model, _generator(unit, "thermal")),
        chamber=Chamber(
            thermometer_noise=grade.thermometer_noise if noise else 0.0,
            thermometer_resolution=grade.thermometer_resolution if noise else 0.0,
        ),
        grade=played_by if noise else None,
        imperfections=chain,
        placement=placement,
    )


def _generator(seed: int, what: str) -> np.random.Generator:
    """A stream of its own for unit, session and fixture; SFC64 is the fastest that numpy has."""
    number = {"unit": 0, "session": 1, "fixture": 2, "thermal": 3, "turn-on": 4}[what]
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(number,))))


def _switched_on(model: ImuModel, sigmas: tuple[float, float], rng: np.random.Generator) -> ImuModel:
    """The unit with the biases of this session."""
    if not all(0.0 <= sigma < math.inf for sigma in sigmas):
        raise UsageError("--turn-on-bias takes two numbers that are not negative: mg and °/h.")
    if sigmas == (0.0, 0.0):
        return model
    force, rate = model.accelerometer, model.gyroscope
    assert force is not None
    assert rate is not None
    return replace(
        model,
        accelerometer=replace(force, bias=force.bias + rng.normal(0.0, sigmas[0], 3)),
        gyroscope=replace(rate, bias=rate.bias + rng.normal(0.0, sigmas[1], 3)),
    )


def _aimed(protocol: Protocol, azimuth: float | None) -> Protocol:
    """Return the protocol with all its headings turned so that the fixture's outer axis points there."""
    from tumble.protocol import HoldStep
    from tumble.simulation import fixture_angles

    now = fixture_angles(protocol).azimuth
    if azimuth is None or now is None:
        return protocol
    steps: list[Step] = []
    for step in protocol.steps:
        if isinstance(step, HoldStep) and step.pose is not None and step.pose.heading is not None:
            turned = math.remainder(step.pose.heading + azimuth - now, 2.0 * math.pi)
            step = replace(step, pose=replace(step.pose, heading=turned))
        steps.append(step)
    return replace(protocol, steps=tuple(steps))


def _check_terms(name: str, *, nonlinear: bool, wander: bool, axes: str) -> list[str]:
    """Refuse or remark on what the grade's sheet does not state."""
    from tumble.simulation import find_grade

    grade = find_grade(name)
    if axes not in AXES:
        raise UsageError(f"--axes {axes}: b is the axes of the {' or of the '.join(AXES)}.")
    if axes == "case" and grade.C_instrument_case is None:
        raise UsageError(
            f"--axes case: no source says how the axes of the grade {name} lie in its case; hg1700 and hg1900 do."
        )
    triads = (grade.accelerometer, grade.gyroscope)
    remarks: list[str] = []
    if nonlinear and not any(triad.linearity for triad in triads):
        remarks.append(f"The sheet of {name} states no linearity: --nonlinear changes nothing.")
    if wander and not any(triad.bias_stability for triad in triads):
        remarks.append(f"The sheet of {name} states no in-run stability: --wander changes nothing.")
    return remarks


def _check(units: str, seed: int, unit: int | None, rate: float, protocol: Protocol, per_step: bool) -> None:
    if units not in UNITS:
        raise UsageError(f"--output-units {units}: a simulated recording is in {' or '.join(UNITS)}.")
    for name, value in (("seed", seed), ("unit", unit)):
        if value is not None and value < 0:
            raise UsageError(f"--{name} {value}: a seed is a whole number from 0 on.")
    if not 1.0 <= rate <= 20_000.0:
        raise UsageError(f"--sample-rate {rate:g}: the sampling rate is in Hz, from 1 to 20000.")
    samples = protocol.duration * rate
    if samples > LARGEST_SAMPLES:
        raise UsageError(
            f"The protocol lasts {protocol.duration:.0f} s, which is {samples:.3g} samples at {rate:g} Hz: "
            f"at most {LARGEST_SAMPLES:,} are simulated; give a lower --sample-rate."
        )
    if per_step and protocol.procedure == "hand-held":
        raise UsageError(
            "--per-step: the procedure hand-held needs the turns between the holds, so that its recording is one file."
        )


def _require_place(folder: Path) -> None:
    """Refuse before the work what would fail after it, and never write over what was not simulated."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder for the simulated files.")
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise OutputError(f"The folder {folder} cannot be made: {existing} is a file. Give another with -o.")
    if not os.access(existing, os.W_OK):
        raise OutputError(f"{existing} cannot be written to: give another folder with -o.")
    precious = [name for name in ("recording.csv", "protocol.yaml") if (folder / name).exists()]
    if precious and not (folder / "truth.json").exists():
        raise UsageError(
            f"{folder} holds a {precious[0]} that was not simulated, for there is no truth.json beside it: "
            "give another folder with -o."
        )
    if (folder / "truth.json").exists() and not _earlier(folder):
        raise UsageError(f"{folder / 'truth.json'} is not of `tumble simulate`: give another folder with -o.")


def _earlier(folder: Path) -> dict[str, Any]:
    """The truth of an earlier simulation in the folder; empty where there is none."""
    try:
        found: Any = read_json(folder / "truth.json")
    except (OSError, ValueError):
        return {}
    if not isinstance(found, dict):
        return {}
    document = cast("dict[str, Any]", found)
    return document if document.get("format") == FORMAT else {}


def _earlier_recordings(folder: Path) -> list[str]:
    """The recordings of an earlier simulation, by the names that a simulation gives: no other file is removed."""
    names: Any = _earlier(folder).get("recordings", [])
    listed = cast("list[Any]", names) if isinstance(names, list) else []
    return [n for n in listed if isinstance(n, str) and re.fullmatch(r"recording\.csv|step-\d+\.csv", n)]


def _write(
    folder: Path,
    protocol: Protocol,
    recording: Recording,
    truth: Truth,
    document: dict[str, Any],
    per_step: bool,
) -> list[Path]:
    """Write everything into a folder inside the folder, then rename it all into place."""
    from tumble.recording.formats.output import write_recording

    try:
        with filled_folder(folder, instead_of=_earlier_recordings(folder)) as beside:
            if per_step:
                protocol, names = _write_steps(protocol, recording, truth, beside)
            else:
                names = [write_recording(recording, beside / "recording.csv").name]
                protocol = replace(protocol, recordings=tuple(names))
            document["recordings"] = list(names)
            names += _write_texts(protocol, document, beside)
    except (OSError, OutputError) as error:
        # A writer below has turned the system's error into a sentence about a name that nobody knows.
        cause = error.__cause__ if isinstance(error, OutputError) else error
        words = cause.strerror if isinstance(cause, OSError) and cause.strerror else str(cause or error)
        raise OutputError(f"The simulated recording could not be written to {folder}: {words}.") from error
    return [folder / name for name in names]


def _write_texts(protocol: Protocol, document: dict[str, Any], beside: Path) -> list[str]:
    from tumble.protocol import protocol_to_yaml

    texts = {
        "protocol.yaml": protocol_to_yaml(protocol),
        "truth.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        put_text(beside / name, text)
    return list(texts)


def _write_steps(
    protocol: Protocol, recording: Recording, truth: Truth, beside: Path
) -> tuple[Protocol, list[str]]:
    """Write each hold and spin to a file of its own; return the protocol whose steps name them, and the names.

    A rotation whose angle is known is one with the rests beside it: so far as these reach it is one file. So
    is a sequence of the strapdown rotation test.
    """
    from tumble.recording.formats.output import write_recording

    names: list[str] = []
    steps = [replace(step, file=None, interval=None) for step in protocol.steps]
    width = len(str(len(steps)))
    # Whole samples inside the steps: half an interval from each of their ends.
    inside = 0.5 / recording.rate * (1.0 - 1e-6)
    firsts: list[int] = np.searchsorted(recording.time, truth.step_edges[:, 0] + inside).tolist()
    lasts: list[int] = np.searchsorted(recording.time, truth.step_edges[:, 1] - inside, side="right").tolist()
    for run in _runs(protocol):
        first, last = firsts[run[0]], lasts[run[-1]]
        if not last - first > 1:
            continue
        names.append(f"step-{run[0] + 1:0{width}d}.csv")
        write_recording(recording.between(first, last), beside / names[-1])
        for number in run:
            steps[number] = replace(steps[number], file=names[-1])
    return replace(protocol, steps=tuple(steps)), names


def _runs(protocol: Protocol) -> list[list[int]]:
    """Return which steps, turns apart, share a file: each alone, but rotations of known angle with their rests."""
    from tumble.protocol import SpinStep, TurnStep, sequence_steps

    steps = protocol.steps
    sequences = sequence_steps(protocol) if protocol.procedure == "strapdown-rotation" else []
    inside = {number for s in sequences for number in range(s.start + 1, s.end + 1)}
    runs: list[list[int]] = []
    known = [isinstance(step, SpinStep) and step.angle is not None for step in steps]
    for number, step in enumerate(steps):
        if number in inside:
            runs[-1].append(number)
            continue
        if isinstance(step, TurnStep):
            continue
        joined = runs and runs[-1][-1] == number - 1 and (known[number] or known[number - 1])
        if joined:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs
