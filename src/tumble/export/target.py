"""`Target`: another tool's form of a calibration: what it holds, in which units and frame, who writes and reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.sensor.thermal import ThermalModel

if TYPE_CHECKING:
    from tumble.export.subject import Subject

MATRIX = "full matrix"
SCALE = "scale factors"
BIAS = "biases"
G_SENSITIVITY = "g-sensitivity"
NONLINEAR = "asymmetry and quadratic terms"
TEMPERATURE = "temperature"
MAGNETOMETER = "magnetometer"
NOISE = "noise"


@dataclass(frozen=True, slots=True)
class Imported:
    """What a target's file says of a unit.

    Attributes
    ----------
    model : raw numbers in `units`.
    units : of specific force and angular rate that the file's numbers take.
    frame, frame_words : name of the frame of its corrected vectors, and what it is.
    files : that were read.
    remarks : sentences: what the file does not hold, what was assumed.
    thermal : how `model`'s biases change with temperature, or None.
    """

    model: ImuModel
    units: tuple[str, str]
    frame: str
    frame_words: str
    files: tuple[Path, ...]
    remarks: tuple[str, ...] = ()
    thermal: ThermalModel | None = None


@dataclass(frozen=True, slots=True)
class Target:
    """A form that calibrations are written in, and perhaps read from.

    Attributes
    ----------
    name : as ``--to`` and ``--from`` take it.
    title : the tool and its file.
    holds : of `MATRIX`, `SCALE`, `BIAS`, `G_SENSITIVITY`, `NONLINEAR`, `TEMPERATURE`, `MAGNETOMETER`, `NOISE`.
    file : name of the file that is written by default; several files go into a folder.
    write : returns texts by file name.
    read : reads files of the target, or None.
    units : raw units of specific force and angular rate that the tool works in; None takes the calibration's.
    frame : that the form's zeros ask for, or None: any.
    needs_calibration, needs_noise, needs_magnetometer : what there must be to write it.
    replaces : whether its numbers go where others stand that may have been active while the unit was recorded.
    comment : what begins a comment line, empty where the format has none; `words.escaped` knows each.
    """

    name: str
    title: str
    holds: frozenset[str]
    file: str
    write: Callable[[Subject], dict[str, str]]
    read: Callable[[Path], Imported] | None = None
    units: tuple[str, str] | None = ("m/s^2", "rad/s")
    frame: str | None = None
    needs_calibration: bool = True
    needs_noise: bool = False
    needs_magnetometer: bool = False
    comment: str = "#"
    replaces: bool = False

    @property
    def directions(self) -> str:
        """Return ``to``, or ``to and from``."""
        return "to" if self.read is None else "to and from"
