"""Unknowns in named blocks: where each block stands, which unknowns are adjusted, and what they are called.

Nobody counts columns: an equation writes its derivatives by the name of a block, a report reads values by it, and
what is held is no column of any normal equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from tumble.arrays import AnyArray, Series, Table
from tumble.estimation.gauss_helmert import Prior
from tumble.records import dataclass


@dataclass(frozen=True)
class Block:
    """Unknowns that belong together.

    Attributes
    ----------
    name : as equations and reports ask for it, such as "gyro.bias".
    labels : of each unknown, in words.
    remedies : of each, what would determine it, in words.
    """

    name: str
    labels: tuple[str, ...]
    remedies: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """The blocks that an estimator may have, one after the other."""

    blocks: tuple[Block, ...]
    _places: dict[str, slice] = field(default_factory=dict[str, slice], repr=False)

    def __post_init__(self) -> None:
        """Count where each block stands."""
        start = 0
        for block in self.blocks:
            self._places[block.name] = slice(start, start + len(block.labels))
            start += len(block.labels)

    @property
    def size(self) -> int:
        """How many unknowns there may be."""
        return sum(len(block.labels) for block in self.blocks)

    def __getitem__(self, name: str) -> slice:
        """Return where a block stands."""
        return self._places[name]

    def indices(self, *names: str) -> np.ndarray:
        """Return the indices of some blocks, ascending."""
        chosen = np.zeros(self.size, dtype=bool)
        for name in names:
            chosen[self._places[name]] = True
        return np.flatnonzero(chosen)

    def label(self, index: int) -> str:
        """Return an unknown in words."""
        return [label for block in self.blocks for label in block.labels][index]

    def remedy(self, index: int) -> str:
        """Return what would determine an unknown, in words."""
        return [remedy for block in self.blocks for remedy in block.remedies][index]

    def sparse_prior(self, values: Series, sigmas: Mapping[str, float | Series]) -> Prior:
        """Return what is known of some blocks: their values with a standard uncertainty, and nothing of the others.

        Parameters
        ----------
        values : (size,) all unknowns.
        sigmas : block -> one sigma, of each or of all its unknowns.
        """
        precision = np.zeros((self.size, self.size))
        for name, sigma in sigmas.items():
            at = self.indices(name)
            precision[at, at] = 1.0 / np.asarray(sigma) ** 2
        return Prior(values.copy(), precision)


@dataclass
class Unknowns:
    """Values of all unknowns of a layout, and which of them are adjusted; the others are held.

    Attributes
    ----------
    layout : the blocks.
    values : (size,) of all.
    free : (free,) indices of those that are adjusted, ascending.
    """

    layout: Layout
    values: Series
    free: np.ndarray

    def __getitem__(self, name: str) -> Series:
        """Return a block's values."""
        return self.values[self.layout[name]]

    def is_free(self, name: str) -> bool:
        """Whether any unknown of a block is adjusted."""
        low, high = self._free_of(name)
        return high > low

    def _free_of(self, name: str) -> tuple[int, int]:
        """From where to where a block's unknowns stand among those that are free."""
        place = self.layout[name]
        low, high = self.free.searchsorted((place.start, place.stop)).tolist()
        return low, high

    def with_free(self, free: np.ndarray) -> Unknowns:
        """Return the same values with others that are adjusted."""
        return replace(self, free=np.asarray(free))

    def at(self, values: Series) -> Unknowns:
        """Return other values of the same unknowns."""
        return replace(self, values=np.asarray(values, dtype=np.float64))

    def copy(self) -> Unknowns:
        """Return unknowns of their own."""
        return Unknowns(self.layout, self.values.copy(), self.free.copy())

    def only_free(self) -> Unknowns:
        """Return a copy in which what is held is zero."""
        values = np.zeros(self.values.size)
        values[self.free] = self.values[self.free]
        return Unknowns(self.layout, values, self.free.copy())

    def places(self, names: Sequence[str] | np.ndarray) -> np.ndarray:
        """Return where the free unknowns of some blocks (or indices) stand among all that are free."""
        at = self.layout.indices(*names) if isinstance(names, (list, tuple)) else names
        return np.flatnonzero(np.isin(self.free, np.asarray(at)))

    def columns(self, derivatives: Mapping[str, AnyArray], before: int = 0) -> AnyArray:
        """Return derivatives by all free unknowns, of those by some blocks.

        Parameters
        ----------
        derivatives : block -> (terms, m, unknowns of the block).
        before : columns to leave empty in front, for unknowns that are not shared.
        """
        first = next(iter(derivatives.values()))
        made = np.zeros((*first.shape[:2], before + self.free.size))
        by, at = self.beside([(slice(0), first[:, :, :0])], derivatives, before)
        made[:, :, at] = by
        return made

    def beside(
        self, own: Sequence[tuple[slice, AnyArray]], derivatives: Mapping[str, AnyArray], before: int
    ) -> tuple[AnyArray, np.ndarray]:
        """Return derivatives (terms, m, columns) by a part of a chain's border, and which columns these are.

        Parameters
        ----------
        own : columns in front of the shared unknowns, with (terms, m, ...) derivatives.
        derivatives : block -> (terms, m, unknowns of the block), of shared unknowns; those that are free are taken.
        before : how many columns are in front.
        """
        columns = [np.r_[at] for at, _ in own]
        parts = [by for _, by in own]
        for name, by in derivatives.items():
            place, (low, high) = self.layout[name], self._free_of(name)
            if high > low:
                columns.append(np.arange(before + low, before + high))
                whole = high - low == place.stop - place.start
                parts.append(by if whole else by[:, :, self.free[low:high] - place.start])
        return np.concatenate(parts, axis=2), np.concatenate(columns)

    def expanded(self, of_free: Table) -> AnyArray:
        """Return a matrix of all unknowns of one of the free ones, zeros elsewhere."""
        made = np.zeros((self.values.size, self.values.size))
        made[np.ix_(self.free, self.free)] = of_free
        return made
