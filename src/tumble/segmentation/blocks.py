"""Short blocks of samples and their smoothed means: what the search for holds looks at."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vectors
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.units import angular_rate_factor, specific_force_factor

BLOCK_SECONDS = 0.05
# Half-width of the triangle over blocks. Its nulls lie at multiples of 1 / 0.15 s = 6.7 Hz, so hand
# tremor (8 to 12 Hz) comes through at 5 %, while a turn's slow beginning is kept.
SMOOTHING_SECONDS = 0.15


@dataclass(frozen=True)
class TriadBlocks:
    """One triad's blocks, (blocks, 3): smoothed means, raw units, and roughness, raw units squared."""

    smooth: Vectors
    roughness: np.ndarray


@dataclass(frozen=True)
class Blocks:
    """A recording cut into blocks of `size` samples; a triad that is missing is None.

    `force_factor` and `rate_factor` are those from the declared units to SI, None for counts.
    """

    size: int
    seconds: float
    half_width: int
    specific_force: TriadBlocks | None
    angular_rate: TriadBlocks | None
    force_factor: float | None = None
    rate_factor: float | None = None

    def __len__(self) -> int:
        triad = self.angular_rate or self.specific_force
        return 0 if triad is None else int(triad.smooth.shape[0])


@dataclass(frozen=True)
class BlockCut:
    """How samples at a rate are cut into blocks and smoothed.

    Attributes
    ----------
    size, seconds : samples and seconds of a block.
    half_width : of the triangle that smooths, in blocks.
    """

    size: int
    seconds: float
    half_width: int

    @staticmethod
    def at_rate(rate: float) -> BlockCut:
        """Return the cut into blocks of about 0.05 s, of one sample at least.

        Parameters
        ----------
        rate : Hz.
        """
        size = max(1, round(BLOCK_SECONDS * rate))
        seconds = size / rate
        return BlockCut(size, seconds, max(2, round(SMOOTHING_SECONDS / seconds)))

    def smoothed(self, mean: Vectors, roughness: np.ndarray) -> TriadBlocks:
        """Return a triad's blocks with their means smoothed.

        Parameters
        ----------
        mean, roughness : (blocks, 3).
        """
        from tumble.segmentation.kernels import triangle_smooth

        smooth = np.empty_like(mean)
        triangle_smooth(mean, self.half_width, smooth)
        return TriadBlocks(smooth, roughness)


def cut_blocks(recording: Recording) -> Blocks:
    """Cut a recording into blocks of about 0.05 s (at least one sample) and smooth their means.

    Samples after the last whole block belong to no block; there are fewer of them than a block has.

    Parameters
    ----------
    recording : any units; both triads, or one.
    """
    from tumble.segmentation.kernels import block_moments

    how = BlockCut.at_rate(recording.rate)
    count = len(recording) // how.size

    def cut(signal: Vectors | None) -> TriadBlocks | None:
        if signal is None:
            return None
        mean, roughness = np.empty((count, 3)), np.empty((count, 3), dtype=np.float32)
        block_moments(np.asarray(signal, dtype=float), how.size, mean, roughness)
        return how.smoothed(mean, roughness)

    return Blocks(
        how.size,
        how.seconds,
        how.half_width,
        cut(recording.specific_force),
        cut(recording.angular_rate),
        specific_force_factor(recording.specific_force_unit),
        angular_rate_factor(recording.angular_rate_unit),
    )


def find_runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the half-open index ranges in which `flags` is true."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edge[::2], edge[1::2], strict=True)]
