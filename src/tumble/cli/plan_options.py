"""The options of `tumble plan`, in groups by the tests that they mean something to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tumble.cli.groups import ADVANCED, FIRST, detail, option
from tumble.cli.options import DataSheet, Imu, NoiseFile, Seed
from tumble.records import dataclass

POSES, BUDGET = "Poses (multi-position, hand-held, six-position)", "Error budget (strapdown-rotation)"
FIXTURE = "Fixture"


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
    steps: Annotated[
        bool, detail(ADVANCED, "", "Judge what each step is worth (default).", "--steps/--no-steps")
    ] = True


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
    turn: Annotated[
        float | None,
        detail(POSES, "S", "Seconds from one pose to the next (3; hand-held 2).", "--turn-seconds"),
    ] = None
    criterion: Annotated[
        str,
        detail(
            POSES,
            "A|D|E|minimax|I",
            "What is made small: A (mean variance, the default), D (volume), E (worst combination), minimax "
            "(worst against Zhang's nine) or I (error of a corrected vector).",
        ),
    ] = "A"
    wanted: Annotated[
        str | None,
        option(
            POSES,
            "NAME,...",
            "What matters, such as bias or 'scale,misalignment yz' (default: everything).",
            "--for",
        ),
    ] = None
    reach: Annotated[
        str,
        option(
            POSES,
            "REACH",
            "Which poses there are: 26 (default), sphere, two-axis, or a protocol file whose holds are a jig's "
            "poses.",
        ),
    ] = "26"
    outer: Annotated[
        str | None,
        detail(POSES, "MIN,MAX,STEP", "Angles in ° of a two-axis fixture's level axis (-180,135,45)."),
    ] = None
    inner: Annotated[
        str | None,
        detail(POSES, "MIN,MAX,STEP", "Angles in ° of the axis that it carries, the unit's z (0,315,45)."),
    ] = None


@dataclass(frozen=True)
class RestOptions:
    """What poses and an error budget share: rests, levels and the accelerometers' noise."""

    hold: Annotated[
        float | None,
        option(
            FIRST,
            "S",
            "Seconds of rest in each pose (30; hand-held 4), or before and after each sequence (10).",
        ),
    ] = None
    fixture_mrad: Annotated[
        float | None,
        option(
            FIXTURE,
            "MRAD",
            "How well the fixture is levelled and the unit aligned on it, one sigma (0.1° are 1.75; default: "
            "1, and 8.7 of a six-position test).",
        ),
    ] = None
    accelerometer_noise_ug: Annotated[
        float | None,
        detail(ADVANCED, "UG/√HZ", "The accelerometers' noise in µg/√Hz, of another data sheet."),
    ] = None


@dataclass(frozen=True)
class BudgetOptions:
    """What only an error budget understands."""

    heading_mrad: Annotated[
        float | None,
        detail(
            FIXTURE,
            "MRAD",
            "How well the outer axis' direction against north is known (default: as the fixture).",
        ),
    ] = None
    execution_mrad: Annotated[
        float | None,
        detail(FIXTURE, "MRAD", "How far beside its angle an axis stops (default: as the fixture)."),
    ] = None
    azimuth_deg: Annotated[
        float, detail(FIXTURE, "DEG", "Where the outer axis points, from north by east.", show_default=True)
    ] = 90.0
    turn_rate: Annotated[float, detail(FIXTURE, "DEG/S", "Rate of the rotations.", show_default=True)] = 57.3
    pause: Annotated[
        float, detail(FIXTURE, "S", "Seconds between two rotations, and beside each rest.", show_default=True)
    ] = 1.0
    gyro_walk_deg_per_root_hour: Annotated[
        float | None, detail(BUDGET, "DEG/√H", "The gyros' angle random walk in °/√h, of another data sheet.")
    ] = None
    gyro_pulse_arcsec: Annotated[
        float | None, detail(BUDGET, "ARCSEC", "Size of the gyros' pulses in arc-seconds (default: none).")
    ] = None
    play_backs: Annotated[
        int,
        detail(
            BUDGET,
            "N",
            "How often the recording is played back with what it gave (calibrate: until it settles).",
            show_default=True,
        ),
    ] = 2
    formulas: Annotated[
        bool,
        detail(
            BUDGET,
            "",
            "Savage's (13), or all components by least squares (default).",
            "--formulas/--least-squares",
        ),
    ] = False
    start_bias: Annotated[
        bool,
        detail(
            BUDGET,
            "",
            "The gyros' bias from the rest before each sequence (default).",
            "--start-bias/--no-start-bias",
        ),
    ] = True
    norm: Annotated[
        bool,
        detail(
            BUDGET,
            "",
            "The vertical from the acceleration's length (default), or projected.",
            "--norm/--no-norm",
        ),
    ] = True
    asymmetry: Annotated[
        bool,
        detail(
            BUDGET,
            "",
            "With sequences 1a to 3a (default), for gyros with asymmetry.",
            "--asymmetry/--no-asymmetry",
        ),
    ] = True
    monte_carlo: Annotated[int, option(BUDGET, "N", "Also draw so many tests, with all errors at once.")] = 0
