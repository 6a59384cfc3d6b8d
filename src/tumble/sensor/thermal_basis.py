"""`TemperatureBasis`: the functions of temperature that a thermal model is a sum of."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from tumble.arrays import Series, Table
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
        hats = self._cardinal(temperature_celsius)[0] - self._cardinal(reference)[0]
        return np.ascontiguousarray(np.delete(hats, self.omitted, axis=1))

    def derivatives(self, temperature_celsius: Series) -> Table:
        """Return (samples, functions) derivatives by temperature, 1/K; to the right of a node at it."""
        if self.kind == "polynomial":
            powers = np.arange(1.0, self.order + 1.0)
            difference = temperature_celsius - self.reference_celsius
            return powers * np.power(difference[:, None], powers - 1.0)
        return np.ascontiguousarray(np.delete(self._cardinal(temperature_celsius)[1], self.omitted, axis=1))

    def _cardinal(self, temperature: Series) -> tuple[Table, Table]:
        """Return (samples, nodes) the interpolation's cardinal functions and their derivatives, 1/K."""
        nodes = self.nodes
        inside = np.clip(temperature, nodes[0], nodes[-1])
        if self.kind == "spline":
            from scipy.interpolate import CubicSpline

            curve = CubicSpline(nodes, np.eye(nodes.size), bc_type="natural")
            hats, slopes = curve(inside), curve(inside, 1)
        else:
            index = np.clip(np.searchsorted(nodes, inside, side="right") - 1, 0, nodes.size - 2)
            width = (nodes[index + 1] - nodes[index])[:, None]
            part = (inside - nodes[index])[:, None] / width
            one, next_ = np.eye(nodes.size)[index], np.eye(nodes.size)[index + 1]
            hats, slopes = (1.0 - part) * one + part * next_, (next_ - one) / width
        # Beyond the ends it goes on as its tangent.
        return hats + (temperature - inside)[:, None] * slopes, slopes
