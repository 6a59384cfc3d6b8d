"""A protocol recorded with a simulated unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Vectors
from tumble.earth import Site
from tumble.errors import UsageError
from tumble.protocol import Protocol
from tumble.recording import Recording
from tumble.sensor import ImuModel
from tumble.simulation.fixtures import PlayedProtocol, play_protocol
from tumble.simulation.grades import Grade
from tumble.simulation.magnetometer import SimulatedMagnetometer
from tumble.simulation.recordings import Distort, Truth, simulate_recording
from tumble.simulation.sampling import Imperfections
from tumble.simulation.table import TableErrors
from tumble.simulation.two_axis import FixtureErrors, play_sequences

# Raw counts per m/s² and per rad/s of a unit of no grade: 0.1 mm/s² and 0.2 "/s a count.
COUNTS_PER_SI = (1e4, 1e6)
UNITS = ("SI", "counts")


def simulate_protocol(
    protocol: Protocol,
    rate: float,
    rng: np.random.Generator,
    *,
    site: Site,
    grade: Grade | None = None,
    model: ImuModel | None = None,
    noise: bool = True,
    imperfections: Imperfections | None = None,
    placement: bool = True,
    heading: float | Series | None = None,
    lever_arm_b: AnyArray | None = None,
    table: TableErrors | None = None,
    fixture: FixtureErrors | None = None,
    units: str = "SI",
    magnetometer: tuple[SimulatedMagnetometer, np.random.Generator] | None = None,
) -> tuple[Recording, Truth]:
    """Record a protocol with a simulated unit.

    Without noise and placement errors the recording is exact: every gyro sample is what the model makes
    of the mean rate over its interval, every accelerometer sample what it makes of the specific force at
    the interval's middle. Terms that are not linear (asymmetry, quadratic) and g-sensitivity act on
    these, sample by sample, as they do in the one sensor model: within a sample nothing is averaged
    after them. At a constant rate that makes no difference; in ramps and turns one of the second order
    in the change of rate within a sample.

    Parameters
    ----------
    protocol : what to do.
    rate : Hz.
    rng : source of all numbers; the same state gives the same recording bit for bit.
    site : gravity and Earth rate.
    grade : noise, converter and the spread of errors; None for a unit without noise.
    model : the sensor's errors, raw units SI; None draws them from the grade (or is exact, without one).
    noise : False leaves noise and converter away, and keeps the grade's errors.
    imperfections : what the recording chain does.
    placement, heading, lever_arm_b, table : as for `play_protocol`.
    fixture : a two-axis fixture that makes the sequences of the protocol, see `play_sequences`. Its errors
        are all that there are: `placement` and the uncertainties of the protocol then do not matter.
    units : "SI", or "counts": raw numbers times the grade's counts per m/s² and per rad/s (`Truth` says
        them), rounded to whole counts where there is noise.
    magnetometer : that is on the unit, with the source of its noise; None for none.

    Raises
    ------
    ProtocolError
        If a step of the protocol cannot be played.
    UsageError
        If the units are unknown, the model has one triad only, or the rate is not positive or so low
        that a sample sees half a turn; if a two-axis fixture cannot do what the protocol asks for, or there
        is a table, too.
    """
    _refuse_odd(units, model)
    played = _played(protocol, rng, placement, heading, lever_arm_b, table, fixture)
    if model is None:
        model = ImuModel.ideal() if grade is None else grade.simulate_model(rng)
    noisy = grade if noise else None
    counts = None
    if units == "counts":
        counts = COUNTS_PER_SI if grade is None else grade.counts_per_si
        model = _in_counts(model, *counts)
        noisy = None if noisy is None else noisy.in_counts()
        imperfections = None if imperfections is None else imperfections.in_raw_unit(*counts)
    recording, truth = simulate_recording(
        played.motion,
        rate,
        rng,
        site=site,
        grade=noisy,
        distort=_shaken(model.distort, played, 0.0 if table is None else table.shake, rate, rng),
        imperfections=imperfections,
    )
    if counts is not None:
        recording = replace(recording, specific_force_unit="counts", angular_rate_unit="counts")
    if magnetometer is not None:
        shown = magnetometer[0].record(played.motion, magnetometer[1])
        recording = replace(recording, magnetic_field=shown)
    return recording, replace(truth.of_played(played, model), counts_per_si=counts, fixture=fixture)


def _refuse_odd(units: str, model: ImuModel | None) -> None:
    if units not in UNITS:
        raise UsageError(f"A simulated recording is in {' or '.join(UNITS)}, not in {units!r}.")
    if model is not None and (model.accelerometer is None or model.gyroscope is None):
        raise UsageError("The model has one triad only, and a simulated unit has two: give it both.")


def _played(
    protocol: Protocol,
    rng: np.random.Generator,
    placement: bool,
    heading: float | Series | None,
    lever_arm_b: AnyArray | None,
    table: TableErrors | None,
    fixture: FixtureErrors | None,
) -> PlayedProtocol:
    """The motion on a table, by hand or on a fixture."""
    if fixture is None:
        return play_protocol(
            protocol,
            rng,
            placement=placement,
            heading=heading,
            lever_arm_b=lever_arm_b,
            table=table,
        )
    if table is not None:
        raise UsageError("A unit is on a turntable or on a two-axis fixture, not on both: leave one away.")
    return play_sequences(protocol, rng, fixture, heading=heading, lever_arm_b=lever_arm_b)


def _shaken(
    distort: Distort, played: PlayedProtocol, shake: float, rate: float, rng: np.random.Generator
) -> Distort:
    """Return the sensor on a table that shakes while it turns, ramps included."""
    if shake == 0.0:
        return distort

    def shaken(force: Vectors, angular_rate: Vectors) -> tuple[Vectors, Vectors]:
        time = (np.arange(len(force)) + 0.5) / rate
        turning = np.zeros(len(force), dtype=bool)
        for spin in played.spins:
            turning |= (time > spin.start - spin.ramps[0]) & (time < spin.stop + spin.ramps[1])
        extra = np.zeros_like(force)
        extra[turning] = rng.normal(0.0, shake, (int(turning.sum()), 3))
        return distort(force + extra, angular_rate)

    return shaken


def _in_counts(model: ImuModel, force: float, rate: float) -> ImuModel:
    """Return the same unit with raw numbers in counts."""
    assert model.accelerometer is not None
    assert model.gyroscope is not None
    return ImuModel(
        model.accelerometer.in_raw_unit(force),
        model.gyroscope.in_raw_unit(rate),
        None if model.g_sensitivity is None else rate * model.g_sensitivity,
    )
