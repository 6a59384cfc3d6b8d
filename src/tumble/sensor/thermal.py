"""`ThermalModel`: an IMU whose errors change with its temperature, with how fast, and with the way there.

`TemperatureBasis`: the functions of temperature that a thermal model is a sum of.

`TemperaturePath`: how the sensor's temperature follows from the one that is recorded.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Table, Vector, Vectors
from tumble.errors import ThermalSpanError
from tumble.records import dataclass
from tumble.sensor.imu import ImuModel, Triad

KINDS = ("polynomial", "linear", "spline")


def _no_nodes() -> Series:
    return np.zeros(0)


@dataclass(frozen=True)
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


class ThermalState(NamedTuple):
    """What is carried from one block of a recording to the next.

    Attributes
    ----------
    time : s, of the last sample.
    recorded : °C, its recorded temperature.
    smooth, rate : °C and K/s, what the thermometer shows without noise and steps.
    sensor : °C, the sensor's own temperature.
    play : °C, where the hysteresis last followed the temperature to.
    hysteresis : -1 (after long cooling) to 1 (after long heating).
    """

    time: float
    recorded: float
    smooth: float
    rate: float
    sensor: float
    play: float
    hysteresis: float


@dataclass(frozen=True)
class TemperaturePath:
    """The sensor's own temperature over a recording.

    Attributes
    ----------
    temperature : (samples,) °C.
    rate : (samples,) K/s.
    hysteresis : (samples,) -1 to 1.
    end : the state after the last sample, for the next block.
    """

    temperature: Series
    rate: Series
    hysteresis: Series
    end: ThermalState


def follow_temperature(
    time: Series,
    recorded: Series,
    *,
    smoothing: float,
    lag: float,
    hysteresis_width: float,
    dead_band: float = 0.0,
    start: ThermalState | None = None,
    start_hysteresis: float = 0.0,
) -> TemperaturePath:
    """Return the sensor's temperature, its rate and the hysteresis state from a recorded temperature.

    Three filters one after another, each exact for straight lines between samples, whatever their spacing:

    1. a critically damped observer of temperature and rate takes off noise and steps of the thermometer,
       x' = v + 2 (T - x) / smoothing, v' = (T - x) / smoothing²; it is not late on a ramp;
    2. the lag, y' = (x - y) / lag;
    3. the hysteresis, ``ds = (sign(dy) - s) |dy| / hysteresis_width``, for what y moves beyond `dead_band`.

    Samples that are not numbers are filled with straight lines. Without `start` the observer begins with
    the line through the first `smoothing` seconds, and the sensor at the recorded temperature.

    Parameters
    ----------
    time : (samples,) s, not decreasing.
    recorded : (samples,) °C.
    smoothing, lag : s; zero for none.
    hysteresis_width, dead_band : K.
    start : the state that the block before ended with.
    start_hysteresis : without `start`, the state before the first sample.

    Raises
    ------
    ValueError
        If there is no sample, or no temperature among them that is a number.
    """
    from tumble.sensor import kernels

    if time.size == 0:
        raise ValueError("a temperature path has at least one sample")
    given = filled(time, recorded, start)
    if start is None:
        value, rate = _first_line(time, given, smoothing)
        start = ThermalState(float(time[0]), float(given[0]), value, rate, value, value, start_hysteresis)
    carried = np.array(start)
    path = np.empty((time.size, 3))
    kernels.follow_temperature(
        np.ascontiguousarray(time), given, smoothing, lag, hysteresis_width, dead_band, carried, path
    )
    temperature, rates, hysteresis = (np.ascontiguousarray(path[:, k]) for k in range(3))
    return TemperaturePath(temperature, rates, hysteresis, ThermalState(*carried.tolist()))


def filled(time: Series, recorded: Series, start: ThermalState | None = None) -> Series:
    """Return the temperature with samples that are not numbers filled by straight lines, ends held.

    Raises
    ------
    ValueError
        If no sample is a number.
    """
    known = np.isfinite(recorded)
    if known.all():
        return np.ascontiguousarray(recorded)
    times, values = np.asarray(time[known]), np.asarray(recorded[known])
    if start is not None:
        times = np.concatenate([np.array([start.time]), times])
        values = np.concatenate([np.array([start.recorded]), values])
    if not times.size:
        raise ValueError("no temperature is a number")
    return np.asarray(np.interp(time, times, values), dtype=np.float64)


def _first_line(time: Series, recorded: Series, smoothing: float) -> tuple[float, float]:
    """Return value and slope at the first sample of the line through the first `smoothing` seconds."""
    count = int(np.searchsorted(time, time.item(0) + smoothing, side="right"))
    if smoothing <= 0.0 or count < 3 or time[count - 1] <= time[0]:
        return recorded.item(0), 0.0
    since = time[:count] - time[0]
    middle = float(since.mean())
    centred = since - middle
    slope = float(np.sum(centred * recorded[:count])) / float(np.sum(centred**2))
    return float(recorded[:count].mean()) - slope * middle, slope


Outside: TypeAlias = Literal["refuse", "hold", "extrapolate"]
# A model is used this far beyond the temperatures that it was calibrated at, without asking.
SPAN_MARGIN = 2.0  # K
BLOCK = 65536
SHAPES: dict[str, tuple[int, ...]] = {
    "accelerometer.bias": (3,),
    "accelerometer.matrix": (3, 3),
    "gyroscope.bias": (3,),
    "gyroscope.matrix": (3, 3),
    "g_sensitivity": (3, 3),
}
BIASES = ("accelerometer.bias", "gyroscope.bias")


@dataclass(frozen=True)
class ThermalModel:
    """Both triads as functions of the sensor's temperature T, its rate dT/dt and a hysteresis state s.

    ``matrix(T) = reference + sum_k coefficient_k f_k(T)``, the same for the g-sensitivity, and
    ``bias(T, dT/dt, s) = reference + sum_k coefficient_k f_k(T) + rate_coefficient dT/dt + hysteresis s``
    with the functions f_k of `basis`. Asymmetry and quadratic terms do not change with temperature.

    Attributes
    ----------
    reference : the unit at the basis' reference temperature, settled, half way through the hysteresis.
    basis : the functions of temperature.
    coefficients : any of ``accelerometer.bias`` (functions, 3), ``accelerometer.matrix``
        (functions, 3, 3), ``gyroscope.bias``, ``gyroscope.matrix`` and ``g_sensitivity``, in raw units.
    rate_coefficients : of the two biases, (3,) raw units per K/s.
    hysteresis : of the two biases, (3,) raw units: half of what heating and cooling differ by.
    hysteresis_width : K over which s goes over (to 1/e) after the temperature has turned round.
    lag : s, of first order, by which the sensor is behind the recorded temperature.
    span_celsius : °C, lowest and highest of the calibration.
    largest_rate : K/s, fastest change seen in the calibration.
    smoothing : s, over which noise and steps of the thermometer are averaged; not late on a ramp.
    dead_band : K that the temperature must move before the hysteresis follows: the thermometer's noise.
    start_hysteresis : s before the first sample of a recording, where nothing is known of what was before.

    Raises
    ------
    ValueError
        If a coefficient is of an unknown quantity, of another shape, or of a triad that is not there.
    """

    reference: ImuModel
    basis: TemperatureBasis
    coefficients: dict[str, AnyArray] = field(default_factory=dict[str, AnyArray])
    rate_coefficients: dict[str, Vector] = field(default_factory=dict[str, Vector])
    hysteresis: dict[str, Vector] = field(default_factory=dict[str, Vector])
    hysteresis_width: float = 5.0
    lag: float = 0.0
    span_celsius: tuple[float, float] = (-np.inf, np.inf)
    largest_rate: float = np.inf
    smoothing: float = 10.0
    dead_band: float = 0.05
    start_hysteresis: float = 0.0

    def __post_init__(self) -> None:
        """Check that each coefficient is of something that the unit has, in the right shape."""
        for name, values in self.coefficients.items():
            if name not in SHAPES or values.shape != (self.basis.size, *SHAPES[name]):
                raise ValueError(
                    f"no coefficients {name!r} of shape {values.shape} for {self.basis.size} functions"
                )
        for name, values in (*self.rate_coefficients.items(), *self.hysteresis.items()):
            if name not in BIASES or values.shape != (3,):
                raise ValueError(
                    f"rate and hysteresis act on the biases (3,), not on {name!r} {values.shape}"
                )
        for name in (*self.coefficients, *self.rate_coefficients, *self.hysteresis):
            known = self.reference.accelerometer if name.startswith("acc") else self.reference.gyroscope
            if known is None or (name == "g_sensitivity" and self.reference.g_sensitivity is None):
                raise ValueError(f"{name} changes with temperature, but the reference has none")
        if self.hysteresis_width <= 0.0 or min(self.lag, self.smoothing, self.dead_band) < 0.0:
            raise ValueError("hysteresis_width is above zero; lag, smoothing and dead_band are not below it")

    def at(self, temperature_celsius: float, rate: float = 0.0, state: float = 0.0) -> ImuModel:
        """Return the unit at a temperature of the sensor (°C), its rate (K/s) and hysteresis state."""
        values = self._values(*(np.array([float(one)]) for one in (temperature_celsius, rate, state)))

        def triad(known: Triad | None, name: str) -> Triad | None:
            if known is None:
                return None
            matrix, bias = (self._moved(f"{name}.{what}", values)[0] for what in ("matrix", "bias"))
            return replace(known, matrix=known.matrix + matrix, bias=known.bias + bias)

        sensitivity = self.reference.g_sensitivity
        if sensitivity is not None:
            sensitivity = np.asarray(sensitivity + self._moved("g_sensitivity", values)[0])
        return ImuModel(
            triad(self.reference.accelerometer, "accelerometer"),
            triad(self.reference.gyroscope, "gyroscope"),
            sensitivity,
        )

    def path(
        self, time: Series, temperature_celsius: Series, start: ThermalState | None = None
    ) -> TemperaturePath:
        """Return the sensor's own temperature over a recording, and the state for its next block.

        Parameters
        ----------
        time, temperature_celsius : (samples,) s and °C, as recorded.
        start : the state that the block before ended with.

        Raises
        ------
        ValueError
            If there is no sample, or no temperature among them that is a number.
        """
        return follow_temperature(
            time,
            temperature_celsius,
            smoothing=self.smoothing,
            lag=self.lag,
            hysteresis_width=self.hysteresis_width,
            dead_band=self.dead_band,
            start=start,
            start_hysteresis=self.start_hysteresis,
        )

    def correct_along(
        self,
        path: TemperaturePath,
        time: Series,
        raw_force: Vectors | None,
        raw_rate: Vectors | None,
        *,
        outside: Outside = "refuse",
    ) -> tuple[Vectors | None, Vectors | None]:
        """Return true (specific force, angular rate) in b along a path; a triad without model or numbers gives None.

        Parameters
        ----------
        path : of the sensor's temperature, see `path`.
        time : (samples,) s.
        raw_force, raw_rate : (samples, 3) as recorded, or None.
        outside : what to do beyond the calibrated span and its margin of 2 K: refuse, hold the
            parameters of the span's end, or extrapolate the functions of temperature.

        Raises
        ------
        ThermalSpanError
            If the path leaves the span and `outside` is ``refuse``.
        ValueError
            If a matrix is singular at some temperature, or a g-sensitivity has no force to act on.
        """
        temperature = self.within(path.temperature, time, outside)
        force = rate = None
        if self.reference.accelerometer is not None and raw_force is not None:
            force = np.empty_like(raw_force)
        if self.reference.gyroscope is not None and raw_rate is not None:
            if self.reference.g_sensitivity is not None and force is None:
                raise ValueError("the g-sensitivity acts on the specific force, which is missing")
            rate = np.empty_like(raw_rate)
        for begin in range(0, temperature.size, BLOCK):
            part = slice(begin, begin + BLOCK)
            values = self._values(temperature[part], path.rate[part], path.hysteresis[part])
            none = np.zeros((0, 3))
            if force is not None and raw_force is not None:
                self._correct_block("accelerometer", raw_force[part], none, values, force[part])
            if rate is not None and raw_rate is not None:
                coupled = none if force is None or self.reference.g_sensitivity is None else force[part]
                self._correct_block("gyroscope", raw_rate[part], coupled, values, rate[part])
        return force, rate

    def distort(
        self, time: Series, force: Vectors, rate: Vectors, temperature_celsius: Series
    ) -> tuple[Vectors, Vectors]:
        """Return the raw (specific force, angular rate) for true ones in b: the inverse of `correct_along`.

        The functions of temperature are used as they are, beyond the span too.

        Raises
        ------
        ValueError
            If a triad is missing, or no temperature is a number.
        """
        accelerometer, gyroscope = self.reference.accelerometer, self.reference.gyroscope
        if accelerometer is None or gyroscope is None:
            raise ValueError("the model lacks a triad")
        path = self.path(time, temperature_celsius)
        raw_force, raw_rate = np.empty_like(force), np.empty_like(rate)
        for begin in range(0, time.size, BLOCK):
            part = slice(begin, begin + BLOCK)
            values = self._values(path.temperature[part], path.rate[part], path.hysteresis[part])
            for name, triad, true, raw in (
                ("accelerometer", accelerometer, force[part], raw_force[part]),
                ("gyroscope", gyroscope, rate[part], raw_rate[part]),
            ):
                own = true @ triad.matrix.T + _turned(self._moved(f"{name}.matrix", values), true)
                raw[:] = own + triad.bias + self._moved(f"{name}.bias", values)
                for _, curve, size in triad.curves():
                    raw += size * curve.of(own)
            if self.reference.g_sensitivity is not None:
                sensitivity = self.reference.g_sensitivity + self._moved("g_sensitivity", values)
                raw_rate[part] += _turned(sensitivity, force[part])
        return raw_force, raw_rate

    def within(self, temperature: Series, time: Series, outside: Outside) -> Series:
        """Return the sensor's temperatures to take the functions at: as they are, or held at the span's ends.

        Raises
        ------
        ThermalSpanError
            If one is more than the margin outside the span and `outside` is ``refuse``.
        """
        low, high = self.span_celsius
        if outside == "extrapolate":
            return temperature
        if outside == "hold":
            return np.clip(temperature, low, high)
        far = np.flatnonzero((temperature < low - SPAN_MARGIN) | (temperature > high + SPAN_MARGIN))
        if far.size:
            raise ThermalSpanError(
                f"The sensor is at {temperature[far[0]]:.1f} °C at {time[far[0]]:.1f} s "
                f"({temperature.min():.1f} to {temperature.max():.1f} °C here), outside the {low:.1f} "
                f"to {high:.1f} °C that the calibration covers. Calibrate there too, or hold the "
                "parameters of the span's end (tumble apply --outside hold), or extrapolate (--outside "
                "extrapolate)."
            )
        return temperature

    def turned(self, C_new_b: Matrix) -> ThermalModel:
        """Return the same unit described in another body frame: ``true_new = C_new_b @ true_b``."""
        turned = {
            name: values if name in BIASES else np.ascontiguousarray(values @ C_new_b.T)
            for name, values in self.coefficients.items()
        }
        return replace(self, reference=self.reference.turned(C_new_b), coefficients=turned)

    @property
    def names(self) -> list[str]:
        """Names of the thermal parameters, in the order of `vector`: what a covariance is over.

        ``accelerometer.bias.temperature[k,i]`` (function k, axis i), ``accelerometer.matrix.temperature[k,i,j]``,
        ``accelerometer.bias.rate[i]``, ``accelerometer.bias.hysteresis[i]`` and the like.
        """
        names: list[str] = []
        for name in SHAPES:
            if name in self.coefficients:
                places = np.ndindex(*self.coefficients[name].shape)
                names += [f"{name}.temperature[{','.join(map(str, place))}]" for place in places]
        for kind, group in (("rate", self.rate_coefficients), ("hysteresis", self.hysteresis)):
            names += [f"{name}.{kind}[{i}]" for name in BIASES if name in group for i in range(3)]
        return names

    def vector(self) -> Series:
        """Return the thermal parameters as numbers, in the order of `names`."""
        parts = [self.coefficients[name].ravel() for name in SHAPES if name in self.coefficients]
        for group in (self.rate_coefficients, self.hysteresis):
            parts += [group[name] for name in BIASES if name in group]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _moved(self, name: str, values: Table) -> AnyArray:
        """Return (samples, ...) by how much a quantity is off that of the reference."""
        terms = self._terms(name)
        return np.asarray(np.tensordot(values[:, : len(terms)], terms, axes=1), dtype=np.float64)

    def _values(self, temperature: Series, rate: Series, state: Series) -> Table:
        """Return (samples, functions + 2): the basis, the rate, and the hysteresis state."""
        return np.column_stack([self.basis.values(temperature), rate, state])

    def _terms(self, name: str) -> AnyArray:
        """Return the coefficients of a quantity, of a bias with those of rate and hysteresis below."""
        terms = self.coefficients.get(name, np.zeros((0, *SHAPES[name])))
        if not (name in self.rate_coefficients or name in self.hysteresis):
            return np.ascontiguousarray(terms)
        if not terms.shape[0]:
            terms = np.zeros((self.basis.size, 3))
        path = (of.get(name, np.zeros(3)) for of in (self.rate_coefficients, self.hysteresis))
        return np.vstack([terms, *path])

    def _correct_block(self, name: str, raw: Vectors, coupled: Vectors, values: Table, true: Vectors) -> None:
        from tumble.sensor import kernels

        triad = self.reference.accelerometer if name == "accelerometer" else self.reference.gyroscope
        assert triad is not None
        zero, sensitivity = np.zeros(3), self.reference.g_sensitivity
        singular = kernels.correct_triad(
            np.ascontiguousarray(raw),
            np.ascontiguousarray(coupled),
            values,
            np.ascontiguousarray(triad.bias),
            self._terms(f"{name}.bias"),
            np.ascontiguousarray(triad.matrix),
            self._terms(f"{name}.matrix"),
            np.zeros((3, 3)) if sensitivity is None else np.ascontiguousarray(sensitivity),
            self._terms("g_sensitivity"),
            zero if triad.asymmetry is None else np.ascontiguousarray(triad.asymmetry),
            zero if triad.quadratic is None else np.ascontiguousarray(triad.quadratic),
            true,
        )
        if singular >= 0:
            raise ValueError(f"the {name}'s matrix is singular at a temperature of the recording")


def _turned(matrices: AnyArray, vectors: Vectors) -> AnyArray:
    return np.einsum("nij,nj->ni", matrices, vectors)


__all__ = [
    "SPAN_MARGIN",
    "Outside",
    "TemperatureBasis",
    "TemperaturePath",
    "ThermalModel",
    "ThermalState",
    "follow_temperature",
]
