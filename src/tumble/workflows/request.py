"""What a user may ask of a workflow, and how: each option is declared once, in a record.

A request is a frozen record. The command line makes its options of it, and `asked` the signature of a Python function
and the parameters of its docstring. A workflow takes the record itself, and hands it on as one thing.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, field, fields, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tumble.errors import UsageError
from tumble.procedure_names import KNOWN_PROCEDURES
from tumble.records import dataclass
from tumble.workflows.progress import public, silent

if TYPE_CHECKING:
    from tumble.document import Calibration
    from tumble.earth import Site
    from tumble.recording import Recording
    from tumble.recording.reading import Paths

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
    kind : as what its value is read; None as its annotation says.
    complete : what the shell completes, of `tumble.cli.groups.NAMES`.
    show_default : whether the help shows the default.
    alone : it goes with one recording of one unit alone: not with ``--turn-ons``, and not with batches.
    of_many : the help where it holds for all units of a batch; None if it does not go there.
    by_unit : a manifest may say it unit by unit.
    in_python : what it says of the parameter of a function, where that is another thing.
    help : what it says, where no docstring does.
    """

    panel: str
    metavar: str
    names: tuple[str, ...]
    kind: Any = None
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


def argument(metavar: str, *, default: Any = MISSING, **more: Any) -> Any:
    """Declare a parameter that stands without a name on the command line.

    Parameters
    ----------
    metavar, default, more : as for `option`.
    """
    return option(ARGUMENT, metavar, default=default, **more)


def shared(record: Any, name: str) -> Any:
    """Declare an option as a record has it.

    Parameters
    ----------
    record, name : where it is declared.
    """
    (own,) = (option_of(one) for one in fields(record) if one.name == name)
    assert own is not None
    return field(metadata={"option": replace(own, help=words_of(record)[name])})


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

    Parameters
    ----------
    record : the class of the request.
    """

    def made(work: Callable[[Request], Answer]) -> Callable[P, Answer]:
        @wraps(work)
        def called(*args: P.args, **kwargs: P.kwargs) -> Answer:
            return work(record(*args, **kwargs))

        kind: Any = record
        shape = inspect.signature(kind).replace(return_annotation=work.__annotations__["return"])
        called.__signature__ = shape  # type: ignore[attr-defined]
        words = words_of(kind) | {
            one.name: own.in_python for one in fields(kind) if (own := option_of(one)) and own.in_python
        }
        listed = "".join(f"{name} : {words[name]}\n" for name in shape.parameters)
        before, raises, after = inspect.cleandoc(work.__doc__ or "").partition("Raises\n------\n")
        called.__doc__ = f"{before}Parameters\n----------\n{listed}\n{raises}{after}"
        return public(called)

    return made


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

    paths: Paths | Recording = field(kw_only=False)
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

    calibration: str | os.PathLike[str] | Calibration = field(kw_only=False)
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = field(kw_only=False)
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
    level : a recording at rest with the mount level.
    pitched : one with the mount pitched by 90° about y, x up.
    calibration : a ``calibration.json``, its folder, or a `Calibration`.
    output : The file, or the folder for mount.json (default: mount.json).
    mount_mrad : How well the mount was levelled and turned about its y axis, one sigma.
    progress : called with a sentence on what is being done.
    """

    level: str | os.PathLike[str] = field(kw_only=False)
    pitched: str | os.PathLike[str] = field(kw_only=False)
    calibration: str | os.PathLike[str] | Calibration = field(kw_only=False)
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

    paths: Paths | Recording = field(default=(), kw_only=False)
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

    def refuse_beside_turn_ons(self) -> None:
        """Refuse what belongs to a single recording.

        Raises
        ------
        UsageError
            If it was given with `turn_ons`.
        """
        if self.procedure not in (None, "joint"):
            raise UsageError(
                f"--turn-ons is the joint estimator's, and --procedure {self.procedure} was asked for: leave one of "
                "them out."
            )
        for one in fields(self):
            if (found := option_of(one)) and found.alone and getattr(self, one.name) != one.default:
                name = one.name.replace("_", "-")
                raise UsageError(f"--{name} does not go with --turn-ons: leave one of them out.")


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
    pairs = list(given.items()) if isinstance(given, Mapping) else [_parted(text) for text in given]
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


def _parted(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"--note {text}: give a name and a value, as --note operator='A. Smith'.")
    return key, value
