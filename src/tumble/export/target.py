"""`Target`: another tool's form of a calibration, as its template in `export/targets` begins.

A template is ``NAME.j2``: between two lines ``---`` a record in YAML, then the text in Jinja2. What the record holds of
each triad is all that the template is given, and what it does not hold is the loss that is stated.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial, reduce
from importlib.resources import files
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tumble.arrays import AnyArray, Matrix, Vector
from tumble.errors import UsageError, __version__
from tumble.export.subject import FieldCorrection, Subject, field_lines
from tumble.files import shown
from tumble.records import dataclass
from tumble.sensor import Triad, inverse, lower_factor, upper_factor
from tumble.units import DEGREE, STANDARD_GRAVITY

if TYPE_CHECKING:
    from jinja2 import Environment


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
    comment : what begins a comment line, empty where the format has none; `escaped` knows each.
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
        """Return all that it holds, of either triad, in words; a full matrix covers scale factors."""
        kept = {*self.accelerometer, *self.gyroscope}
        more = ((TEMPERATURE, self.temperature), (MAGNETOMETER, self.magnetometer), (NOISE, self.noise))
        kept |= {what for what, there in more if there}
        return tuple(what for what in HOLDABLE if what in kept and not (what == SCALE and MATRIX in kept))

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


DEGREES = 180.0 / np.pi
_LARGEST_REGISTER = 32767


def number(value: float) -> str:
    """Return a number with all its digits, always with a point or an exponent that YAML 1.1 takes for a number."""
    text = repr(float(value) + 0.0)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return text


def row(values: Iterable[Any]) -> str:
    """Return numbers in brackets."""
    return "[" + ", ".join(number(v) for v in np.asarray(values, dtype=float)) + "]"


def _rows(matrix: Any, indent: int) -> str:
    """A matrix as a YAML list of rows, each on its own line."""
    return "\n".join(" " * indent + "- " + row(line) for line in np.asarray(matrix, dtype=float))


def _nine(value: float) -> str:
    return f"{value:.9g}"


def _single(value: float) -> str:
    """A parameter of single precision."""
    return _nine(float(np.float32(value)))


def _c_float(value: float) -> str:
    text = _nine(value)
    return (text if "." in text or "e" in text else text + ".0") + "f"


_CELLS: dict[str, Callable[[float], str]] = {
    "number": number,
    "nine": _nine,
    "float": _c_float,
    "single": lambda v: _c_float(float(np.float32(v)) + 0.0),
}


def _numbers(values: Iterable[Any], between: str, cell: str = "number") -> str:
    return between.join(_CELLS[cell](v) for v in values)


def _braces(values: Any, cell: str = "number", between: str = ", ", *, pairs: bool = False) -> str:
    """Numbers as C has them, a matrix by rows; std::array wants its braces in pairs."""
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        return "{" + _numbers(array, ", ", cell) + "}"
    body = "{" + between.join(_braces(line, cell) for line in array) + "}"
    return "{" + body + "}" if pairs else body


def _yaml_text(text: str) -> str:
    """A text as a YAML value: as it is where it is a plain name, else in double quotes."""
    return text if re.fullmatch(r"[A-Za-z/][A-Za-z0-9_/.-]*", text) else _quoted(text)


def _quoted(text: str) -> str:
    """A text in the double quotes of YAML (and of OpenCV), hidden characters as their numbers."""
    return json.dumps(shown(text), ensure_ascii=False)


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, default=_plain)


def _plain(value: AnyArray) -> Any:
    return value.tolist()


def _checksum(body: str) -> str:
    """VectorNav's: the XOR of the bytes between $ and *."""
    return f"{reduce(lambda total, byte: total ^ byte, body.encode('utf-8'), 0):02X}"


def _packet(field: FieldCorrection) -> str:
    """The 68 bytes that MotionCal sends to a board, with Modbus' CRC-16 (0xA001 reflected, from 0xFFFF)."""
    S = field.soft_iron
    numbers = [*np.zeros(6), *field.hard_iron, field.norm]
    numbers += [S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[0, 2], S[1, 2]]
    body = bytes((117, 84)) + struct.pack("<16f", *numbers)
    check = 0xFFFF
    for byte in body:
        check ^= byte
        for _ in range(8):
            check = (check >> 1) ^ 0xA001 if check & 1 else check >> 1
    return (body + struct.pack("<H", check)).hex(" ")


def _register(bias: Vector, per_unit: float, name: str) -> str:
    """What is added to a register of 16 bits."""
    made = np.round(-per_unit * bias)
    if np.abs(made).max() > _LARGEST_REGISTER:
        raise UsageError(
            f"The {name}' bias of {np.abs(bias).max():.3g} does not fit into the MPU-6050's registers of 16 bits. See "
            "whether the calibration is in the units that it states."
        )
    return ", ".join(f"{v:.0f}" for v in made + 0.0)


class Form:
    """A triad's numbers in the shapes that tools ask for; forward: ``u = matrix f + bias``."""

    def __init__(self, triad: Triad) -> None:
        self.matrix: Matrix = triad.matrix
        self.bias: Vector = triad.bias
        self.inverse: Matrix = inverse(triad.matrix)
        self.offset: Vector = self.inverse @ triad.bias
        self.asymmetry = np.zeros(3) if triad.asymmetry is None else triad.asymmetry
        self.quadratic = np.zeros(3) if triad.quadratic is None else triad.quadratic

    @property
    def exact_inverse(self) -> Matrix:
        """The inverse by elimination."""
        return np.asarray(np.linalg.inv(self.matrix), dtype=np.float64)

    def split(self, triangle: str) -> tuple[Matrix, Matrix]:
        """The matrix as a lower or upper triangle and the rotation before it."""
        own = (lower_factor if triangle == "lower" else upper_factor)(self.matrix)
        return own, np.asarray(np.linalg.solve(own, self.matrix), dtype=np.float64)

    @property
    def static_factors(self) -> tuple[Matrix, Matrix]:
        """imu_tk's T and K: ``inverse = T K``, T of unit diagonal, K diagonal."""
        scale = np.diag(np.diag(self.inverse))
        T = self.inverse @ inverse(scale)
        np.fill_diagonal(T, 1.0)
        return T, scale


def _quaternion(matrix: Matrix) -> Vector:
    """x, y, z, w of a rotation."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_quat(canonical=True))


def head(subject: Subject, target: Target) -> list[str]:
    """Return the sentences that a file begins with: what it is, formula, frame, test vector, losses."""
    lines = [f"{target.title}, written by tumble {__version__}"]
    calibration = subject.calibration
    if calibration is None:
        lines += target.formula
    else:
        unit = " ".join(p for p in (calibration.imu.model, calibration.imu.serial_number) if p)
        lines.append(
            f"from calibration {calibration.identity} of {calibration.created}"
            + (f", unit {unit}" if unit else "")
        )
        lines += target.formula
        lines.append(
            f"raw in {subject.units[0]} and {subject.units[1]}; corrected vectors in frame {subject.frame}:"
        )
        lines.append(f"  {subject.frame_words}")
        lines += _example(subject, target)
    lines += [f"note: {remark}" for remark in subject.remarks]
    if subject.noise is not None:
        lines += [f"note: {remark}" for remark in subject.noise.remarks]
    return [*lines, *(f"loss: {loss.text}" for loss in subject.losses)]


def _example(subject: Subject, target: Target) -> list[str]:
    """A test vector: raw in, corrected out in the tool's units."""
    if not target.corrects:
        return []
    raw_force, raw_rate, force, rate = subject.vectors()
    scale = [1.0 / STANDARD_GRAVITY, DEGREES] if target.output == ("g", "deg/s") else [1.0, 1.0]
    curves = subject.curves
    at = f" at {curves.reference:g} degrees Celsius" if any(curves.used) else ""
    return [
        f"test vector: raw specific force {row(raw_force[2])}, raw angular rate {row(raw_rate[2])}{at}",
        f"  corrected to {row(scale[0] * force[2])}, {row(scale[1] * rate[2])} ({', '.join(target.output)})",
    ]


def commented(lines: Sequence[str], mark: str = "#") -> str:
    """Return lines behind a comment mark, so that no text in them ends the comment (see `escaped`)."""
    return "".join(f"{mark} {escaped(line, mark)}".rstrip() + "\n" for line in lines)


def escaped(text: str, mark: str) -> str:
    """Return a text as it may stand in a comment of the language whose comments begin with a mark.

    A calibration's texts come from anywhere: a name with a line break in it would go on as code.

    Parameters
    ----------
    text : one line; a line break or another hidden character in it is written as its number.
    mark : ``#`` of Python, YAML and parameters, ``//`` of C++, an asterisk of C, ``%`` of MATLAB.
    """
    line = shown(text).rstrip()
    if mark in ("//", " *"):
        # The end of the comment; trigraphs, of which ??/ is a backslash; a backslash that joins the next line to it.
        line = line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
        return line + " ." if line.endswith("\\") else line
    # Python takes an encoding from a comment in its first two lines, and in UTF-7 a comment may hold line breaks.
    return re.sub(r"coding(?=[:=])", "coding ", line) if mark == "#" else line


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    made = Environment(
        loader=FunctionLoader(lambda name: parts_of(name)[1]),
        # Comments are escaped line by line, and values are numbers.
        autoescape=False,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    filters: dict[str, Callable[..., Any]] = {
        "number": number,
        "row": row,
        "rows": _rows,
        "single": _single,
        "numbers": _numbers,
        "braces": _braces,
        "yaml_text": _yaml_text,
        "quoted": _quoted,
        "json": _json,
        "shown": shown,
        "checksum": _checksum,
        "packet": _packet,
        "register": _register,
        "quaternion": _quaternion,
    }
    made.filters.update(filters)
    return made


_KNOWN: dict[str, Any] = {
    "diag": np.diag,
    "sqrt": np.sqrt,
    "triu": np.triu,
    "norms": partial(np.linalg.norm, axis=1),
    "DEGREES": DEGREES,
    "DEGREE": DEGREE,
    "PI": np.pi,
    "G": STANDARD_GRAVITY,
    "field_lines": field_lines,
}


def filled(target: Target, subject: Subject, file: str) -> str:
    """Return the text of a target's file.

    Parameters
    ----------
    target : whose template it is.
    subject : prepared for it.
    file : which one, of several.
    """
    calibration, sensitivity, field = subject.calibration, subject.model.g_sensitivity, subject.magnetometer
    said = head(subject, target)

    def comment(lines: Sequence[str]) -> str:
        return commented(lines, target.comment)

    given: dict[str, Any] = {
        "file": file,
        "title": target.title,
        "head": comment(said),
        "head_lines": said,
        "commented": comment,
        "losses": [f"loss: {loss.text}" for loss in subject.losses],
        "accelerometer": Form(subject.accelerometer),
        "gyroscope": Form(subject.gyroscope),
        "g_sensitivity": np.zeros((3, 3)) if sensitivity is None else np.asarray(sensitivity),
        "tests": list(zip(*subject.vectors(), strict=True)),
        "field": field,
        "field_tests": [] if field is None else list(zip(*field.vectors(), strict=True)),
        "units": subject.units,
        "noise": subject.noise,
        "topic": subject.topic,
        "gravity": STANDARD_GRAVITY if calibration is None else calibration.site.gravity,
        "calibrated": calibration is not None,
        "curves": subject.curves,
    }
    return _environment().get_template(target.name).render(_KNOWN | given)
