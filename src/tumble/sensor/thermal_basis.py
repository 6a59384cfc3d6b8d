"""`TemperatureBasis`: the functions of temperature that a thermal model is a sum of."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Series, Square, Table
from tumble.records import dataclass

KINDS = ("polynomial", "linear", "spline")


def _no_nodes() -> Series:
    return np.zeros(0)


@dataclass(frozen=True, slots=True)
class TemperatureBasis:
    """Functions of the temperature T (°C), every one zero at the reference temperature.

    A quantity at T is its value at the reference plus the sum of coefficient times function:

    - ``polynomial``: (T - reference)^k for k = 1 to `order`; coefficients per K^k.
    - ``linear``: straight lines between `nodes`, the simplest model of a soak test. The function of
      node k is its hat h_k(T) - h_k(reference).
    - ``spline``: the natural cubic spline through the nodes in the same way; straight beyond the ends.

    All hats add up to one, so that one of them determines nothing new: the node next to the reference has no
    function. Where the reference is a node, the coefficient of another node is what the quantity there
    differs by from the reference.

    Attributes
    ----------
    kind : ``polynomial``, ``linear`` or ``spline``.
    reference_celsius : °C, where all functions are zero.
    nodes : (nodes,) °C, increasing; of ``polynomial`` empty.
    order : highest power of ``polynomial``; 0 otherwise.

    Raises
    ------
    ValueError
        If the kind is unknown, or nodes or order do not fit it.
    """

    kind: str
    reference_celsius: float
    nodes: Series = field(default_factory=_no_nodes)
    order: int = 0

    def __post_init__(self) -> None:
        """Check that nodes and order are what the kind takes."""
        if self.kind not in KINDS:
            raise ValueError(f"a temperature basis is one of {', '.join(KINDS)}, not {self.kind!r}")
        if not np.isfinite(self.reference_celsius):
            raise ValueError("the reference temperature is not a number")
        if self.kind == "polynomial":
            if self.order < 1 or self.nodes.size:
                raise ValueError("a polynomial in temperature has an order from 1 on and no nodes")
            return
        least = 2 if self.kind == "linear" else 3
        if self.nodes.size < least or not np.all(np.diff(self.nodes) > 0) or self.order:
            raise ValueError(f"a {self.kind} basis has at least {least} increasing nodes and no order")

    @property
    def size(self) -> int:
        """Number of functions."""
        return self.order if self.kind == "polynomial" else self.nodes.size - 1

    @property
    def omitted(self) -> int:
        """Index of the node without a function: the one next to the reference; -1 of a polynomial."""
        if self.kind == "polynomial":
            return -1
        return int(np.argmin(np.abs(self.nodes - self.reference_celsius)))

    @property
    def labels(self) -> list[str]:
        """What each function is, in words."""
        if self.kind == "polynomial":
            return ["ΔT" if k == 1 else f"ΔT^{k}" for k in range(1, self.order + 1)]
        return [f"{node:g} °C" for k, node in enumerate(self.nodes.tolist()) if k != self.omitted]

    @property
    def units(self) -> list[str]:
        """What each coefficient's unit is divided by: ``K``, ``K^2``, …; empty of a value at a node."""
        if self.kind == "polynomial":
            return ["K" if k == 1 else f"K^{k}" for k in range(1, self.order + 1)]
        return [""] * self.size

    def values(self, temperature_celsius: Series) -> Table:
        """Return (samples, functions) at each temperature."""
        if self.kind == "polynomial":
            difference = temperature_celsius - self.reference_celsius
            powers = np.cumprod(np.repeat(difference[:, None], self.order, axis=1), axis=1)
            return np.asarray(powers, dtype=np.float64)
        reference = np.array([self.reference_celsius])
        hats = self._hats(temperature_celsius) - self._hats(reference)
        return np.ascontiguousarray(np.delete(hats, self.omitted, axis=1))

    def derivatives(self, temperature_celsius: Series) -> Table:
        """Return (samples, functions) derivatives by temperature, 1/K; to the right of a node at it."""
        if self.kind == "polynomial":
            powers = np.arange(1.0, self.order + 1.0)
            difference = temperature_celsius - self.reference_celsius
            return powers * np.power(difference[:, None], powers - 1.0)
        return np.ascontiguousarray(np.delete(self._slopes(temperature_celsius), self.omitted, axis=1))

    def _place(self, temperature: Series) -> tuple[Series, Series, np.ndarray]:
        """Return the interval's width, the part of it that is behind, and its index."""
        index = np.clip(np.searchsorted(self.nodes, temperature, side="right") - 1, 0, self.nodes.size - 2)
        width = self.nodes[index + 1] - self.nodes[index]
        return width, (temperature - self.nodes[index]) / width, index

    def _hats(self, temperature: Series) -> Table:
        """Return (samples, nodes) of the interpolation's cardinal functions."""
        width, part, index = self._place(temperature)
        hats = np.zeros((temperature.size, self.nodes.size))
        rows = np.arange(temperature.size)
        hats[rows, index] = 1.0 - part
        hats[rows, index + 1] = part
        if self.kind == "linear":
            return hats
        inside = np.clip(part, 0.0, 1.0)
        bend = _second_derivatives(self.nodes)
        left = ((1.0 - inside) ** 3 - (1.0 - inside)) * width**2 / 6.0
        right = (inside**3 - inside) * width**2 / 6.0
        hats += left[:, None] * bend[index] + right[:, None] * bend[index + 1]
        # Beyond the ends the spline goes on as its tangent: what is left of the line to the outside.
        beyond = (part - inside) * width**2 / 6.0
        first, last = part < 0.0, part > 1.0
        hats[first] -= (beyond[:, None] * bend[index + 1])[first]
        hats[last] += (beyond[:, None] * bend[index])[last]
        return hats

    def _slopes(self, temperature: Series) -> Table:
        """Return (samples, nodes) derivatives of the cardinal functions, 1/K."""
        width, part, index = self._place(temperature)
        slopes = np.zeros((temperature.size, self.nodes.size))
        rows = np.arange(temperature.size)
        slopes[rows, index] = -1.0 / width
        slopes[rows, index + 1] = 1.0 / width
        if self.kind == "linear":
            return slopes
        inside = np.clip(part, 0.0, 1.0)
        bend = _second_derivatives(self.nodes)
        left = (1.0 - 3.0 * (1.0 - inside) ** 2) * width / 6.0
        right = (3.0 * inside**2 - 1.0) * width / 6.0
        return slopes + left[:, None] * bend[index] + right[:, None] * bend[index + 1]


def _second_derivatives(nodes: Series) -> Square:
    """Return the matrix from values at nodes to the natural spline's second derivatives there."""
    size = nodes.size
    width = np.diff(nodes)
    left, right = np.eye(size), np.zeros((size, size))
    for k in range(1, size - 1):
        left[k, k - 1 : k + 2] = width[k - 1] / 6.0, (width[k - 1] + width[k]) / 3.0, width[k] / 6.0
        right[k, k - 1 : k + 2] = 1.0 / width[k - 1], -1.0 / width[k - 1] - 1.0 / width[k], 1.0 / width[k]
    return np.asarray(np.linalg.solve(left, right), dtype=np.float64)
