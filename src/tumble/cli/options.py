"""Options that several commands share, each declared once, and the groups in which commands take them.

What the shell completes after `tumble`: names from the registries, read when they are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from glob import glob
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from tumble.cli.groups import ADVANCED, FILE, FIRST, PLACE, PRINTED, RECORD, option
from tumble.errors import UsageError
from tumble.records import dataclass


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def complete_procedure(incomplete: str) -> list[str]:
    """Return the procedures that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.procedure_names import KNOWN_PROCEDURES

    return _beginning(KNOWN_PROCEDURES, incomplete)


def complete_protocol(incomplete: str) -> list[str]:
    """Return the named protocols that begin so; the shell completes files where there is none.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.protocol.library import PROTOCOLS

    return _beginning(PROTOCOLS, incomplete)


def complete_grade(incomplete: str) -> list[str]:
    """Return the grades of units that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.simulation.grades import GRADES

    return _beginning(GRADES, incomplete)


def complete_target(incomplete: str) -> list[str]:
    """Return the forms of other tools that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.export.target import targets

    return _beginning(targets(), incomplete)


def complete_study(incomplete: str) -> list[str]:
    """Return the papers' tables and figures that begin so.

    Parameters
    ----------
    incomplete : what was typed.
    """
    from tumble.reproduction.items import all_items

    return _beginning(all_items(), incomplete)


def _matched(paths: list[Path] | None) -> list[Path] | None:
    """Put the files that a pattern matches in its place, for shells that leave patterns as they are.

    Raises
    ------
    UsageError
        If a pattern matches no file.
    """
    if not paths:
        return paths
    matched: list[Path] = []
    for path in paths:
        is_pattern = any(c in str(path) for c in "*?[") and not path.exists()
        found = sorted(map(Path, glob(str(path), recursive=True))) if is_pattern else [path]
        if not found:
            raise UsageError(f"No file matches the pattern {path}.")
        matched += found
    return matched


_WHAT = (
    "A recording: a file (CSV, text, Parquet, NPY, MATLAB, a ROS bag, MCAP, a flight log, ...), a folder, "
    "or a pair of files with one triad each."
)
GRADES = "consumer-mems, industrial-mems, hg1900, hg1700, tactical, ring-laser"

Recordings: TypeAlias = Annotated[
    list[Path], typer.Argument(help=_WHAT, metavar="RECORDING...", callback=_matched)
]
OptionalRecordings: TypeAlias = Annotated[
    list[Path] | None,
    typer.Argument(
        help=f"{_WHAT} None: those that the protocol names.",
        metavar="[RECORDING...]",
        show_default=False,
        callback=_matched,
    ),
]
CalibrationArgument: TypeAlias = Annotated[
    Path, typer.Argument(metavar="CALIBRATION", help="calibration.json, or the folder that holds it.")
]
NoiseFile: TypeAlias = Annotated[
    Path | None,
    option(
        ADVANCED,
        "NOISE.JSON",
        "This unit's own noise, from `tumble noise -o`, in place of what is assumed of it.",
        "--noise",
    ),
]
Limits: TypeAlias = Annotated[
    Path | None,
    option(
        RECORD,
        "LIMITS.YAML",
        "Acceptance limits of parameters, with a decision rule: also say whether the unit is within them.",
        "--limits",
    ),
]


@dataclass(frozen=True)
class UnitOptions:
    """What a unit is called."""

    imu_model: Annotated[str | None, option(RECORD, "MODEL", "Model of the unit, noted in the file.")] = None
    imu_serial: Annotated[
        str | None, option(RECORD, "SERIAL", "Serial number of the unit, noted in the file.")
    ] = None

    @property
    def imu(self) -> tuple[str | None, str | None]:
        """Model and serial number."""
        return self.imu_model, self.imu_serial


RegistryName: TypeAlias = Annotated[
    str | None,
    option(
        RECORD,
        "FILE|URL",
        "The registry: a SQLite file, or postgresql://user:password@host/name.",
        "--registry",
    ),
]
NoteOption: TypeAlias = Annotated[
    list[str] | None,
    option(
        RECORD,
        "KEY=VALUE",
        "Note it in the results: operator, place, instrument, remarks, or any other name. Repeat for several.",
        "--note",
    ),
]
Prior: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "CALIBRATION|GRADE",
        "What is known beforehand: an earlier calibration.json of this unit (its non-orthogonalities are kept, and six "
        f"poses suffice), a file of `tumble registry fleet`, or a kind: {GRADES}. Batches take no calibration.json.",
        "--prior",
        complete=complete_grade,
    ),
]
DataSheet: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "GRADE",
        f"A kind of unit, whose data sheet says what is not known of this one: {GRADES}; plans of poses also take "
        "the file of `tumble registry fleet`.",
        "--data-sheet",
        complete=complete_grade,
    ),
]
Temperature: TypeAlias = Annotated[
    float | None,
    option(
        FILE,
        "CELSIUS",
        "Temperature of the whole recording in °C, where it has no column of it.",
        "--temperature",
    ),
]
TurnOnBias: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "MG,DEG/H",
        "By how much biases move when the unit is switched on anew, one sigma.",
        "--turn-on-bias",
    ),
]
Seed: TypeAlias = Annotated[
    int, option(FIRST, "N", "What is drawn; the same seed draws the same.", "--seed", show_default=True)
]
Imu: TypeAlias = Annotated[
    str,
    option(
        FIRST,
        "GRADE",
        f"Grade of the unit: {GRADES}.",
        "--imu",
        show_default=True,
        complete=complete_grade,
    ),
]
Protocol: TypeAlias = Annotated[
    str | None,
    option(
        FIRST,
        "FILE|NAME",
        "What was done to the unit: a protocol file (YAML), or the name of a protocol, such as six-position.",
        "--protocol",
        complete=complete_protocol,
    ),
]
Intervals: TypeAlias = Annotated[
    Path | None,
    option(
        ADVANCED,
        "FILE",
        "A file with start and stop of each hold in seconds, instead of finding the holds.",
        "--intervals",
    ),
]
Json: TypeAlias = Annotated[bool, option(PRINTED, "", "Print everything as JSON.", "--json")]
Quiet: TypeAlias = Annotated[bool, option(PRINTED, "", "Print the verdict only.", "--quiet", "-q")]
Verbose: TypeAlias = Annotated[bool, option(PRINTED, "", "Print more of what was found.", "--verbose", "-v")]


def output_option(help: str, metavar: str = "DIR") -> object:
    """Declare ``-o``: where a command writes.

    Parameters
    ----------
    help : what it writes, and where it does without.
    metavar : whether a folder, a file or either is asked for.
    """
    return option(FIRST, metavar, help, "--output", "-o")


@dataclass(frozen=True)
class StreamOptions:
    """What samples do not say themselves."""

    units: Annotated[
        str | None,
        option(
            FILE,
            "UNIT,...",
            "Units as g,deg/s,ms; counts; '16384 LSB/g'; m/s,rad for increments; degF or K of the temperature; or "
            "a chip with its ranges, as mpu6050,2g,250dps.",
        ),
    ] = None
    columns: Annotated[
        str | None,
        option(
            FILE,
            "NAME,...",
            "What the columns are, as t,ax,ay,az,gx,gy,gz,mx,my,mz; - skips one, -ay reverses one.",
        ),
    ] = None
    rate: Annotated[
        str | None,
        option(
            FILE,
            "HZ[±HZ]",
            "Sampling rate of a file without time stamps; of any with its standard uncertainty, as 100±0.1; crystal "
            "where a crystal times the stamps.",
        ),
    ] = None


@dataclass(frozen=True)
class FileOptions(StreamOptions):
    """What a recording's file does not say itself."""

    topics: Annotated[
        list[str] | None,
        option(
            FILE,
            "NAME",
            "Topic or message of a bag or log; twice for an accelerometer and a gyro apart.",
            "--topic",
        ),
    ] = None

    def given(self) -> dict[str, Any]:
        """Return what was given as the library takes it."""
        return {"units": self.units, "columns": self.columns, "rate": self.rate, "topics": self.topics}


@dataclass(frozen=True)
class SiteOptions:
    """Where a recording was made."""

    site: Annotated[
        str | None,
        option(
            PLACE, "LAT[,H]", "Latitude in degrees and height in metres, for gravity and the Earth's rate."
        ),
    ] = None
    gravity: Annotated[
        str | None,
        option(PLACE, "G[±U]", "Gravity there in m/s², good to half its last digit, or as 9.80788±0.00002."),
    ] = None


@dataclass(frozen=True)
class TemperatureOptions:
    """At which temperature a calibration is applied."""

    temperature: Temperature = None
    outside: Annotated[
        str,
        option(
            ADVANCED,
            "HOW",
            "Beyond the calibrated temperatures: refuse (default), hold the parameters of the span's end, or "
            "extrapolate.",
        ),
    ] = "refuse"


@dataclass(frozen=True)
class PrintOptions:
    """How an answer is printed."""

    as_json: Json = False
    quiet: Quiet = False

    @property
    def silent(self) -> bool:
        """Whether nothing is shown while work is going on."""
        return self.as_json or self.quiet


@dataclass(frozen=True)
class LongPrintOptions(PrintOptions):
    """How an answer with details is printed."""

    verbose: Verbose = False


FiguresOption: TypeAlias = Annotated[
    str | None,
    option(
        ADVANCED,
        "pdf|svg|png",
        "Also draw the figures of the page for a paper, one column wide, in the folder figures beside it.",
        "--figures",
    ),
]


def check_figures(form: str | None, output: Path | None) -> None:
    """Refuse before minutes of work what cannot be drawn.

    Parameters
    ----------
    form : as asked for, or None.
    output : where the page will be, or None.

    Raises
    ------
    UsageError
        If the form is unknown, no page is written, or the library is not installed.
    """
    if form is None:
        return
    from tumble.report.figures.on_paper import FORMS, require_library

    if form not in FORMS:
        raise UsageError(f"--figures {form}: give one of {', '.join(FORMS)}.")
    if output is None:
        raise UsageError("--figures draws the figures of the page, and no page is written: give -o FOLDER.")
    require_library()


def draw_figures(form: str | None, page: Callable[[], Any], files: Iterable[Path]) -> list[Path]:
    """Draw the figures of a page beside the file that holds it; return what was drawn.

    Parameters
    ----------
    form : as asked for, or None.
    page : makes the page.
    files : that were written, the page among them.

    Raises
    ------
    OutputError
        If a figure cannot be written.
    """
    folders = [file.parent for file in files if file.suffix == ".html"]
    if form is None or not folders:
        return []
    from tumble.report.figures.on_paper import write_figures

    return write_figures(page().figures, folders[0] / "figures", form)
