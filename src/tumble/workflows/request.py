"""What a user may ask of a workflow, and how: each option is declared once, in a record.

A request is a frozen record. The command line makes its options of it, and `asked` the signature of a Python function
and the parameters of its docstring. A workflow takes the record itself, and hands it on as one thing.
"""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import MISSING, field, fields, replace
from functools import wraps
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tumble.border import border
from tumble.errors import UsageError
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.records import dataclass

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from tumble.document import Calibration
    from tumble.earth import Site
    from tumble.recording import Paths, Recording
    from tumble.simulation import SessionErrors


THREADS_OF = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")
"""Settings of the user's by which libraries of linear algebra take their number of threads."""


def silent(_: object) -> None:
    """Say it to nobody."""


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which linear algebra works on one thread; a user's own setting stands.

    The matrices are small. With a thread for each core, the threads wait for one another at every product: a call
    takes up to eight times as long where other work is done beside it.
    """
    if any(os.environ.get(name) for name in THREADS_OF):
        return nullcontext()
    import numpy as np  # whose library has to be there to be limited
    from threadpoolctl import threadpool_limits

    assert np.linalg
    return threadpool_limits(1, "blas")


P = ParamSpec("P")
Request = TypeVar("Request")
Answer = TypeVar("Answer")

ARGUMENT = "Arguments"
FIRST = "What people need first"
PLACE = "Where it was recorded"
FILE = "What the file does not say itself"
RECORD = "For the record"
ADVANCED = "Advanced"
SEVERAL = "Several recordings"
DRIVE = "A drive with satellite positions"
POSES = "Poses (multi-position, hand-held, six-position)"
OF_NO_DRIVE = "{} says nothing to a drive, whose place the positions give: leave it out."
GRADES = "consumer-mems, industrial-mems, hg1900, hg1700, tactical, ring-laser"

Notes = Mapping[str, str] | Sequence[str] | None
USUAL = ("operator", "place", "instrument", "remarks")
"""Notes whose names a manifest's columns, a certificate and a registry know too."""


@dataclass(frozen=True)
class Option:
    """A field of a record as the command line has it; what its help says stands in the record's docstring.

    Attributes
    ----------
    panel : of the help that it stands in.
    metavar : what stands for its value; empty for a flag.
    names : its spellings, such as ``--output`` and ``-o``; none takes the name of the field.
    kind : as what its value is typed; None as its annotation says.
    read : makes the field's value of what was typed; where nothing was, the field has its default.
    typed : what stands for nothing, where the help shows it.
    complete : what the shell completes, of `tumble.cli.groups.NAMES`.
    show_default : whether the help shows the default.
    alone : it goes with one recording of one unit alone: not with ``--turn-ons``, and not with batches.
    of_many : the help where it holds for all units of a batch; None if it does not go there.
    by_unit : a manifest may say it unit by unit.
    in_python : what it says of the parameter of a function, where that is another thing.
    help : what it says, where it is another thing than the docstring says, or none does.
    """

    panel: str
    metavar: str
    names: tuple[str, ...]
    kind: Any = None
    read: Callable[[Any], Any] | None = None
    typed: Any = None
    complete: str = ""
    show_default: bool = False
    alone: bool = False
    of_many: str | None = ""
    by_unit: bool = False
    in_python: str = ""
    help: str = ""


def option(panel: str, metavar: str, *names: str, default: Any = None, **more: Any) -> Any:
    """Declare a field that is an option of the command line, too.

    Parameters
    ----------
    panel, metavar, names, more : of the `Option`.
    default : of the field.
    """
    return field(default=default, metadata={"option": Option(panel, metavar, names, **more)})


def positional(metavar: str, *names: str, panel: str = ARGUMENT, **more: Any) -> dict[str, Option]:
    """Return what is noted of a field that Python takes without its name, as the command line mostly does.

    Parameters
    ----------
    metavar, names, panel, more : of the `Option`.
    """
    return {"option": Option(panel, metavar, names, **more)}


def argument(metavar: str, *, default: Any = MISSING, **more: Any) -> Any:
    """Declare a parameter that stands without a name on the command line.

    Parameters
    ----------
    metavar, default, more : as for `option`.
    """
    return option(ARGUMENT, metavar, default=default, **more)


def shared(record: Any, name: str, **other: Any) -> Any:
    """Declare an option as a record has it.

    Parameters
    ----------
    record, name : where it is declared.
    other : what is otherwise of the `Option`.
    """
    (one,) = (one for one in fields(record) if one.name == name)
    own = option_of(one)
    assert own is not None
    own = replace(own, help=own.help or words_of(record)[name], **other)
    return field(default=one.default, metadata={"option": own})


def option_of(one: Any) -> Option | None:
    """Return the option of a field; None if only programs give it, or the command line in other words.

    Parameters
    ----------
    one : of `dataclasses.fields`, or anything that may be one.
    """
    return getattr(one, "metadata", {}).get("option")


def words_of(record: type) -> dict[str, str]:
    """Return what a record's docstring says of its fields, those of the records that it goes on from first.

    Parameters
    ----------
    record : whose docstring lists its attributes.
    """
    said: dict[str, str] = {}
    for kind in reversed(record.__mro__):
        said |= listed_words(kind.__doc__ or "")[1]
    return said


def listed_words(doc: str) -> tuple[str, dict[str, str]]:
    """Return a docstring without its list of parameters or attributes, and what the list says of each.

    Parameters
    ----------
    doc : with the list at its end, if there is one.
    """
    before, _, listed = re.sub(r"(Parameters|Attributes)\n-+\n", "\0", inspect.cleandoc(doc)).partition("\0")
    procedures = f"{', '.join(KNOWN_PROCEDURES[:-1])} or {KNOWN_PROCEDURES[-1]}"
    return before, {
        name: " ".join(words.split()).format(GRADES=GRADES, PROCEDURES=procedures)
        for name, words in re.findall(r"^(\w+) : (.*(?:\n .*)*)", listed, re.M)
    }


def asked(record: Callable[P, Request]) -> Callable[[Callable[[Request], Answer]], Callable[P, Answer]]:
    """Make a workflow that takes a request a public function that takes the request's fields.

    Its arguments are checked, and linear algebra works on one thread.

    Parameters
    ----------
    record : the class of the request.
    """

    def made(work: Callable[[Request], Answer]) -> Callable[P, Answer]:
        @wraps(work)
        def called(*args: P.args, **kwargs: P.kwargs) -> Answer:
            with one_thread():
                return work(record(*args, **kwargs))

        kind: Any = record
        shape = inspect.signature(kind).replace(return_annotation=work.__annotations__["return"])
        called.__signature__ = shape  # type: ignore[attr-defined]
        options = {one.name: own for one in fields(kind) if (own := option_of(one))}
        words = {name: own.help for name, own in options.items()} | words_of(kind)
        words |= {name: own.in_python for name, own in options.items() if own.in_python}
        listed = "".join(f"{name} : {words[name]}\n" for name in shape.parameters)
        before, raises, after = inspect.cleandoc(work.__doc__ or "").partition("Raises\n------\n")
        called.__doc__ = f"{before}Parameters\n----------\n{listed}\n{raises}{after}"
        return border(called)

    return made


def refuse(request: Any, names: Collection[str], sentence: str) -> None:
    """Refuse what means nothing here, rather than ignore it.

    Parameters
    ----------
    request : what was asked for.
    names : of its fields.
    sentence : what is said of one, ``{}`` for its name.

    Raises
    ------
    UsageError
        If one was given.
    """
    for one in fields(request):
        if one.name in names and getattr(request, one.name) != one.default:
            spelled = own.names if (own := option_of(one)) else ()
            raise UsageError(sentence.format((spelled or [f"--{one.name.replace('_', '-')}"])[0]))


def numbers(text: str, option: str, count: int) -> tuple[float, ...]:
    """Return numbers with commas between them.

    Parameters
    ----------
    text, option : as typed, and where.
    count : how many there must be.

    Raises
    ------
    UsageError
        If there are others.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(map(math.isfinite, values)):
        raise UsageError(f"{option} takes {count} numbers apart by commas, and {text!r} is not.")
    return values


def matched(paths: list[Path]) -> list[Path]:
    """Put the files that a pattern matches in its place, for shells that leave patterns as they are.

    Parameters
    ----------
    paths : as typed.

    Raises
    ------
    UsageError
        If a pattern matches no file.
    """
    found: list[Path] = []
    for path in paths:
        is_pattern = any(c in str(path) for c in "*?[") and not path.exists()
        files = sorted(map(Path, glob(str(path), recursive=True))) if is_pattern else [path]
        if not files:
            raise UsageError(f"No file matches the pattern {path}.")
        found += files
    return found


def moved(text: str) -> tuple[float, float]:
    """Return m/s² and rad/s of biases that move by mg and °/h as typed.

    Parameters
    ----------
    text : as typed.

    Raises
    ------
    UsageError
        If it is not two numbers.
    """
    force, rate = numbers(text, "--turn-on-bias", 2)
    return force * 9.80665e-3, math.radians(rate) / 3600.0


def check_turn_on(turn_on: Sequence[float]) -> None:
    """Refuse biases that move by less than nothing from one power cycle to the next.

    Parameters
    ----------
    turn_on : of the accelerometers and the gyros, one sigma.

    Raises
    ------
    UsageError
        If they are no two numbers, or one is negative or endless.
    """
    if len(turn_on) != 2 or not all(0.0 <= sigma < math.inf for sigma in turn_on):
        raise UsageError("--turn-on-bias takes two numbers that are not negative: mg and °/h.")


def lever_arm(text: str) -> tuple[float, ...]:
    """Return three numbers in metres as typed."""
    return numbers(text, "--lever-arm", 3)


def share(ppm: float) -> float:
    """Return a share of one."""
    return 1e-6 * ppm


WHAT = (
    "A recording: a file (CSV, text, Parquet, NPY, MATLAB, a ROS bag, MCAP, a flight log, ...), a folder, "
    "or a pair of files with one triad each."
)


CALIBRATION = positional("CALIBRATION", kind=Path, help="calibration.json, or the folder that holds it.")
RECORDINGS = positional("RECORDING...", kind=list[Path], read=matched, help=WHAT)


@dataclass(frozen=True, kw_only=True)
class StreamRequest:
    """What samples do not say themselves.

    Attributes
    ----------
    units : Units as g,deg/s,ms; counts; '16384 LSB/g'; m/s,rad for increments; degF or K of the temperature; or a chip
        with its ranges, as mpu6050,2g,250dps.
    columns : What the columns are, as t,ax,ay,az,gx,gy,gz,mx,my,mz; - skips one, -ay reverses one.
    rate : Sampling rate of a file without time stamps; of any with its standard uncertainty, as 100±0.1; crystal where
        a crystal times the stamps.
    """

    units: str | None = option(FILE, "UNIT,...", by_unit=True)
    columns: str | None = option(FILE, "NAME,...", by_unit=True)
    rate: float | str | None = option(FILE, "HZ[±HZ]", kind=str | None, by_unit=True)


@dataclass(frozen=True, kw_only=True)
class FileRequest(StreamRequest):
    """What a recording's file does not say itself.

    Attributes
    ----------
    topics : Topic or message of a bag or log; twice for an accelerometer and a gyro apart.
    """

    topics: str | Sequence[str] | None = option(FILE, "NAME", "--topic", kind=list[str] | None)

    def how(self) -> dict[str, Any]:
        """Return what the files do not say, as the readers take it.

        Raises
        ------
        UsageError
            If something is said of a recording that was read already.
        """
        from tumble.recording import Recording

        said = {name: getattr(self, name) for name in ("columns", "units", "rate", "topics")}
        if isinstance(getattr(self, "paths", None), Recording) and any(said.values()):
            raise UsageError(
                "A Recording was read already: say columns, units, rate and topics when it is read, not afterwards."
            )
        return said


@dataclass(frozen=True, kw_only=True)
class NoiseRequest(FileRequest):
    """What is asked of `analyse_noise`.

    Attributes
    ----------
    paths : one recording (a file, or a pair of files with one triad each); a data frame of pandas or polars stands for
        a file, and a `Recording` for what was read.
    output : Folder for noise.json and noise.html.
    skip : Seconds at the start to leave out, such as warm-up.
    remove_temperature : Take a straight line in the temperature off first.
    fit : How the terms are found: curve, a weighted fit of the whole curve (default), or moments, the generalized
        method of wavelet moments.
    progress : called with a sentence on what is being done.
    """

    paths: Paths | Recording = field(kw_only=False, metadata=RECORDINGS)
    skip: float = option(FIRST, "S", default=0.0, kind=float)
    remove_temperature: bool = option(FIRST, "", "--remove-temperature", default=False)
    fit: str = option(ADVANCED, "WAY", default="curve")
    output: str | os.PathLike[str] | None = option(FIRST, "DIR", "--output", "-o", kind=Path | None)
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True)
class ApplyRequest(FileRequest):
    """What is asked of `apply`.

    Attributes
    ----------
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    paths : the recording, as for `tumble.read_recording`.
    temperature : Temperature of the whole recording in °C, where it has no column of it.
    outside : Beyond the calibrated temperatures: refuse (default), hold the parameters of the span's end, or
        extrapolate.
    output : The corrected file: .csv or .parquet. Of a bag: a bag of its kind. A name without an ending: a folder like
        EuRoC's. By default NAME-corrected, as the recording is, else .csv.
    shift_lag : Take out the lag between the triads that the calibration states.
    progress : is given the number of samples done.
    """

    calibration: str | os.PathLike[str] | Calibration = field(kw_only=False, metadata=CALIBRATION)
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = field(
        kw_only=False, metadata=RECORDINGS
    )
    temperature: float | None = option(FILE, "CELSIUS", kind=float | None)
    outside: str = option(ADVANCED, "HOW", default="refuse")
    output: str | os.PathLike[str] | None = option(FIRST, "FILE", "--output", "-o", kind=Path | None)
    shift_lag: bool = option(ADVANCED, "", "--shift-lag", default=False)
    progress: Callable[[int], None] | None = None


@dataclass(frozen=True, kw_only=True)
class MountRequest(FileRequest):
    """What is asked of `mount`.

    Attributes
    ----------
    level : A recording at rest with the mount level.
    pitched : A recording at rest with the mount pitched by 90° about its y axis, x up.
    calibration : calibration.json, or the folder that holds it.
    output : The file, or the folder for mount.json (default: mount.json).
    mount_mrad : How well the mount was levelled and turned about its y axis, one sigma.
    progress : called with a sentence on what is being done.
    """

    level: str | os.PathLike[str] = field(kw_only=False, metadata=positional("LEVEL", kind=Path))
    pitched: str | os.PathLike[str] = field(kw_only=False, metadata=positional("PITCHED", kind=Path))
    calibration: str | os.PathLike[str] | Calibration = option(
        FIRST, "CALIBRATION", "--calibration", "-c", default=MISSING, kind=Path
    )
    output: str | os.PathLike[str] = option(FIRST, "PATH", "--output", "-o", default="mount.json", kind=Path)
    mount_mrad: float = option(FIRST, "MRAD", default=0.0, kind=float, show_default=True)
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True)
class CalibrateRequest(FileRequest):
    """What is asked of `calibrate`: of one recording or several, of several turn-ons, or of each unit of a batch.

    Attributes
    ----------
    paths : one recording (a file, or a pair of files with one triad each), or several of one unit. A data frame of
        pandas or polars stands for a file, and a `Recording` for what was read. Empty for those that the protocol
        names.
    prior : What is known beforehand: an earlier calibration.json of this unit (its non-orthogonalities are kept, and
        six poses suffice), a file of `tumble registry fleet`, or a kind: {GRADES}. Batches take no calibration.json.
    confirm_scale : The unit's scale factors are really beyond what units have: no reason against its calibration.
    protocol : What was done to the unit: a protocol file (YAML), or the name of a protocol, such as six-position.
    output : Folder for calibration.json and report.html (default: NAME-calibration).
    procedure : What is believed: {PROCEDURES}; without it the protocol or the recording decides, and it is said why.
    turn_ons : Each RECORDING (a file, acc.csv,gyro.csv, or a protocol file) is the same unit switched on anew: biases
        are each one's own, what is stable is common to all.
    intervals : A file with start and stop of each hold in seconds, instead of finding the holds.
    noise : This unit's own noise, from `tumble noise -o`, in place of what is assumed of it.
    field : Magnetic field there with its unit, and its dip in degrees (49.2uT,66): makes the scale factors of a
        magnetometer absolute. Or by the World Magnetic Model at --site (wmm,11.58,2026-05-03).
    estimator : A paper's own estimator, whose result stands beside the joint one, with the difference in sigmas, and
        with -o in calibration-NAME.json: six-position, multi-position-9, zhang-optimal, ... An unknown NAME lists all
        with their sources.
    monte_carlo : Propagate distributions with N draws (JCGM 101; 10000 take seconds) and say whether the stated
        intervals hold.
    limits : Acceptance limits of parameters, with a decision rule: also say whether the unit is within them.
    registry : The registry: a SQLite file, or postgresql://user:password@host/name.
    notes : Note it in the results: operator, place, instrument, remarks, or any other name. Repeat for several.
    site : gravity and latitude; None takes the protocol's, or else assumes standard gravity with an uncertainty of
        0.015 m/s².
    optional_terms : try g-sensitivity and quadratic terms.
    imu : (model, serial number) to note in the document.
    progress : called with a sentence on what is being done.
    """

    paths: Paths | Recording = field(
        default=(),
        kw_only=False,
        metadata=positional(
            "[RECORDING...]",
            kind=list[Path] | None,
            read=matched,
            of_many=None,
            help=f"{WHAT} None: those that the protocol names.",
        ),
    )
    prior: str | os.PathLike[str] | None = option(
        ADVANCED, "CALIBRATION|GRADE", kind=str | None, complete="grade", by_unit=True
    )
    confirm_scale: bool = option(
        ADVANCED,
        "",
        "--confirm-scale",
        default=False,
        of_many="The units' scale factors are really beyond what units have.",
    )
    protocol: str | os.PathLike[str] | None = option(
        FIRST, "FILE|NAME", kind=str | None, complete="protocol", by_unit=True
    )
    output: str | os.PathLike[str] | None = option(
        FIRST,
        "DIR",
        "--output",
        "-o",
        kind=Path | None,
        of_many=None,
        in_python="folder for ``calibration.json`` and ``report.html``; None writes nothing.",
    )
    procedure: str | None = option(
        FIRST,
        "NAME",
        complete="procedure",
        of_many="As for `tumble calibrate`; without it each unit's own.",
        by_unit=True,
    )
    turn_ons: bool = option(SEVERAL, "", "--turn-ons", default=False, of_many=None)
    intervals: str | os.PathLike[str] | None = option(
        ADVANCED, "FILE", kind=Path | None, alone=True, by_unit=True
    )
    noise: str | os.PathLike[str] | None = option(
        ADVANCED, "NOISE.JSON", kind=Path | None, alone=True, by_unit=True
    )
    field: str | None = option(ADVANCED, "NORM[,DIP]|wmm,LONGITUDE,DATE", alone=True)
    estimator: str | None = option(ADVANCED, "NAME", alone=True)
    monte_carlo: int | None = option(ADVANCED, "N", kind=int | None, alone=True)
    limits: str | os.PathLike[str] | None = option(RECORD, "LIMITS.YAML", kind=Path | None)
    registry: str | None = option(RECORD, "FILE|URL")
    notes: Notes = option(RECORD, "KEY=VALUE", "--note", kind=list[str] | None)
    site: Site | None = None
    optional_terms: bool = True
    imu: tuple[str | None, str | None] = (None, None)
    progress: Callable[[str], None] | None = None

    @property
    def say(self) -> Callable[[str], None]:
        """What is told what is being done."""
        return self.progress or silent


OF_ONE_UNIT = [one.name for one in fields(CalibrateRequest) if (own := option_of(one)) and own.alone]
"""What does not go with several turn-ons."""
OF_NO_BATCH = [
    one.name
    for one in fields(CalibrateRequest)
    if (own := option_of(one)) and (own.alone or own.of_many is None)
]
"""What may not be asked of all units of a batch."""
TURN_ON = "By how much biases move when the unit is switched on anew, one sigma."


@dataclass(frozen=True, kw_only=True)
class UnitRequest:
    """Of what kind a unit is, and what is drawn.

    Attributes
    ----------
    grade : Grade of the unit: {GRADES}.
    seed : What is drawn; the same seed draws the same.
    """

    # What most people hold in their hands, with errors large enough for every procedure to find.
    grade: str = option(FIRST, "GRADE", "--imu", default="consumer-mems", show_default=True, complete="grade")
    seed: int = option(FIRST, "N", default=0, kind=int, show_default=True)


@dataclass(frozen=True, kw_only=True)
class SimulateRequest(UnitRequest):
    """What is asked of `simulate`.

    Attributes
    ----------
    protocol : A protocol file, or the name of a protocol: six-position, multi-position-26 (18, 10, 9), rate-table,
        modified-multi-position, turntable-9 (18), laboratory, strapdown-rotation, thermal-soak, thermal-ramp
        (-tumbled), thermal-fridge, hand-held. `rest` is a unit that lies still, for `tumble noise`.
    unit : Seed of the unit alone: the same unit in another session (default: --seed).
    rate : Sampling rate (default: the protocol's or the grade's own).
    duration : With rest: seconds to record (default: 600).
    units : What the recording is in: SI (default), or counts, as a converter gives them.
    magnetometer : Also record a magnetometer, in µT at its own rate: lis3mdl or rm3100.
    errors : What else is wrong: of the chain to the file, a turntable or a two-axis fixture, the field.
    turn_on : m/s² and rad/s, one sigma by which biases move when the unit is switched on; drawn with the session.
    output : Folder for the files (default: NAME-simulated).
    site : where it is played; None takes the protocol's, or latitude 45°, height 0.
    progress : called with a sentence on what is being done.
    """

    protocol: str | os.PathLike[str] = field(
        kw_only=False, metadata=positional("PROTOCOL", kind=str, complete="protocol")
    )
    unit: int | None = option(FIRST, "N", "--unit-seed", kind=int | None)
    rate: float | None = option(FIRST, "HZ", "--sample-rate", kind=float | None)
    duration: float | None = option(FIRST, "S", kind=float | None)
    units: str = option(ADVANCED, "SI|counts", "--output-units", default="SI")
    magnetometer: str | None = option(ADVANCED, "GRADE")
    errors: SessionErrors | str | os.PathLike[str] | None = option(ADVANCED, "FILE.YAML", kind=Path | None)
    turn_on: tuple[float, float] = option(
        ADVANCED, "MG,DEG/H", "--turn-on-bias", default=(0.0, 0.0), kind=str | None, read=moved, help=TURN_ON
    )
    output: str | os.PathLike[str] | None = option(FIRST, "DIR", "--output", "-o", kind=Path | None)
    site: Site | None = None
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True)
class PredictRequest:
    """What is asked of `predict`.

    Attributes
    ----------
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    seconds : Seconds without aiding, up to 600; may be given several times. Without it 10 and 60.
    data_sheet : A kind of unit, whose data sheet says what is not known of this one: {GRADES}; plans of poses also take
        the file of `tumble registry fleet`.
    noise : what `tumble noise` wrote for this unit; None for the data sheet's.
    turn_on : m/s² and rad/s, by how much biases move since the calibration, one sigma.
    """

    calibration: str | os.PathLike[str] | Calibration = field(kw_only=False, metadata=CALIBRATION)
    seconds: Sequence[float] = option(FIRST, "S", default=(10.0, 60.0), kind=list[float] | None, read=tuple)
    data_sheet: str | None = option(ADVANCED, "GRADE", complete="grade")
    noise: str | os.PathLike[str] | None = shared(CalibrateRequest, "noise")
    turn_on: tuple[float, float] = shared(SimulateRequest, "turn_on")


@dataclass(frozen=True, kw_only=True)
class ConvertRequest:
    """What is asked of `convert_to`.

    Attributes
    ----------
    calibration : calibration.json, or the folder that holds it; with --from another tool's file.
    target : Write it in this tool's form.
    rate : Rate that the consumer runs at, for per-sample noise.
    frame : Frame of corrected vectors, where the form leaves it open.
    temperature : Take a calibration with temperature at this one.
    largest_loss : of the true vector's length, beyond which nothing is written.
    topic : ROS topic, for forms that name one (the bag's, else /imu0).
    noise : a ``noise.json``, for targets that hold noise.
    output : the file, or the folder of a target of several files; by default the target's own name for it.
    """

    calibration: str | os.PathLike[str] | Calibration | None = field(
        default=None, kw_only=False, metadata=positional("[CALIBRATION]", kind=Path | None)
    )
    target: str | None = field(
        default=None,
        kw_only=False,
        metadata=positional("TARGET", "--to", panel=FIRST, complete="target"),
    )
    rate: float | None = option("Noise, for tools that want it", "HZ", "--consumer-rate", kind=float | None)
    frame: str | None = option(ADVANCED, "NAME")
    temperature: float | None = option(ADVANCED, "CELSIUS", "--at-temperature", kind=float | None)
    largest_loss: float = option(
        ADVANCED,
        "PPM",
        default=0.02,
        kind=float,
        read=share,
        typed=20000.0,
        show_default=True,
        help="Refuse what loses more than this of a vector's length.",
    )
    topic: str | None = option(ADVANCED, "NAME", "--ros-topic")
    noise: str | os.PathLike[str] | None = shared(CalibrateRequest, "noise")
    output: str | os.PathLike[str] | None = None


@dataclass(frozen=True, kw_only=True)
class VerifyRequest(FileRequest):
    """What is asked of `verify`.

    Attributes
    ----------
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    paths : recordings, as for `tumble.read_recording`.
    site : where they were made; by default the calibration's own site.
    intervals : file of the holds, instead of finding them.
    progress : called with a sentence on what is being done.
    """

    calibration: str | os.PathLike[str] | Calibration = field(kw_only=False, metadata=CALIBRATION)
    paths: Paths = field(kw_only=False, metadata=RECORDINGS)
    temperature: float | None = shared(ApplyRequest, "temperature")
    site: Site | None = None
    intervals: str | os.PathLike[str] | None = None
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True)
class DriveRequest(VerifyRequest):
    """What is asked of `verify_drive`.

    Attributes
    ----------
    gnss : Satellite positions of a drive (.pos, NMEA, CSV): judge by navigation instead.
    lever_arm_b : m, from the IMU to the antenna, in b; None where it is not known: zero is taken, and the clock is
        known the worse.
    data_sheet : kind of unit, whose spread the uncalibrated states start with.
    turn_on : m/s² and rad/s, by how much biases may have moved since the calibration; None for a quarter of the
        data sheet's spread, at most 0.05 m/s² and 0.005 rad/s.
    """

    lever_arm_b: Sequence[float] | None = option(
        DRIVE,
        "X,Y,Z",
        "--lever-arm",
        kind=str | None,
        read=lever_arm,
        help="Metres from the IMU to the antenna, in b. Without it, 0,0,0.",
    )
    gnss: str | os.PathLike[str] | None = field(
        default=None, kw_only=False, metadata=positional("FILE", panel=DRIVE, kind=Path | None)
    )
    data_sheet: str | None = shared(PredictRequest, "data_sheet")
    turn_on: tuple[float, float] | None = option(
        ADVANCED, "MG,DEG/H", "--turn-on-bias", kind=str | None, read=moved, help=TURN_ON
    )


@dataclass(frozen=True, kw_only=True)
class InspectRequest(FileRequest):
    """What is asked of `inspect`.

    Attributes
    ----------
    paths : as for `tumble.read_recording`.
    save : Convert to this file: .csv or .parquet, raw numbers, time in s.
    """

    paths: Paths = field(kw_only=False, metadata=RECORDINGS)
    save: str | os.PathLike[str] | None = option(FIRST, "FILE", kind=Path | None)


@dataclass(frozen=True, kw_only=True)
class CertificateRequest:
    """What is asked of `make_certificate`.

    Attributes
    ----------
    calibration : calibration.json, or its folder.
    output : The PDF (default: certificate.pdf); as .xml, PTB's digital calibration certificate (DCC 3.3.0).
    profile : What the laboratory says: name, logo, customer, traceability, conditions.
    number : Its number (default: made of the day).
    language : en, de, fr, es or zh.
    date : Day of issue (default: today); the same day makes the same bytes.
    """

    calibration: Path = argument("CALIBRATION", kind=Path)
    output: Path = option(FIRST, "FILE", "--output", "-o", default=Path("certificate.pdf"), kind=Path)
    profile: Path | None = option(FIRST, "PROFILE.YAML", kind=Path | None)
    number: str | None = option(FIRST, "TEXT")
    language: str = option(FIRST, "CODE", default="en", show_default=True)
    date: str | None = option(FIRST, "YYYY-MM-DD")
    registry: str | None = shared(CalibrateRequest, "registry")


@dataclass(frozen=True, kw_only=True)
class ReproduceRequest:
    """What is asked of `reproduce`.

    Attributes
    ----------
    name : What to make anew: an item of the list, or `hayal`, `zhang` or `savage` for all of a paper.
    repetitions : How many simulated runs; hundreds show the range that one run lies in.
    output : Folder for a page, the data and pictures of each item.
    workers : Processes that make a paper's items side by side.
    scheduler : A Dask cluster that makes the items instead.
    executor : any `concurrent.futures.Executor` instead; it is left open.
    progress : called with a sentence on what is being done.
    """

    name: str | None = field(default=None, kw_only=False, metadata=positional("[ITEM]", complete="study"))
    repetitions: int | None = option(FIRST, "N", kind=int | None)
    seed: int = shared(UnitRequest, "seed")
    output: str | os.PathLike[str] | None = option(FIRST, "DIR", "--output", "-o", kind=Path | None)
    workers: int = option(ADVANCED, "N", default=1, kind=int, show_default=True)
    scheduler: str | None = option(ADVANCED, "tcp://HOST:PORT")
    executor: Executor | None = None
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True)
class PlanRequest(UnitRequest):
    """What is asked of `plan`.

    Attributes
    ----------
    asked : What is planned. Poses are searched: multi-position, hand-held, six-position. Any other protocol, by
        name (turntable-9, strapdown-rotation, multi-position-26, …) or as a file, is judged as it is.
    given : What is there already, a recording or a calibration: the next poses, turns or rotations are said, and when
        to stop.
    targets : Wished-for standard uncertainties, as bias=50,scale=100,misalignment=20 in µg, ppm and ″; also
        gyro-bias (°/h), gyro-scale, gyro-misalignment, rotation and g-sensitivity.
    rate : The sample rate with its standard uncertainty, as 100±0.01, which all gyro scale factors share. Without it
        the rate is a nominal one, uncertain by 0.58 %.
    poses : How many poses (9; hand-held 26).
    minutes : Instead of --poses: how long the test may last; poses and dwells are then as many and as long as is best.
    hold : Seconds of rest in each pose (30; hand-held 4).
    turn : Seconds from one pose to the next (3; hand-held 2).
    recorded : With --given RECORDING: the protocol that it was recorded with, which has the table's angles.
    output : A folder for protocol.yaml, plan.json and sheet.html.
    site : of the test; the protocol's own, or latitude 45°, without.
    steps : judge every step, too.
    progress : called with a sentence on what is being done.
    """

    asked: str = argument("PROTOCOL", complete="protocol")
    given: str | os.PathLike[str] | None = option(FIRST, "FILE", kind=Path | None)
    targets: str | None = option(FIRST, "NAME=N,...")
    rate: str | None = option(ADVANCED, "HZ[±HZ]")
    data_sheet: str | None = shared(PredictRequest, "data_sheet")
    poses: int | None = option(POSES, "N", kind=int | None)
    minutes: float | None = option(POSES, "MINUTES", "--time", kind=float | None)
    hold: float | None = option(FIRST, "S", kind=float | None)
    turn: float | None = option(POSES, "S", "--turn-seconds", kind=float | None)
    noise: str | os.PathLike[str] | None = shared(CalibrateRequest, "noise")
    recorded: str | os.PathLike[str] | None = option(ADVANCED, "FILE", "--protocol", kind=str | None)
    output: str | os.PathLike[str] | None = option(FIRST, "FOLDER", "--output", "-o", kind=Path | None)
    site: Site | None = None
    steps: bool = True
    progress: Callable[[str], None] = silent


def notes_of(given: Notes) -> dict[str, str]:
    """Return notes by name, in the order in which they were given.

    Parameters
    ----------
    given : by name, or as texts ``KEY=VALUE``.

    Raises
    ------
    UsageError
        If one has no name or no value, is given twice, or holds a line break or another control character.
    """
    from tumble.files import HIDDEN

    if given is None:
        return {}
    if isinstance(given, str):
        given = [given]
    pairs = given.items() if isinstance(given, Mapping) else [text.partition("=")[::2] for text in given]
    notes: dict[str, str] = {}
    for key, value in pairs:
        name, said = str(key).strip().lower(), str(value).strip()
        if not name or not said:
            raise UsageError(f"--note {key}={value}: give a name and a value, as --note operator='A. Smith'.")
        if HIDDEN.search(name) or HIDDEN.search(said):
            raise UsageError(
                f"--note {name!r}: it holds a line break or another control character: leave it out."
            )
        if name in notes:
            raise UsageError(f"--note {name} is given twice: give it once.")
        notes[name] = said
    return notes
