"""A unit in a chamber: what temperature its surroundings, its thermometer and its sensors have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.earth import Site
from tumble.protocol import Protocol, RampStep, SoakStep
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.sensor import ThermalModel
from tumble.simulation.fixtures import PlayedProtocol, play_protocol
from tumble.simulation.grades import Grade
from tumble.simulation.recordings import Truth, simulate_recording
from tumble.simulation.sampling import Imperfections
from tumble.simulation.thermal_steps import has_chamber


@dataclass(frozen=True)
class Chamber:
    """The surroundings and the thermometer.

    Attributes
    ----------
    rate : K/s, how fast the surroundings come to a soak's temperature: 3 K/min.
    time_constant : s, of first order, by which the unit with its thermometer is behind its surroundings.
    thermometer_noise : K, one sigma of each sample.
    thermometer_resolution : K, step of its converter; zero for none.
    """

    rate: float = 0.05
    time_constant: float = 300.0
    thermometer_noise: float = 0.0
    thermometer_resolution: float = 0.0

    def surroundings(self, protocol: Protocol, step_edges: AnyArray, time: Series) -> Series:
        """Return (samples,) °C around the unit, which begins at the first soak's or ramp's temperature.

        Parameters
        ----------
        protocol, step_edges : its steps, and s when each begins and ends.
        time : (samples,) s.
        """
        at, celsius = [-np.inf], [np.nan]
        for step, (start, stop) in zip(protocol.steps, step_edges.tolist(), strict=True):
            if isinstance(step, SoakStep):
                now = step.temperature_celsius if np.isnan(celsius[-1]) else celsius[-1]
                there = start + abs(step.temperature_celsius - now) / self.rate
                at += [start, min(there, stop)]
                share = min(1.0, (stop - start) / max(there - start, 1e-9))
                celsius += [now, now + (step.temperature_celsius - now) * share]
            elif isinstance(step, RampStep):
                now = step.start_celsius if np.isnan(celsius[-1]) else celsius[-1]
                at += [start, stop]
                celsius += [now, step.stop_celsius]
        return np.interp(time, at[1:], celsius[1:])

    def unit(self, time: Series, surroundings: Series) -> Series:
        """Return (samples,) °C of the unit, evenly sampled: exact for straight lines between samples."""
        from scipy.signal import lfilter

        if self.time_constant <= 0.0 or time.size < 2:
            return surroundings.copy()
        part = float(time[1] - time[0]) / self.time_constant
        decay = float(np.exp(-part))
        share = (1.0 - decay) / part
        first = float(surroundings[0])
        # From rest at the first temperature: the filter is linear, so that it begins at zero.
        followed = np.asarray(lfilter([1.0 - share, share - decay], [1.0, -decay], surroundings - first))
        return followed + first

    def read(self, unit: Series, rng: np.random.Generator) -> Series:
        """Return (samples,) °C as the thermometer shows them."""
        shown = unit.copy()
        if self.thermometer_noise:
            shown += rng.normal(0.0, self.thermometer_noise, unit.size)
        if self.thermometer_resolution:
            shown = np.round(shown / self.thermometer_resolution) * self.thermometer_resolution
        return shown


@dataclass(frozen=True)
class ChamberTruth:
    """What was true of the temperatures.

    Attributes
    ----------
    thermal : how the unit changes with them, raw units SI.
    chamber : the surroundings and the thermometer.
    time, surroundings, unit : s, °C and °C of every sample.
    """

    thermal: ThermalModel
    chamber: Chamber
    time: Series
    surroundings: Series
    unit: Series


def simulate_chamber(
    protocol: Protocol,
    rate: float,
    rng: np.random.Generator,
    *,
    site: Site,
    thermal: ThermalModel,
    chamber: Chamber,
    grade: Grade | None = None,
    imperfections: Imperfections | None = None,
    placement: bool = True,
) -> tuple[Recording, Truth, ChamberTruth]:
    """Record a protocol with soaks and ramps with a simulated unit, its temperature beside it.

    Parameters
    ----------
    protocol : what to do; without soak or ramp the unit stays at the reference temperature.
    rate : Hz.
    rng : source of all numbers.
    site : gravity and Earth rate.
    thermal : the unit; what its sensors show follows from the unit's temperature by `ThermalModel.distort`.
    chamber : the surroundings and the thermometer.
    grade : of noise and converter; None for none.
    imperfections : what the recording chain does; jitter does not change the temperatures.
    placement : as for `play_protocol`.

    Raises
    ------
    ProtocolError, UsageError
        As for `play_protocol` and `simulate_recording`.
    """
    played = play_protocol(protocol, rng, placement=placement)
    time, around, unit = _temperatures(protocol, played, chamber, rate, thermal.basis.reference_celsius)

    def distort(force: Vectors, angular_rate: Vectors) -> tuple[Vectors, Vectors]:
        return thermal.distort(time[: len(force)], force, angular_rate, unit[: len(force)])

    recording, truth = simulate_recording(
        played.motion, rate, rng, site=site, grade=grade, distort=distort, imperfections=imperfections
    )
    shown = chamber.read(unit, rng)
    # Lost samples have no temperature either: stamps are the middles of the samples, jitter less than one.
    kept = np.clip(np.floor(recording.time * rate).astype(int), 0, time.size - 1)
    recording = replace(recording, temperature=shown[kept])
    of_chamber = ChamberTruth(thermal, chamber, time, around, unit)
    return recording, truth.of_played(played, thermal.reference), of_chamber


def _temperatures(
    protocol: Protocol, played: PlayedProtocol, chamber: Chamber, rate: float, celsius: float
) -> tuple[Series, Series, Series]:
    """Return time of every sample, and what its surroundings and the unit have then."""
    samples = int(np.floor(played.motion.duration * rate))
    time: Series = (np.arange(samples, dtype=np.float64) + 0.5) / rate
    if has_chamber(protocol):
        around = chamber.surroundings(protocol, played.step_edges, time)
    else:
        around = np.full(samples, celsius)
    return time, around, chamber.unit(time, around)
