"""A protocol played on a simulated unit: the recording, the protocol that it follows, and the truth."""

from __future__ import annotations

import math
import time
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol import SpinStep
from tumble.records import dataclass
from tumble.sample_rates import SampleRate
from tumble.simulation import EARTHS_FIELD, SessionErrors, read_errors
from tumble.workflows.given.protocols import given_site, read_played
from tumble.workflows.request import SimulateRequest, asked, check_turn_on, silent
from tumble.workflows.simulated import (
    Played,
    case_columns,
    magnetometer_truth,
    read_in_other_axes,
    require_place,
    truth_document,
    write_simulation,
)

if TYPE_CHECKING:
    from tumble.protocol import Protocol, Step
    from tumble.recording import Recording
    from tumble.sensor import ImuModel
    from tumble.simulation import ChamberTruth, Grade, SimulatedMagnetometer, Truth

# Where a protocol is played that names no place: nobody's, and said.
DEFAULT_LATITUDE = math.radians(45.0)
# Two hours and three quarters at 2 kHz, or 2.5 GB of memory.
LARGEST_SAMPLES = 20_000_000
# A unit in a chamber changes within minutes, and a test takes hours. Hz; stamps 0.1 s apart could be milliseconds.
CHAMBER_RATE = 12.5
UNITS = ("SI", "counts")
# A stream of random numbers for each, by its place.
_STREAMS = ("unit", "session", "fixture", "thermal", "turn-on", "magnetometer", "field", "current")


@dataclass
class Simulated:
    """What `simulate` wrote: the folder, its files, the truth, sentences for the user, seconds by stage."""

    folder: Path
    files: list[Path]
    truth: dict[str, Any]
    remarks: list[str]
    seconds: dict[str, float] = field(default_factory=dict[str, float])


@asked(SimulateRequest)
def simulate(request: SimulateRequest) -> Simulated:
    """Play a protocol on a simulated unit, and write recording, protocol and truth into one folder.

    ``tumble calibrate --protocol FOLDER/protocol.yaml`` then needs nothing else, and never reads the
    truth. Another simulation that was in the folder is kept in it as ``before-IDENTITY``; anything else there is left
    alone.

    Raises
    ------
    UsageError, ProtocolError, SiteError
        If an option or the protocol is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.simulation import find_grade, has_chamber

    say, began = request.progress or silent, time.perf_counter()
    given, chosen = read_played(request.protocol, request.duration), find_grade(request.grade)
    errors, seed, units = request.errors, request.seed, request.units
    wrong = (
        errors if isinstance(errors, SessionErrors) else read_errors(errors) if errors else SessionErrors()
    )
    remarks = _check_terms(chosen, wrong)
    place = _place(given, request.site, wrong, remarks)
    usual = given.rate or (CHAMBER_RATE if has_chamber(given) else chosen.rate)
    hertz = usual if request.rate is None else request.rate
    if has_chamber(given):
        _check_chamber(units, wrong)
    _check(request, hertz, given)
    folder = Path(f"{given.name}-simulated" if request.output is None else request.output)
    require_place(folder)
    say("playing the protocol")
    drawn = chosen.with_wandering_biases() if wrong.wander else chosen
    unit = seed if request.unit is None else request.unit
    played = Played(given, hertz, place, units, chosen, drawn, seed, unit, wrong)
    model = _drawn_unit(played, request.turn_on)
    played = replace(played, magnetometer=_magnetometer(request.magnetometer, played))
    if wrong.fixture is not None:
        aimed, fixture = (
            _aimed(given, wrong.fixture_azimuth),
            wrong.fixture.drawn(_generator(seed, "fixture")),
        )
        played = replace(played, protocol=aimed, fixture=fixture)
    recording, truth, document = _play(played, model)
    simulated = time.perf_counter()
    say("writing")
    shown = _as_played(played, truth, given.site if request.site is None else None)
    files, kept = write_simulation(folder, shown, recording, document)
    if kept is not None:
        remarks.append(f"What was simulated there before is another simulation, and kept in {kept}.")
    seconds = {"simulating": simulated - began, "writing": time.perf_counter() - simulated}
    return Simulated(folder, files, document, remarks, seconds)


def _place(given: Protocol, site: Site | None, errors: SessionErrors, remarks: list[str]) -> Site:
    """Where it is played; what is assumed, or changes nothing, is remarked on."""
    place = given_site(site) or given.site
    if place is None:
        place = Site.from_latitude(DEFAULT_LATITUDE, 0.0)
        remarks.append("No site was given: it is played at latitude 45°, height 0 m; --site says another.")
    elif place.latitude is not None and place.height is None and place.source.startswith("normal"):
        # Where it is played is known.
        place = Site.from_latitude(place.latitude, 0.0)
    if errors.table is not None and not any(isinstance(step, SpinStep) for step in given.steps):
        remarks.append(
            f"The protocol {given.name} has no spins: what is wrong with the table changes nothing."
        )
    return place


def _play(played: Played, model: ImuModel) -> tuple[Recording, Truth, dict[str, Any]]:
    """The recording, what was true, and the document that says so."""
    from tumble.simulation import find_thermal_grade, has_chamber, simulate_protocol
    from tumble.workflows.simulated import thermal_truth

    inside, errors = None, played.errors
    if has_chamber(played.protocol):
        recording, truth, inside = _in_chamber(played, model)
    else:
        recording, truth = simulate_protocol(
            played.protocol,
            played.rate,
            _generator(played.seed, "session"),
            site=played.site,
            grade=played.grade,
            model=model,
            noise=errors.noise,
            imperfections=errors.imperfections,
            placement=errors.placement,
            heading=errors.fixture_azimuth,
            lever_arm_b=errors.lever_arm_b,
            table=errors.table,
            fixture=played.fixture,
            units=played.units,
            magnetometer=None
            if played.magnetometer is None
            else (played.magnetometer, _generator(played.seed, "field")),
        )
    case = played.drawn_from.C_instrument_case
    if errors.axes == "case" and case is not None:
        truth = read_in_other_axes(truth, case.T)
    document = truth_document(played, recording, truth)
    if played.magnetometer is not None:
        document["magnetometer"] = magnetometer_truth(played.magnetometer, truth)
    if inside is not None:
        document["thermal"] = thermal_truth(inside, find_thermal_grade(played.drawn_from.name))
    return recording, truth, document


def _as_played(played: Played, truth: Truth, stated: Site | None) -> Protocol:
    """The protocol to calibrate with: as it was played, and how the recording is read.

    What it states of its place and of its clock stays, for whoever has it believes no more than that.
    """
    columns, given, case = None, played.protocol, played.drawn_from.C_instrument_case
    share = (given.rate.relative or 0.0) if isinstance(given.rate, SampleRate) else 0.0
    if played.errors.axes == "case" and case is not None:
        # Read by these columns, the recording is in the axes that the poses are of.
        columns = case_columns(case)
    return replace(
        played.protocol,
        steps=tuple(_exact(step) for step in truth.steps),
        site=stated or played.site,
        recordings=(),
        # The stamps of a simulation are true.
        rate=SampleRate(played.rate, played.rate * share),
        columns=columns,
        units="counts" if played.units == "counts" else "m/s^2,rad/s,s",
    )


def _exact(step: Step) -> Step:
    """A table of which nobody says how well it keeps its rate was simulated as an exact one."""
    return replace(step, sigma=0.0) if isinstance(step, SpinStep) and step.sigma is None else step


def _check_chamber(units: str, errors: SessionErrors) -> None:
    """Refuse what is not simulated in a chamber."""
    if units != "SI":
        raise UsageError(
            "--output-units counts: a unit in a chamber is simulated in SI; leave the option out."
        )
    if any(one is not None for one in (errors.table, errors.fixture, errors.lever_arm_b)):
        raise UsageError(
            "The protocol has soaks or ramps, and there is no table in this chamber: take its errors out of the file."
        )


def _in_chamber(played: Played, model: ImuModel) -> tuple[Recording, Truth, ChamberTruth]:
    """Record a unit that changes with temperature; without noise its thermometer has none either."""
    from tumble.simulation import Chamber, find_thermal_grade, simulate_chamber

    grade, noise = find_thermal_grade(played.drawn_from.name), played.errors.noise
    return simulate_chamber(
        played.protocol,
        played.rate,
        _generator(played.seed, "session"),
        site=played.site,
        thermal=grade.simulate_model(model, _generator(played.unit, "thermal")),
        chamber=Chamber(
            thermometer_noise=grade.thermometer_noise if noise else 0.0,
            thermometer_resolution=grade.thermometer_resolution if noise else 0.0,
        ),
        grade=played.grade if noise else None,
        imperfections=played.errors.imperfections,
        placement=played.errors.placement,
    )


def _magnetometer(name: str | None, played: Played) -> SimulatedMagnetometer | None:
    """The magnetometer of the unit, if it has one; a current changes the field in a direction of the session's own."""
    errors = played.errors
    if name is None:
        if errors.magnetic_field or errors.field_change:
            raise UsageError("The file of errors has a magnetic field: give --magnetometer, too.")
        return None
    if errors.axes == "case":
        raise UsageError(
            "axes: case: a magnetometer is simulated along the axes of the unit; leave one of them out."
        )
    from tumble.simulation import SimulatedMagnetometer, find_magnetometer

    grade = find_magnetometer(name)
    triad = grade.simulate_triad(_generator(played.unit, "magnetometer"))
    direction = _generator(played.seed, "current").standard_normal(3)
    size, since = errors.field_change or (0.0, math.inf)
    current = size * direction / np.linalg.norm(direction)
    field = errors.magnetic_field or EARTHS_FIELD
    return SimulatedMagnetometer(grade, triad, *field, errors.noise, current, since)


def _generator(seed: int, what: str) -> np.random.Generator:
    """A stream of its own for unit, session and fixture; SFC64 is the fastest that numpy has."""
    number = _STREAMS.index(what)
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(number,))))


def _drawn_unit(played: Played, turn_on: tuple[float, float]) -> ImuModel:
    """The unit with the biases of this session."""
    errors = played.errors
    model = played.drawn_from.simulate_model(
        _generator(played.unit, "unit"),
        nonlinear=errors.nonlinear,
        case_axes=errors.axes == "case",
        asymmetry=errors.asymmetry,
    )
    check_turn_on(turn_on)
    if turn_on == (0.0, 0.0):
        return model
    rng, force, rate = _generator(played.seed, "turn-on"), model.accelerometer, model.gyroscope
    assert force is not None
    assert rate is not None
    return replace(
        model,
        accelerometer=replace(force, bias=force.bias + rng.normal(0.0, turn_on[0], 3)),
        gyroscope=replace(rate, bias=rate.bias + rng.normal(0.0, turn_on[1], 3)),
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


def _check_terms(grade: Grade, errors: SessionErrors) -> list[str]:
    """Refuse or remark on what the grade's sheet does not state."""
    if errors.axes == "case" and grade.C_instrument_case is None:
        raise UsageError(
            f"axes: case: no source says how the axes of the grade {grade.name} lie in its case; hg1700 and hg1900 do."
        )
    triads = (grade.accelerometer, grade.gyroscope)
    remarks: list[str] = []
    if errors.nonlinear and not any(triad.linearity for triad in triads):
        remarks.append(f"The sheet of {grade.name} states no linearity: nonlinear changes nothing.")
    if errors.wander and not any(triad.bias_stability for triad in triads):
        remarks.append(f"The sheet of {grade.name} states no in-run stability: wander changes nothing.")
    return remarks


def _check(request: SimulateRequest, rate: float, protocol: Protocol) -> None:
    if request.units not in UNITS:
        raise UsageError(f"--output-units {request.units}: a simulated recording is in {' or '.join(UNITS)}.")
    for name, value in (("seed", request.seed), ("unit-seed", request.unit)):
        if value is not None and value < 0:
            raise UsageError(f"--{name} {value}: a seed is a whole number from 0 on.")
    if not 1.0 <= rate <= 20_000.0:
        raise UsageError(f"--sample-rate {rate:g}: the sampling rate is in Hz, from 1 to 20000.")
    samples = protocol.duration * rate
    if samples > LARGEST_SAMPLES:
        raise UsageError(
            f"The protocol lasts {protocol.duration:.10g} s, which is {samples:.3g} samples at {rate:g} Hz: "
            f"at most {LARGEST_SAMPLES:,} are simulated; give a lower --sample-rate."
        )
