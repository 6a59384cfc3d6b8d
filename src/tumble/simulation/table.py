"""A turntable with errors: what its display does not show, and how it turns.

Each placement of the unit begins at the display's zero. The display follows the table through ramps and
ripple; what it does not see are the errors of the angle, the lean of the axis and its wobble. The table's
errors have phases of their own, drawn once.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vector, Vectors
from tumble.attitude import matrix_from_rotation_vector
from tumble.errors import ProtocolError
from tumble.protocol import SpinStep
from tumble.records import dataclass
from tumble.simulation.spin_shapes import SpinShapes

# A ramp is never shorter than this share of what the protocol says.
SHORTEST_RAMP = 0.1
# Rounding of a duration that follows from an angle, s: one that the protocol states stays what it is.
SAME_DURATION = 1e-9


@dataclass(frozen=True)
class TableErrors:
    """What is wrong with a turntable; without arguments nothing.

    They are made even where a protocol is played without placement errors.

    Attributes
    ----------
    angle_sigma : rad, one sigma by which each angle turned differs from what the display shows, each for
        itself; None takes the protocol's `angle_sigma` of each spin, as far as placement errors are made.
    once, twice : rad, amplitude of the angle's systematic error once and twice a revolution. It comes
        back after each revolution, but the rate goes up and down by it.
    axis_tilt : rad, one sigma about each axis of north, east, down by which all spins' axes lean from
        where the protocol has them; the poses do not.
    wobble : rad, half angle of the cone that the axis describes. It goes round once a revolution in the
        room, against the turn; in the unit twice. One that goes with the unit is another mounting, no wobble.
    ripple : amplitude of the rate's ripple as a share of the rate.
    ripple_cycles : of the ripple, per revolution.
    ramp_spread : one sigma of each ramp's time as a share of it: up and down differ, and so do the two ways.
    shake : m/s², one sigma of what a turning table adds to each sample of each accelerometer, each for
        itself; at rest nothing. Only a recording has samples: a motion alone is not shaken.
    stops_early : (spin, share) of spins, counted from 0, that stop after that share of their angle. The
        unit then stays where it is until it is placed anew.
    """

    angle_sigma: float | None = None
    once: float = 0.0
    twice: float = 0.0
    axis_tilt: float = 0.0
    wobble: float = 0.0
    ripple: float = 0.0
    ripple_cycles: int = 12
    ramp_spread: float = 0.0
    shake: float = 0.0
    stops_early: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Drive:
    """One spin as the table makes it.

    Attributes
    ----------
    shown, angle : rad with sign, what the display says was turned, and what was, from rest to rest.
    duration : s, ramps included.
    ramp_up, ramp_down : s.
    phase : (waves,) rad, of ripple and systematic errors at the start, along the turn.
    table_angle : rad, where the table stands at the start, as displayed.
    halted : whether it stopped early.
    """

    shown: float
    angle: float
    duration: float
    ramp_up: float
    ramp_down: float
    phase: Series
    table_angle: float
    halted: bool


class Table:
    """A table in use: what is the same for all of its spins, and where it stands."""

    def __init__(self, errors: TableErrors | None, rng: np.random.Generator, placement: bool) -> None:
        self.errors = errors or TableErrors()
        self.is_given = errors is not None
        self.rng, self.placement = rng, placement
        e = self.errors
        self.cycles = np.array([float(e.ripple_cycles), 1.0, 2.0])
        self.amplitude = np.array([e.ripple / e.ripple_cycles, e.once, e.twice])
        self.lean = matrix_from_rotation_vector(self._normal(e.axis_tilt, 3))
        waves = np.any(self.amplitude > 0.0)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, 3) if waves else np.zeros(3)
        self.wobble_phase = float(rng.uniform(0.0, 2.0 * np.pi)) if e.wobble > 0.0 else 0.0
        self.stands, self.count = 0.0, 0

    def zero(self) -> None:
        """Begin anew with the unit mounted another way."""
        self.stands = 0.0

    def drive(self, step: SpinStep, rate: float, where: str) -> Drive:
        """Return the next spin, and go there.

        Parameters
        ----------
        step : what is asked for.
        rate : rad/s, its rate with the table's error.
        where : the step as the user knows it.

        Raises
        ------
        ProtocolError
            If the angle is so small that the table would not come to its rate.
        """
        e = self.errors
        ramp_up, ramp_down = self._ramps(step)
        asked = step.angle if step.angle is not None else rate * (step.duration + step.ramp)
        share = dict(e.stops_early).get(self.count)
        shown = asked if share is None else share * asked
        steady = abs(shown / rate) - 0.5 * (ramp_up + ramp_down)
        if not steady > 0.0:
            raise ProtocolError(
                f"{where} turns by {np.degrees(shown):.4g} degrees, which its ramps alone exceed: "
                "give a larger angle or shorter ramps."
            )
        if abs(steady - step.duration) < SAME_DURATION:
            steady = step.duration
        phase = np.sign(rate) * (self.cycles * self.stands + self.phase)
        # The display does not see its systematic errors; ripple it does.
        turned = abs(shown) * self.cycles
        unseen = (self.amplitude * (np.sin(turned + phase) - np.sin(phase)))[1:].sum()
        angle = shown + np.sign(rate) * unseen + self._error(step)
        drive = Drive(
            shown,
            float(angle),
            steady + ramp_up + ramp_down,
            ramp_up,
            ramp_down,
            phase,
            self.stands,
            share is not None,
        )
        self.stands += shown
        self.count += 1
        return drive

    def shown_sigma(self, step: SpinStep) -> float:
        """Return what the table's maker says of its angles: rad.

        Parameters
        ----------
        step : of a spin.
        """
        return step.angle_sigma if self.errors.angle_sigma is None else self.errors.angle_sigma

    def shapes(self, drives: list[Drive | None], axes: Vectors) -> SpinShapes:
        """Return how each turn runs.

        Parameters
        ----------
        drives : of each turn; None for one that is no spin.
        axes : (turns, 3) unit vectors of the table's axis in b.
        """
        none = np.zeros(3)
        spins = [drive is not None for drive in drives]
        wobble = np.zeros((len(drives), 3))
        for k, drive in enumerate(drives):
            if drive is not None and self.errors.wobble > 0.0:
                wobble[k] = self.wobble_b(drive, axes[k])
        return SpinShapes(
            np.array([np.nan if d is None else d.ramp_up for d in drives]),
            np.array([np.nan if d is None else d.ramp_down for d in drives]),
            np.outer(spins, self.amplitude).astype(float),
            self.cycles,
            np.array([none if d is None else d.phase for d in drives]).reshape(-1, 3),
            wobble,
        )

    def wobble_b(self, drive: Drive, axis_b: Vector) -> Vector:
        """Return by which the axis leans in b when a spin starts, rad.

        Parameters
        ----------
        drive : the spin.
        axis_b : (3,) unit vector, the table's axis in b.
        """
        first = np.cross(axis_b, np.eye(3)[int(np.argmin(np.abs(axis_b)))])
        first /= np.linalg.norm(first)
        at = self.wobble_phase - 2.0 * drive.table_angle
        return self.errors.wobble * (np.cos(at) * first + np.sin(at) * np.cross(axis_b, first))

    def _ramps(self, step: SpinStep) -> tuple[float, float]:
        """Ramps up and down."""
        spread = 1.0 + self._normal(self.errors.ramp_spread, 2)
        up, down = step.ramp * np.maximum(spread, SHORTEST_RAMP)
        return float(up), float(down)

    def _error(self, step: SpinStep) -> float:
        """What the true angle differs from the display's, beside what is systematic."""
        own = self.errors.angle_sigma
        sigma = own if own is not None else step.angle_sigma if self.placement else 0.0
        return float(self._normal(sigma, 1)[0])

    def _normal(self, sigma: float, count: int) -> Series:
        """Draw nothing where there is nothing to be drawn: what else is drawn stays the same."""
        return self.rng.normal(0.0, sigma, count) if sigma > 0.0 else np.zeros(count)
