"""The options of `tumble plan`, in groups by the tests that they mean something to."""

from __future__ import annotations

from pathlib import Path

from tumble.cli.options import DataSheet, Imu, NoiseFile, Seed
from tumble.records import dataclass
from tumble.workflows.request import ADVANCED, FIRST, option

POSES = "Poses (multi-position, hand-held, six-position)"


@dataclass(frozen=True)
class PlanOptions:
    """What every plan takes.

    Attributes
    ----------
    given : What is there already, a recording or a calibration: the next poses, turns or rotations are said, and when
        to stop.
    targets : Wished-for standard uncertainties, as bias=50,scale=100,misalignment=20 in µg, ppm and ″; also
        gyro-bias (°/h), gyro-scale, gyro-misalignment, rotation and g-sensitivity.
    rate : The sample rate with its standard uncertainty, as 100±0.01, which all gyro scale factors share. Without it
        the rate is a nominal one, uncertain by 0.58 %.
    """

    imu: Imu = "consumer-mems"
    seed: Seed = 0
    given: Path | None = option(FIRST, "FILE")
    targets: str | None = option(FIRST, "NAME=N,...")
    rate: str | None = option(ADVANCED, "HZ[±HZ]")
    data_sheet: DataSheet = None


@dataclass(frozen=True)
class ProtocolOptions:
    """What only a whole protocol understands.

    Attributes
    ----------
    recorded : With --given RECORDING: the protocol that it was recorded with, which has the table's angles.
    """

    noise: NoiseFile = None
    recorded: str | None = option(ADVANCED, "FILE", "--protocol")


@dataclass(frozen=True)
class PoseOptions:
    """What only a search of poses understands.

    Attributes
    ----------
    poses : How many poses (9; hand-held 26).
    minutes : Instead of --poses: how long the test may last; poses and dwells are then as many and as long as is best.
    hold : Seconds of rest in each pose (30; hand-held 4).
    turn : Seconds from one pose to the next (3; hand-held 2).
    """

    poses: int | None = option(POSES, "N")
    minutes: float | None = option(POSES, "MINUTES", "--time")
    hold: float | None = option(FIRST, "S")
    turn: float | None = option(POSES, "S", "--turn-seconds")
