"""The options of `tumble plan`, in groups by the tests that they mean something to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tumble.cli.groups import ADVANCED, FIRST, option
from tumble.cli.options import DataSheet, Imu, NoiseFile, Seed
from tumble.records import dataclass

POSES = "Poses (multi-position, hand-held, six-position)"


@dataclass(frozen=True)
class PlanOptions:
    """What every plan takes."""

    imu: Imu = "consumer-mems"
    seed: Seed = 0


@dataclass(frozen=True)
class WishOptions:
    """What is there already and what is wished for: of poses and of protocols."""

    given: Annotated[
        Path | None,
        option(
            FIRST,
            "FILE",
            "What is there already, a recording or a calibration: the next poses, turns or rotations are said, "
            "and when to stop.",
        ),
    ] = None
    targets: Annotated[
        str | None,
        option(
            FIRST,
            "NAME=N,...",
            "Wished-for standard uncertainties, as bias=50,scale=100,misalignment=20 in µg, ppm and ″; of "
            "protocols also gyro-bias (°/h), gyro-scale, gyro-misalignment, rotation and g-sensitivity.",
        ),
    ] = None
    rate: Annotated[
        str | None,
        option(
            ADVANCED,
            "HZ[±HZ]",
            "The sample rate with its standard uncertainty, as 100±0.01, which all gyro scale factors share. "
            "Without it the rate is a nominal one, uncertain by 0.58 %.",
        ),
    ] = None
    data_sheet: DataSheet = None


@dataclass(frozen=True)
class ProtocolOptions:
    """What only a whole protocol understands."""

    noise: NoiseFile = None
    recorded: Annotated[
        str | None,
        option(
            ADVANCED,
            "FILE",
            "With --given RECORDING: the protocol that it was recorded with, which has the table's angles.",
            "--protocol",
        ),
    ] = None


@dataclass(frozen=True)
class PoseOptions:
    """What only a search of poses understands."""

    poses: Annotated[int | None, option(POSES, "N", "How many poses (9; hand-held 26).")] = None
    minutes: Annotated[
        float | None,
        option(
            POSES,
            "MINUTES",
            "Instead of --poses: how long the test may last; poses and dwells are then as many and as long "
            "as is best.",
            "--time",
        ),
    ] = None
    hold: Annotated[float | None, option(FIRST, "S", "Seconds of rest in each pose (30; hand-held 4).")] = (
        None
    )
    turn: Annotated[
        float | None,
        option(POSES, "S", "Seconds from one pose to the next (3; hand-held 2).", "--turn-seconds"),
    ] = None
