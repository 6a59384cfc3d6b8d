"""Orthogonal wavelet transforms of a piece of a signal, plain and stationary, with edges taken care of.

References
----------
Mallat, S., *A Wavelet Tour of Signal Processing*, 3rd ed., Academic Press 2009, chapter 7. Percival, D. B.,
and A. T. Walden, *Wavelet Methods for Time Series Analysis*, Cambridge 2000, chapters 4 and 5: the
stationary (maximal-overlap) transform and its scaling.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.records import dataclass

USUAL = "sym4"


def _library() -> Any:
    """PyWavelets, which carries no types."""
    return import_module("pywt")


@cache
def filter_length(wavelet: str) -> int:
    """Return the taps of an orthogonal wavelet's filters.

    Parameters
    ----------
    wavelet : a name of PyWavelets, such as haar, db4, sym4 or coif2.

    Raises
    ------
    UsageError
        If the name is of no orthogonal wavelet.
    """
    library = _library()
    names: list[str] = library.wavelist(kind="discrete")
    if wavelet not in names or not library.Wavelet(wavelet).orthogonal:
        raise UsageError(
            f"{wavelet!r} is no orthogonal wavelet: give haar, db2 to db38, sym2 to sym20, or coif1 to coif17."
        )
    return int(library.Wavelet(wavelet).dec_len)


@dataclass(frozen=True, slots=True)
class Coefficients:
    """What a transform makes of a piece.

    Attributes
    ----------
    details : of each level, the finest first; of a stationary transform as many as padded samples.
    smooth : what is left below the coarsest level.
    margin : padded samples ahead of the piece.
    size : samples of the piece itself.
    stationary : whether every level has a coefficient at every sample.
    """

    details: tuple[Series, ...]
    smooth: Series
    margin: int
    size: int
    stationary: bool

    def inside(self, level: int) -> Series:
        """Return a level's coefficients that are of the piece itself, without those of the padding.

        Parameters
        ----------
        level : 1 for the finest.
        """
        step = 1 if self.stationary else 1 << level
        first = -(-self.margin // step)
        return self.details[level - 1][first : first + max(self.size // step, 1)]


@dataclass(frozen=True, slots=True)
class Transform:
    """An orthogonal wavelet transform down to a level.

    The stationary one is the mean over all shifts of the plain one: no artefacts that depend on where a
    sample falls in the grid of halved rates. Its coefficients are scaled so that white noise of standard
    deviation σ has σ 2^(-j/2) at level j (the plain one: σ at every level).

    Attributes
    ----------
    level : levels of decomposition, 1 or more; a detail of level j is of about rate/2^(j+1) to rate/2^j.
    wavelet : a name of PyWavelets.
    stationary : whether every level has a coefficient at every sample.
    """

    level: int
    wavelet: str = USUAL
    stationary: bool = True

    @property
    def reach(self) -> int:
        """Samples to one side that a sample of the result may depend on."""
        return (filter_length(self.wavelet) - 1) * ((1 << self.level) - 1)

    def analyse(self, piece: Series) -> Coefficients:
        """Return the coefficients of a piece, which is mirrored at both ends over the filters' reach.

        Parameters
        ----------
        piece : (samples,) without gaps.

        Raises
        ------
        UsageError
            If the piece is too short for the level or the wavelet is unknown.
        """
        if self.level > deepest_level(piece.size, self.wavelet):
            raise UsageError(
                f"A piece of {piece.size} samples bears {deepest_level(piece.size, self.wavelet)} levels of "
                f"{self.wavelet}, not {self.level}."
            )
        block = 1 << self.level
        margin = -(-self.reach // block) * block
        after = margin + (-piece.size) % block
        padded = np.pad(piece, (margin, after), mode="symmetric")
        library = _library()
        if self.stationary:
            found = library.swt(padded, self.wavelet, self.level, trim_approx=True, norm=True)
        else:
            found = library.wavedec(padded, self.wavelet, "periodization", self.level)
        return Coefficients(tuple(found[:0:-1]), found[0], margin, piece.size, self.stationary)

    def synthesise(self, coefficients: Coefficients) -> Series:
        """Return the piece that has such coefficients.

        Parameters
        ----------
        coefficients : as `analyse` gave them, perhaps changed.
        """
        library = _library()
        parts = [coefficients.smooth, *coefficients.details[::-1]]
        if self.stationary:
            padded = library.iswt(parts, self.wavelet, norm=True)
        else:
            padded = library.waverec(parts, self.wavelet, "periodization")
        first = coefficients.margin
        return np.ascontiguousarray(padded[first : first + coefficients.size], dtype=np.float64)


def deepest_level(samples: int, wavelet: str = USUAL) -> int:
    """Return the most levels at which a coefficient still fits into a piece, 0 if none does.

    Parameters
    ----------
    samples : of the piece.
    wavelet : a name of PyWavelets.

    Raises
    ------
    UsageError
        If the wavelet is unknown.
    """
    reach = filter_length(wavelet) - 1
    return int(np.log2(samples / reach)) if samples >= 2 * reach else 0
