"""Synthetic recordings: a unit that is held in several poses and turned in between, by numpy alone."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.80665
RATE = 100.0
ROUNDED = 5.1e-7  # half of the sixth decimal that is written, and a double's rounding


@dataclass(frozen=True)
class Tumbled:
    """Ideal motion with noise: time in s, specific force in m/s², angular rate in rad/s."""

    time: np.ndarray
    specific_force: np.ndarray
    angular_rate: np.ndarray

    def rows(self, time: np.ndarray | None = None) -> np.ndarray:
        """A table of seven columns, with other stamps if some are given."""
        return np.column_stack([self.time if time is None else time, self.specific_force, self.angular_rate])

    def seen_in(self, recording: Any) -> bool:
        """Whether a recording has these numbers, to the six decimals that were written."""
        pairs = (self.specific_force, recording.specific_force), (self.angular_rate, recording.angular_rate)
        return all(np.abs(made - found).max() < ROUNDED for made, found in pairs)


def tumble_by_hand(*, holds: int = 12, rate: float = RATE, seed: int = 5) -> Tumbled:
    """Hold for 2 s, turn for 1.5 s about an axis of chance by 40 to 120 degrees, and so on.

    The rate of a sample is the mean over it; the force stands at its middle, so that df/dt = -omega x f up to
    the noise.
    """
    rng = np.random.default_rng(seed)
    still, turning = round(2.0 * rate), round(1.5 * rate)
    now = np.array([1.0, -2.0, 9.0])
    now *= GRAVITY / np.linalg.norm(now)
    rates, forces = [np.zeros((still, 3))], [np.tile(now, (still, 1))]
    shape = np.sin(np.pi * (np.arange(turning) + 0.5) / turning) ** 2
    for _ in range(holds - 1):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        steps = shape / shape.sum() * np.radians(rng.uniform(40.0, 120.0))
        turned = np.cumsum(steps)
        rates += [np.outer(steps * rate, axis), np.zeros((still, 3))]
        forces.append(_seen(now, axis, turned - 0.5 * steps))
        now = _seen(now, axis, turned[-1:])[0]
        forces.append(np.tile(now, (still, 1)))
    omega, force = np.vstack(rates), np.vstack(forces)
    time = np.arange(len(omega)) / rate
    force += 0.02 * rng.normal(size=force.shape)
    omega = omega + np.array([0.01, -0.02, 0.015]) + 0.001 * rng.normal(size=omega.shape)
    return Tumbled(time, force, omega)


def _seen(f: np.ndarray, axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Body coordinates of a fixed vector after the body has turned by `angles` about an axis: Rodrigues' formula."""
    across = np.outer(np.sin(angles), np.cross(axis, f))
    along = np.outer(1.0 - np.cos(angles), axis * (axis @ f))
    return np.outer(np.cos(angles), f) - across + along


def write_csv(path, rows, *, header="t,ax,ay,az,gx,gy,gz", delimiter=",", decimals=6, end="\n") -> Path:
    lines = [] if header is None else [header]
    lines += [delimiter.join(f"{v:.{decimals}f}" for v in row) for row in rows]
    path.write_bytes((end.join(lines) + end).encode())
    return path


def said(recording: Any, *kinds: str) -> str:
    """All remarks of a recording, or those of some kinds."""
    return " ".join(r.text for r in recording.remarks if not kinds or r.kind in kinds)
