"""`Target`: another tool's form of a calibration, as its template in `export/targets` begins.

A template is ``NAME.j2``: between two lines ``---`` a record in YAML, then the text in Jinja2. What the record holds of
each triad is all that the template is given, and what it does not hold is the loss that is stated.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, cast

from tumble.errors import UsageError
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.export.subject import Subject

MATRIX = "full matrix"
SCALE = "scale factors"
BIAS = "biases"
G_SENSITIVITY = "g-sensitivity"
CURVED = ("asymmetry", "quadratic")
"""The curves of a triad that templates write; another one is lost."""
NONLINEAR = f"{' and '.join(CURVED)} terms"
TEMPERATURE = "temperature"
MAGNETOMETER = "magnetometer"
NOISE = "noise"
HOLDABLE = (MATRIX, SCALE, BIAS, G_SENSITIVITY, NONLINEAR, TEMPERATURE, MAGNETOMETER, NOISE)
READ = ("ardupilot", "imu-tk", "kalibr", "px4")
"""Targets that are read, too: `tumble.export.readers` says how."""

FOLDER = files("tumble") / "export" / "targets"
_FENCE = "---\n"


@dataclass(frozen=True)
class Target:
    """A form that calibrations are written in, and perhaps read from: the record of a template.

    Attributes
    ----------
    name : as ``--to`` and ``--from`` take it.
    title, tool : the tool and its file; the tool alone.
    file : name of the file that is written by default; of several files that of their folder.
    files : names of several files, for each of which the template is filled in once.
    accelerometer, gyroscope : what it holds of the triads: of `MATRIX`, `SCALE`, `BIAS`, `G_SENSITIVITY`, `NONLINEAR`.
    temperature : whether it holds biases over temperature, as cubic polynomials.
    magnetometer : the unit of a symmetric matrix, "any" for any matrix in any unit, or None.
    noise : None, "held" or "needed"; where it is needed, a calibration is not.
    units : raw units of specific force and angular rate that the tool works in; None takes the calibration's.
    output : units that a test vector's corrected numbers are in.
    frame : that the form's zeros ask for, or None: any.
    replaces : whether its numbers go where others stand that may have been active while the unit was recorded.
    comment : what begins a comment line, empty where the format has none; `template.escaped` knows each.
    formula : lines, in the tool's own names.
    loses : further losses, in words.
    """

    name: str
    title: str
    file: str
    tool: str = ""
    files: tuple[str, ...] = ()
    accelerometer: tuple[str, ...] = ()
    gyroscope: tuple[str, ...] = ()
    temperature: bool = False
    magnetometer: str | None = None
    noise: str | None = None
    units: tuple[str, str] | None = ("m/s^2", "rad/s")
    output: tuple[str, str] = ("m/s^2", "rad/s")
    frame: str | None = None
    comment: str = "#"
    formula: tuple[str, ...] = ()
    loses: tuple[str, ...] = ()
    replaces: bool = False

    @property
    def holds(self) -> tuple[str, ...]:
        """Return all that it holds, of either triad."""
        kept = {*self.accelerometer, *self.gyroscope}
        more = ((TEMPERATURE, self.temperature), (MAGNETOMETER, self.magnetometer), (NOISE, self.noise))
        kept |= {what for what, there in more if there}
        return tuple(what for what in HOLDABLE if what in kept)

    @property
    def corrects(self) -> bool:
        """Return whether it holds anything of accelerometers or gyros."""
        return bool(self.accelerometer or self.gyroscope)

    @property
    def needs_noise(self) -> bool:
        """Return whether noise must be there, and a calibration need not."""
        return self.noise == "needed"

    @property
    def needs_magnetometer(self) -> bool:
        """Return whether it is of a magnetometer alone."""
        return self.magnetometer is not None and not self.corrects

    @property
    def directions(self) -> str:
        """Return ``to``, or ``to and from``."""
        return "to and from" if self.name in READ else "to"

    def write(self, subject: Subject) -> dict[str, str]:
        """Return texts by file name."""
        from tumble.export.template import filled

        names = self.files or (self.file,)
        return {name: filled(self, subject, name) for name in names}


def parts_of(name: str) -> tuple[str, str]:
    """Return the record and the text of a target's template."""
    _, record, text = (FOLDER / f"{name}.j2").read_text(encoding="utf-8").split(_FENCE, 2)
    return record, text


def _target(name: str) -> Target:
    import yaml

    record: dict[str, Any] = yaml.load(parts_of(name)[0], getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    made: dict[str, Any] = {"tool": record["title"], **record, "name": name}
    for key, value in record.items():
        if isinstance(value, list):
            made[key] = tuple(cast("list[Any]", value))
    return Target(**made)


@cache
def targets() -> dict[str, Target]:
    """Return all targets by name: each template of `export/targets`."""
    names = sorted(entry.name.removesuffix(".j2") for entry in FOLDER.iterdir() if entry.name.endswith(".j2"))
    return {name: _target(name) for name in names}


def find_target(name: str, *, reading: bool = False) -> Target:
    """Return the target of a name.

    Parameters
    ----------
    name : as ``--to`` takes it.
    reading : it is to be read from.

    Raises
    ------
    UsageError
        If there is none, or it can be written only.
    """
    known = targets()
    if name not in known:
        raise UsageError(f"There is no target {name!r}: choose one of {', '.join(known)}.")
    if reading and name not in READ:
        raise UsageError(
            f"{known[name].title} is written only. Read are {', '.join(READ)}: put the numbers into the form of one of "
            "them, of which imu-tk takes any matrix and bias (docs/targets/backward.md)."
        )
    return known[name]
