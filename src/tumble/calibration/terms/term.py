"""What an optional term is: its unknowns, what shows it, its parameters and its words, in one record."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vector
from tumble.estimation import Block
from tumble.parameters import FAMILIES
from tumble.records import dataclass
from tumble.sensor import CURVES, Curve

Complex = npt.NDArray[Any]
Label = tuple[str, str]
PAIRS_OF_AXES = tuple((a, b) for a in "xyz" for b in "xyz")
KINDS = {"accelerometer": ("force", "accelerometer"), "gyroscope": ("gyro", "gyro")}
"""Of each triad: what its blocks begin with, and what it is called in labels."""


@dataclass(frozen=True)
class Parameters:
    """What a term's unknowns are in the result.

    Attributes
    ----------
    labels : names and units by the result's frame.
    values : of the block's unknowns, C_bf and the frame; analytic.
    told : which of all parameters are to be named, by all labels and standard uncertainties; None for all.
    remark : a sentence for the user by the named parameters: value and standard uncertainty in SI; empty for none.
    """

    labels: Callable[[str], list[Label]]
    values: Callable[[Complex, Complex, str], Complex]
    told: Callable[[list[Label], Series], np.ndarray] | None = None
    remark: Callable[[dict[str, tuple[float, float]]], str] = lambda _: ""


@dataclass(frozen=True)
class Term:
    """A term that is kept if the data want it.

    Attributes
    ----------
    name : as users know it.
    words : in sentences.
    tried, use : where it is tried and what it is good for, as the table in the documentation has it.
    block : its unknowns, what they are called, and what determines them.
    plate : one sigma of each as any unit's name plate promises it, by the raw unit of a triad (3,): raw per SI.
    of : the triad whose raw unit that is.
    shown_by : "force" for what holds show, "gyro" for what needs gyros, "table" for what only rotations show.
    gives_way : of terms that look alike in what was recorded, the one with the largest number is not tried:
        asymmetries are what rotations both ways and faces up and down show by themselves, whatever is between.
    columns : which of the block's unknowns are adjusted; None for all.
    in_part : it is worth having where only a part is determined; the name plate, in SI whatever the triad, holds the
        rest.
    curve : the sensor's own curve that it is, a name of `tumble.sensor.imu.CURVES`; empty for none.
    parameters : of the result; None where the triads' own parameters have it.
    """

    name: str
    words: str
    tried: str
    use: str
    block: Block
    plate: Callable[[Vector], Series | float]
    of: Literal["accelerometer", "gyroscope"]
    shown_by: Literal["force", "gyro", "table"]
    gives_way: int
    columns: np.ndarray | None = None
    in_part: bool = False
    curve: str = ""
    parameters: Parameters | None = None

    @property
    def row(self) -> str:
        """Its row of the table in the documentation."""
        count = len(self.block.labels) if self.columns is None else self.columns.size
        return f"| `{self.name}` | {count} | {self.tried} | {self.use} |"

    def curve_labels(self, units: tuple[str, str]) -> list[Label]:
        """Return names and units of a curve's parameters.

        Parameters
        ----------
        units : raw units of specific force and angular rate.
        """
        return FAMILIES[f"{KINDS[self.of][1]} {self.curve}"].labels(units[self.of == "gyroscope"])


def curves_of(terms: dict[str, Term], kind: str) -> list[tuple[str, Curve]]:
    """Return the blocks of a triad's curves, and these.

    Parameters
    ----------
    terms, kind : all that there are, and "accelerometer" or "gyroscope".
    """
    return [(t.block.name, CURVES[t.curve]) for t in terms.values() if t.curve and t.of == kind]
