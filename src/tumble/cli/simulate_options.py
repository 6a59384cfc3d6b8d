"""What is wrong with a simulated session: recording chain, turntable, fixture; in the field's units, made SI here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from tumble.cli.groups import Range, detail, in_si, numbers, option
from tumble.cli.options import TurnOnBias
from tumble.errors import UsageError
from tumble.records import dataclass
from tumble.units import DEGREE, STANDARD_GRAVITY

if TYPE_CHECKING:
    from tumble.arrays import AnyArray
    from tumble.simulation import FixtureErrors, Imperfections, TableErrors

UNIT, CHAIN, TABLE = "The unit's errors", "The recording chain's errors", "Turntable"
FIXTURE = "Two-axis fixture (any of these puts the unit on one)"

_ARCSECONDS = Range(0.0, 36_000.0, "arc-seconds", DEGREE / 3600.0)
_MILLISECONDS = Range(0.0, 1000.0, "milliseconds", 1e-3)
_SECONDS = Range(0.0, 600.0, "seconds")


@dataclass(frozen=True)
class ErrorOptions:
    """What is wrong with the unit beyond its grade's scale factors, biases and noise."""

    placement: Annotated[
        bool,
        detail(
            UNIT,
            "",
            "Make the placement errors that the protocol allows (default).",
            "--placement/--no-placement",
        ),
    ] = True
    sensor_noise: Annotated[
        bool, detail(UNIT, "", "Add noise and the converter's steps (default).", "--sensor-noise/--no-noise")
    ] = True
    nonlinear: Annotated[
        bool, detail(UNIT, "", "Also draw quadratic terms of the sheet's linearity.", "--nonlinear")
    ] = False
    wander: Annotated[
        bool, detail(UNIT, "", "Also let biases wander by the sheet's in-run stability.", "--wander")
    ] = False
    asymmetry_ppm: Annotated[
        float,
        detail(UNIT, "PPM", "Standard deviation of each sensor's scale-factor asymmetry, in ppm."),
        Range(0.0, 1e5, si=1e-6),
    ] = 0.0
    turn_on_bias: TurnOnBias = None


@dataclass(frozen=True)
class MagnetometerOptions:
    """A magnetometer on the unit, and the field of the place."""

    magnetometer: Annotated[
        str | None,
        option(UNIT, "GRADE", "Also record a magnetometer, in µT at its own rate: lis3mdl or rm3100."),
    ] = None
    magnetic_field: Annotated[
        str | None,
        detail(UNIT, "UT,DIP[,DECL]", "Norm of the field in µT, dip and declination in degrees (49,65,4)."),
    ] = None
    field_change: Annotated[
        str | None,
        detail(UNIT, "UT,S", "A current nearby changes the field by so many µT, from so many seconds on."),
    ] = None

    def field(self) -> dict[str, Any]:
        """Return what `simulate` takes, SI.

        Raises
        ------
        UsageError
            If a number is none, or there is no magnetometer.
        """
        if self.magnetometer is None and (self.magnetic_field or self.field_change):
            raise UsageError(
                "--magnetic-field and --field-change are about a magnetometer: give --magnetometer too."
            )
        made: dict[str, Any] = {"magnetometer": self.magnetometer}
        if self.magnetic_field is not None:
            norm, dip, *more = _parts(self.magnetic_field, "--magnetic-field", (2, 3))
            made["magnetic_field"] = (1e-6 * norm, DEGREE * dip, DEGREE * more[0] if more else 0.0)
        if self.field_change is not None:
            size, since = _parts(self.field_change, "--field-change", (2,))
            made["field_change"] = (1e-6 * size, since)
        return made


def _parts(text: str, name: str, counts: tuple[int, ...]) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{name} {text}: give {' or '.join(map(str, counts))} numbers, parted by commas.")
    return values


@dataclass(frozen=True)
class ChainOptions:
    """What the recording chain does to the samples."""

    angle_pulse_arcsec: Annotated[
        float,
        detail(CHAIN, "ARCSEC", "The gyros send whole pulses of so many arc-seconds."),
        Range(0.0, 36_000.0, si=DEGREE / 3600.0),
    ] = 0.0
    velocity_pulse_mm_per_s: Annotated[
        float,
        detail(CHAIN, "MM/S", "The accelerometers send whole pulses of so many mm/s."),
        Range(0.0, 1000.0, si=1e-3),
    ] = 0.0
    jitter: Annotated[
        float,
        detail(CHAIN, "MS", "Standard deviation of the stamps about the true instants, in ms."),
        _MILLISECONDS,
    ] = 0.0
    sampling_jitter: Annotated[
        float,
        detail(CHAIN, "MS", "Standard deviation of the instants themselves, which no stamp shows, in ms."),
        _MILLISECONDS,
    ] = 0.0
    dropped: Annotated[
        float,
        detail(CHAIN, "PERCENT", "Share of the samples that are lost, in per cent."),
        Range(0.0, 50.0, "a share of the samples in per cent,", 1e-2),
    ] = 0.0
    burst: Annotated[
        float,
        detail(CHAIN, "N", "How many samples are lost at a time, on average."),
        Range(1.0, 1e6, words="how many samples are lost at a time, 1 or more"),
    ] = 1.0

    def imperfections(self) -> Imperfections:
        """Return them for the simulation.

        Raises
        ------
        UsageError
            If a number is not one that a recording chain has.
        """
        from tumble.simulation import Imperfections

        si = in_si(self)
        return Imperfections(
            jitter=si["jitter"],
            sampling_jitter=si["sampling_jitter"],
            dropped=si["dropped"],
            burst=si["burst"],
            angle_increment=si["angle_pulse_arcsec"],
            velocity_increment=si["velocity_pulse_mm_per_s"],
        )


@dataclass(frozen=True)
class TableOptions:
    """What is wrong with the turntable, and where the unit sits on it."""

    table_angle_arcsec: Annotated[
        float | None,
        detail(
            TABLE,
            "ARCSEC",
            "Standard deviation of each angle against the display, in arc-seconds (default: the protocol's).",
        ),
        _ARCSECONDS,
    ] = None
    table_once_arcsec: Annotated[
        float,
        detail(TABLE, "ARCSEC", "Systematic error of the angle, once a revolution, in arc-seconds."),
        _ARCSECONDS,
    ] = 0.0
    table_twice_arcsec: Annotated[
        float, detail(TABLE, "ARCSEC", "The same, twice a revolution."), _ARCSECONDS
    ] = 0.0
    table_tilt_deg: Annotated[
        float,
        detail(
            TABLE, "DEG", "Standard deviation of the axes' lean from where the protocol has them, in degrees."
        ),
        Range(0.0, 45.0, "degrees", DEGREE),
    ] = 0.0
    table_wobble_arcsec: Annotated[
        float,
        detail(TABLE, "ARCSEC", "Half angle of the cone that the axis describes, in arc-seconds."),
        _ARCSECONDS,
    ] = 0.0
    table_ripple_ppm: Annotated[
        float,
        detail(TABLE, "PPM", "Amplitude of the rate's ripple, in ppm of the rate."),
        Range(0.0, 500_000.0, "ppm", 1e-6),
    ] = 0.0
    table_ripple_cycles: Annotated[int, detail(TABLE, "N", "How often it comes in a revolution (12).")] = 12
    table_ramps: Annotated[
        float,
        detail(TABLE, "PERCENT", "Standard deviation of the time of each ramp, in per cent of it."),
        Range(0.0, 50.0, "per cent", 1e-2),
    ] = 0.0
    table_shake_ug: Annotated[
        float,
        detail(
            TABLE,
            "UG",
            "Standard deviation that turning adds to each accelerometer sample, in millionths of g.",
        ),
        Range(0.0, 100_000.0, "millionths of g", 1e-6 * STANDARD_GRAVITY),
    ] = 0.0
    table_stops: Annotated[
        list[str] | None,
        detail(
            TABLE,
            "SPIN:PERCENT",
            "A spin, counted from 1, that stops after so much of its angle; may be given again.",
        ),
    ] = None
    table_lever_arm_cm: Annotated[
        str | None,
        detail(
            TABLE,
            "X,Y,Z",
            "From the centre of table or fixture to the accelerometers, in b; nine numbers for a place of each.",
        ),
    ] = None

    def errors(self) -> TableErrors | None:
        """Return what is wrong with the table; None where nothing is said of it.

        Raises
        ------
        UsageError
            If a number is not one that a table has.
        """
        si, stops = in_si(self), self.table_stops or []
        if self.table_angle_arcsec is None and not stops and not any(si.values()):
            return None
        from tumble.simulation import TableErrors

        if self.table_ripple_cycles < 1:
            raise UsageError(
                f"--table-ripple-cycles {self.table_ripple_cycles}: give a whole number from 1 on."
            )
        return TableErrors(
            angle_sigma=si.get("table_angle_arcsec"),
            once=si["table_once_arcsec"],
            twice=si["table_twice_arcsec"],
            axis_tilt=si["table_tilt_deg"],
            wobble=si["table_wobble_arcsec"],
            ripple=si["table_ripple_ppm"],
            ripple_cycles=self.table_ripple_cycles,
            ramp_spread=si["table_ramps"],
            shake=si["table_shake_ug"],
            stops_early=tuple(_stop(word) for word in stops),
        )

    def lever_arm(self) -> AnyArray | None:
        """Return the lever arm in m, (3,), or (3, 3) with a row for each accelerometer; None without.

        Raises
        ------
        UsageError
            If it is anything else than three or nine numbers.
        """
        word = self.table_lever_arm_cm
        if word is None:
            return None
        import numpy as np

        try:
            arm = 1e-2 * np.array(numbers(word, "--table-lever-arm-cm"))
        except UsageError:
            arm = np.zeros(0)
        if arm.size not in (3, 9) or not np.all(np.abs(arm) <= 10.0):
            raise UsageError(
                f"--table-lever-arm-cm {word}: write three numbers in cm, such as 3,-2,1, or nine, three for each "
                "accelerometer; each at most 1000."
            )
        return arm if arm.size == 3 else arm.reshape(3, 3)


def _stop(word: str) -> tuple[int, float]:
    spin, _, percent = word.partition(":")
    try:
        number, share = int(spin), float(percent) / 100.0
    except ValueError:
        number, share = 0, 0.0
    if number < 1 or not 0.0 < share < 1.0:
        raise UsageError(
            f"--table-stops {word}: write the number of a spin, from 1, and after how many per cent of its "
            "angle it stops, such as 2:60."
        )
    return number - 1, share


_MRAD = Range(0.0, 100.0, "milliradians", 1e-3)
_Amount: TypeAlias = float | None


@dataclass(frozen=True)
class FixtureOptions:
    """The quality of a two-axis fixture, one sigma of each error, and how it turns."""

    fixture_azimuth_deg: Annotated[
        _Amount,
        detail(
            FIXTURE,
            "DEG",
            "Where the outer axis points, in degrees clockwise from north (default: the protocol's, east).",
        ),
        Range(-360.0, 360.0, "degrees", DEGREE),
    ] = None
    fixture_installation_mrad: Annotated[
        _Amount,
        detail(
            FIXTURE,
            "MRAD",
            "Standard deviation of the outer axis' heading and of both tilts, in milliradians.",
        ),
        _MRAD,
    ] = None
    fixture_orthogonality_mrad: Annotated[
        _Amount,
        detail(
            FIXTURE,
            "MRAD",
            "Standard deviation of the angle between the axes about a right one, in milliradians.",
        ),
        _MRAD,
    ] = None
    fixture_zero_mrad: Annotated[
        _Amount, detail(FIXTURE, "MRAD", "Standard deviation of both angles' zero, in milliradians."), _MRAD
    ] = None
    fixture_mounting_mrad: Annotated[
        _Amount,
        detail(
            FIXTURE,
            "MRAD",
            "Standard deviation of how the unit lies on the inner axis, about each axis, in milliradians.",
        ),
        _MRAD,
    ] = None
    fixture_execution_mrad: Annotated[
        _Amount,
        detail(FIXTURE, "MRAD", "Standard deviation of each stop of each axis, in milliradians."),
        _MRAD,
    ] = None
    fixture_rate_deg_per_s: Annotated[
        _Amount,
        detail(FIXTURE, "DEG/S", "Rate of its rotations (default: as long as the protocol says)."),
        Range(0.1, 5000.0, "degrees per second", DEGREE),
    ] = None
    fixture_ramp_s: Annotated[
        _Amount, detail(FIXTURE, "S", "Seconds to come to the rate, and to stop (default: 0.5)."), _SECONDS
    ] = None
    fixture_pause_s: Annotated[
        _Amount,
        detail(FIXTURE, "S", "Seconds of rest between the rotations of a sequence (default: 1)."),
        _SECONDS,
    ] = None

    def errors(self) -> tuple[FixtureErrors | None, float | None]:
        """Return the quality of the fixture, and, rad, where its outer axis points; None without any option.

        Raises
        ------
        UsageError
            If a number is not one that a fixture has.
        """
        si = in_si(self)
        if not si:
            return None, None
        from tumble.simulation import FixtureErrors

        installation, zero, mounting, execution, orthogonality = (
            si.get(f"fixture_{name}_mrad", 0.0)
            for name in ("installation", "zero", "mounting", "execution", "orthogonality")
        )
        usual = FixtureErrors()
        quality = FixtureErrors(
            heading=installation,
            tilt=(installation, installation),
            orthogonality=orthogonality,
            inner_zero=zero,
            outer_zero=zero,
            mounting=(mounting, mounting, mounting),
            execution=execution,
            rate=si.get("fixture_rate_deg_per_s"),
            ramp=si.get("fixture_ramp_s", usual.ramp),
            pause=si.get("fixture_pause_s", usual.pause),
        )
        return quality, si.get("fixture_azimuth_deg")
