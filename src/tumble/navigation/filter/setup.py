"""What a filter is told before it starts."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from tumble.arrays import Series, Table, Vector
from tumble.errors import UsageError
from tumble.navigation.filter.sensor_states import (
    SensorState,
    TriadSpread,
    covariance_of,
    sensor_states,
)
from tumble.noise.terms import NoiseModel
from tumble.records import dataclass

Noise = NoiseModel | tuple[NoiseModel, NoiseModel, NoiseModel]
"""Of all three axes alike, or of each."""


@dataclass(frozen=True, slots=True)
class FilterSetup:
    """A filter's states, their covariance at the start, and its noise.

    Attributes
    ----------
    states : beyond the nine of position, velocity and attitude, in order.
    sensor_covariance : (states, states) at the start, in the states' units.
    navigation_covariance : (9, 9) of position (m), velocity (m/s) and attitude (rad), in n.
    angle_random_walk, velocity_random_walk : (3,) rad/√s and m/s/√s, root of the two-sided density, an axis each.
    lever_arm_b : (3,) m, from the IMU to the antenna.
    gate : probability below which a fix's innovation is taken for an outlier's (chi-square of three).
    patience : fixes in a row that may be refused; the next is taken for as good as it fits.
    block : s over which the transition is gathered before the covariance is carried on.
    whole_covariance : (9 + states, 9 + states) at the start with the correlations between navigation and sensors,
        as a fine alignment leaves it; None for what the two others say.
    """

    states: tuple[SensorState, ...]
    sensor_covariance: Table
    navigation_covariance: Table
    angle_random_walk: Vector
    velocity_random_walk: Vector
    lever_arm_b: Vector = field(default_factory=lambda: np.zeros(3))
    gate: float = 1e-5
    patience: int = 3
    block: float = 0.1
    whole_covariance: Table | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Every state in words, the nine of navigation first."""
        nine = [f"{what} {axis}" for what in ("position", "velocity") for axis in ("north", "east", "down")]
        nine += [f"attitude {axis}" for axis in ("north", "east", "down")]
        return (*nine, *(state.name for state in self.states))

    @property
    def places(self) -> np.ndarray:
        """(states, 3) of each sensor state: which of the samples' parameters it adds to, for the compiled loops."""
        return np.array([state.place for state in self.states], np.int64).reshape(-1, 3)

    @property
    def nominal(self) -> Series:
        """(37,) parameters of samples that are right as they are, with the lever arm, for the compiled loops."""
        unit = np.eye(3).ravel()
        return np.concatenate([unit, unit, np.zeros(15), self.lever_arm_b, [0.0]], dtype=np.float64)

    @property
    def covariance(self) -> Table:
        """Of all states at the start; without `whole_covariance` navigation and sensors are independent there."""
        if self.whole_covariance is not None:
            return self.whole_covariance.copy()
        count = 9 + len(self.states)
        whole = np.zeros((count, count))
        whole[:9, :9] = self.navigation_covariance
        whole[9:, 9:] = self.sensor_covariance
        return whole

    def with_start(
        self, position: float | Vector, velocity: float | Vector, attitude: float | Vector
    ) -> FilterSetup:
        """Return the setup with the start's standard deviations: m, m/s, rad; one number or three in n each."""
        sigmas = np.concatenate([np.broadcast_to(x, 3) for x in (position, velocity, attitude)])
        return replace(self, navigation_covariance=np.diag(sigmas.astype(float) ** 2), whole_covariance=None)

    def with_sensor_covariance(self, covariance: Table) -> FilterSetup:
        """Return the setup with another covariance of its sensor states at the start.

        Raises
        ------
        UsageError
            If it has another size than there are states.
        """
        if covariance.shape != self.sensor_covariance.shape:
            raise UsageError(
                f"{len(self.states)} sensor states take a covariance of as many rows, not {len(covariance)}."
            )
        return replace(self, sensor_covariance=covariance, whole_covariance=None)


def plan_filter(
    accelerometer_noise: Noise,
    gyroscope_noise: Noise,
    *,
    accelerometer: TriadSpread | None = None,
    gyroscope: TriadSpread | None = None,
    lever_arm_b: Vector | None = None,
    lever_arm_sigma: float = 0.0,
    time_offset_sigma: float = 0.0,
    g_sensitivity: float = 0.0,
) -> FilterSetup:
    """Return a filter's setup from what is known of the unit's noise and errors.

    Parameters
    ----------
    accelerometer_noise, gyroscope_noise : of whose terms white noise, rate random walk, Gauss-Markov processes
        are used.
    accelerometer, gyroscope : what is known of each triad at the start; None for no states of its matrix, and a
        bias only where the noise drives one.
    lever_arm_b : (3,) m from the IMU to the antenna; None for zero.
    lever_arm_sigma, time_offset_sigma, g_sensitivity : as for `sensor_states`.

    Raises
    ------
    UsageError
        If a sigma is negative.
    """
    forces = (
        (accelerometer_noise,) * 3 if isinstance(accelerometer_noise, NoiseModel) else accelerometer_noise
    )
    rates = (gyroscope_noise,) * 3 if isinstance(gyroscope_noise, NoiseModel) else gyroscope_noise
    states = sensor_states(
        accelerometer or TriadSpread(),
        gyroscope or TriadSpread(),
        accelerometer_noise=forces,
        gyroscope_noise=rates,
        g_sensitivity=g_sensitivity,
        lever_arm=lever_arm_sigma,
        time_offset=time_offset_sigma,
    )
    return FilterSetup(
        states=states,
        sensor_covariance=covariance_of(states),
        navigation_covariance=np.diag([1.0] * 3 + [0.1] * 3 + [0.01, 0.01, 0.1]) ** 2,
        angle_random_walk=np.array([model.random_walk for model in rates]),
        velocity_random_walk=np.array([model.random_walk for model in forces]),
        lever_arm_b=np.zeros(3) if lever_arm_b is None else lever_arm_b,
    )
