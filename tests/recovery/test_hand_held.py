"""By hand the truth comes back: turns played by scipy's rotations, not by our simulator."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from recovery.played import jointly
from tumble.calibration import Estimate, Session
from tumble.earth import Site
from tumble.recording import Recording
from tumble.segmentation import Hold, HoldMeans, NoiseFloor, Timeline, Turn
from tumble.sensor import Triad

GRAVITY = 9.81
RATE = 100.0
SITE = Site.from_gravity(GRAVITY)

# Nothing here is symmetric, and no two numbers are alike: a transpose or a sign shows.
M_A = np.array([[1.02, 0.0, 0.0], [-0.011, 0.98, 0.0], [0.031, -0.019, 1.05]])
B_A = np.array([0.11, -0.23, 0.31])
M_G = np.array([[0.99, 0.021, -0.033], [-0.014, 1.03, 0.026], [0.037, -0.018, 0.97]])
B_G = np.array([0.021, -0.013, 0.034])
G_SENS = 1e-4 * np.array([[11.0, -23.0, 5.0], [31.0, -13.0, 19.0], [-27.0, 16.0, -7.0]])

# Body axis and angle (degrees) of each turn: right-handed about the axis, as scipy has it.
TURNS = (
    ((1.0, 0.0, 0.0), 90.0), ((0.0, 1.0, 0.0), 45.0), ((1.0, 0.0, 0.0), -135.0), ((0.0, 0.0, 1.0), 120.0),
    ((0.0, 1.0, 0.0), -90.0), ((1.0, 0.0, 0.0), 60.0), ((0.0, 0.0, 1.0), -80.0), ((0.6, 0.8, 0.0), 100.0),
    ((0.0, 1.0, 0.0), 135.0), ((0.0, 0.6, -0.8), 75.0), ((1.0, 0.0, 0.0), -45.0), ((0.0, 0.0, 1.0), 150.0),
    ((0.8, 0.0, 0.6), -110.0), ((0.0, 1.0, 0.0), 70.0), ((1.0, 0.0, 0.0), 130.0), ((-0.48, 0.6, 0.64), 95.0),
    ((0.0, 0.0, 1.0), -60.0), ((0.0, 1.0, 0.0), -120.0), ((1.0, 0.0, 0.0), 80.0), ((0.0, 0.8, 0.6), 85.0),
)  # fmt: skip


@dataclass
class Scene:
    """A recording whose holds and turns are known, with the samples that scipy gives."""

    recording: Recording
    timeline: Timeline
    means: HoldMeans


def play(
    *,
    m_a: np.ndarray = M_A,
    b_a: np.ndarray = B_A,
    quadratic: np.ndarray | None = None,
    m_g: np.ndarray = M_G,
    b_g: np.ndarray = B_G,
    g_sens: np.ndarray | None = None,
    earth_rate_n: np.ndarray | None = None,
    units: tuple[str, str] = ("m/s^2", "rad/s"),
    sigma: tuple[float, float] = (1e-3, 1e-5),
) -> Scene:
    """Rest 3 s, turn 2 s at a constant rate, and so on through TURNS.

    The rate steps up and down within one sample, linearly; the angle at a sample is then the sum of
    trapezoids, with no approximation, and the axis is fixed in the body. `sigma` is the stated noise
    of a sample (raw); there is none in the samples.
    """
    still, turning = 300, 200
    attitude = Rotation.from_euler("xyz", [20.0, -35.0, 50.0], degrees=True)
    quaternions, rates = [attitude] * still, [np.zeros((still, 3))]
    holds, turns = [Hold(0, still)], []
    for axis, degrees in TURNS:
        size = np.radians(degrees)
        speed = size / (turning / RATE)
        # turning samples at full speed, half a trapezoid before and after them.
        angles = (np.arange(turning) + 0.5) * speed / RATE
        before = holds[-1].stop
        quaternions += list(attitude * Rotation.from_rotvec(np.outer(angles, axis)))
        rates.append(np.tile(speed * np.array(axis), (turning, 1)))
        attitude = attitude * Rotation.from_rotvec(size * np.array(axis))
        quaternions += [attitude] * still
        rates.append(np.zeros((still, 3)))
        holds.append(Hold(before + turning, before + turning + still))
        turns.append(Turn(len(holds) - 2, len(holds) - 1, before, before + turning))
    R_nb = Rotation.concatenate(quaternions)
    rate_b = np.vstack(rates)
    force_b = R_nb.inv().apply([0.0, 0.0, -GRAVITY])  # north, east, down: at rest it points up
    if earth_rate_n is not None:
        rate_b = rate_b + R_nb.inv().apply(earth_rate_n)
    own = force_b @ m_a.T
    raw_force = own + b_a + (0.0 if quadratic is None else quadratic * own**2)
    raw_rate = rate_b @ m_g.T + b_g + (0.0 if g_sens is None else force_b @ g_sens.T)
    recording = Recording(
        time=np.arange(len(R_nb)) / RATE,
        specific_force=raw_force,
        angular_rate=raw_rate,
        specific_force_unit=units[0],
        angular_rate_unit=units[1],
        rate=RATE,
    )
    floor = NoiseFloor(np.full(3, sigma[0]), np.full(3, sigma[1]), 1.0, "stated")
    timeline = Timeline(tuple(holds), tuple(turns), (), floor)
    return Scene(recording, timeline, exact_means(recording, holds, sigma))


def exact_means(recording: Recording, holds: list[Hold], sigma: tuple[float, float]) -> HoldMeans:
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    count = np.array([hold.stop - hold.start for hold in holds], dtype=float)
    blocks = [sigma[i] ** 2 / count[:, None, None] * np.eye(3) for i in range(2)]
    return HoldMeans(
        specific_force=np.array([recording.specific_force[h.start : h.stop].mean(axis=0) for h in holds]),
        specific_force_covariance=blocks[0],
        angular_rate=np.array([recording.angular_rate[h.start : h.stop].mean(axis=0) for h in holds]),
        angular_rate_covariance=blocks[1],
        duration=count / RATE,
        time=np.array([recording.time[(h.start + h.stop) // 2] for h in holds]),
        count=count,
        temperature=None,
    )


def calibrate(scene: Scene, site: Site = SITE, *, optional_terms: bool = True) -> Estimate:
    session = Session(scene.recording, None, site)
    session.means = scene.means
    return jointly(session, timeline=scene.timeline, optional_terms=optional_terms)


def triads(estimate: Estimate) -> tuple[Triad, Triad]:
    assert estimate.model.accelerometer is not None
    assert estimate.model.gyroscope is not None
    return estimate.model.accelerometer, estimate.model.gyroscope


def test_matrices_and_biases_of_a_unit_without_noise_come_back() -> None:
    """Tolerance: the adjustment stops below a thousandth of a stated sigma (1e-3 of 6e-5 m/s²)."""
    accelerometer, gyroscope = triads(calibrate(play(), optional_terms=False))
    np.testing.assert_allclose(accelerometer.matrix, M_A, atol=1e-8)
    np.testing.assert_allclose(accelerometer.bias, B_A, atol=1e-7)
    np.testing.assert_allclose(gyroscope.matrix, M_G, atol=1e-7)
    np.testing.assert_allclose(gyroscope.bias, B_G, atol=1e-9)


def test_g_sensitivity_comes_back_row_for_gyro_and_column_for_force() -> None:
    """The Earth rate is held at zero by its prior alone (4e-5 rad/s), and the data have none."""
    estimate = calibrate(play(g_sens=G_SENS))
    _, gyroscope = triads(estimate)
    assert {term.name for term in estimate.terms if term.kept} == {"g_sensitivity"}
    assert estimate.model.g_sensitivity is not None
    np.testing.assert_allclose(estimate.model.g_sensitivity, G_SENS, atol=1e-7)
    np.testing.assert_allclose(gyroscope.matrix, M_G, atol=1e-7)
    np.testing.assert_allclose(gyroscope.bias, B_G, atol=1e-8)


def test_quadratic_terms_come_back() -> None:
    quadratic = np.array([1.1e-4, -2.3e-4, 0.7e-4])
    estimate = calibrate(play(quadratic=quadratic))
    accelerometer, gyroscope = triads(estimate)
    assert {term.name for term in estimate.terms if term.kept} == {"quadratic"}
    assert accelerometer.quadratic is not None
    np.testing.assert_allclose(accelerometer.quadratic, quadratic, atol=1e-8)
    np.testing.assert_allclose(accelerometer.matrix, M_A, atol=1e-6)
    np.testing.assert_allclose(gyroscope.matrix, M_G, atol=1e-6)


def test_raw_counts_give_the_same_as_si_times_the_counts_per_unit() -> None:
    """Sizes as of a 16-bit converter with its zero in the middle, as the Xsens of imu_tk has it."""
    m_a, b_a = 414.0 * M_A, np.array([33123.0, 32871.0, 32364.0])
    m_g, b_g = 4780.0 * M_G, np.array([32770.0, 32451.0, 32509.0])
    scene = play(m_a=m_a, b_a=b_a, m_g=m_g, b_g=b_g, units=("counts", "counts"), sigma=(0.4, 0.05))
    accelerometer, gyroscope = triads(calibrate(scene, optional_terms=False))
    # As before relative to the scale, and the resolution of numbers near 33000 (4e-12 relative).
    np.testing.assert_allclose(accelerometer.matrix, m_a, atol=414 * 1e-7)
    np.testing.assert_allclose(accelerometer.bias, b_a, atol=1e-4)
    np.testing.assert_allclose(gyroscope.matrix, m_g, atol=4780 * 1e-6)
    np.testing.assert_allclose(gyroscope.bias, b_g, atol=1e-4)


@pytest.mark.parametrize("latitude_deg", [48.0, -33.0])
def test_with_a_latitude_the_earth_rate_is_told_from_g_sensitivity(latitude_deg: float) -> None:
    """A wrong sign of the Earth's rotation would come out as 2 x 5e-5 / 9.81 rad/s per m/s² (1.1e-5).

    Tolerance: the Earth's direction is a prior of 1e-3 of its rate, carried first order in the angle
    that the Earth turns during a hold (3 s x 7e-5 = 2e-4, squared 4e-8).
    """
    latitude = np.radians(latitude_deg)
    earth_rate_n = 7.292115e-5 * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    site = Site(GRAVITY, 0.0, float(latitude), 0.0, "as simulated")
    estimate = calibrate(play(g_sens=G_SENS, earth_rate_n=earth_rate_n), site)
    _, gyroscope = triads(estimate)
    assert estimate.model.g_sensitivity is not None
    np.testing.assert_allclose(estimate.model.g_sensitivity, G_SENS, atol=2e-7)
    np.testing.assert_allclose(gyroscope.matrix, M_G, atol=2e-6)
    np.testing.assert_allclose(gyroscope.bias, B_G, atol=2e-6)


def test_sigma0_is_that_of_the_model_that_was_kept() -> None:
    """Noise as stated and a g-sensitivity: what it does to the rates at rest is explained, not noise.

    Without the term the residuals would be some 30 times the stated noise. With it sigma0 is 1; with
    some 110 degrees of freedom it stays inside 0.75 to 1.25 in 999 of 1000 cases.
    """
    scene = play(g_sens=G_SENS / 10.0)
    rng = np.random.default_rng(4)
    assert scene.recording.specific_force is not None
    assert scene.recording.angular_rate is not None
    sigma = (0.02, 2e-3)
    noisy = replace(
        scene.recording,
        specific_force=scene.recording.specific_force
        + sigma[0] * rng.standard_normal((len(scene.recording), 3)),
        angular_rate=scene.recording.angular_rate + sigma[1] * rng.standard_normal((len(scene.recording), 3)),
    )
    floor = NoiseFloor(np.full(3, sigma[0]), np.full(3, sigma[1]), 1.0, "stated")
    timeline = replace(scene.timeline, noise_floor=floor)
    made = Scene(noisy, timeline, exact_means(noisy, list(timeline.holds), sigma))
    estimate = calibrate(made)
    assert [term.name for term in estimate.terms if term.kept] == ["g_sensitivity"]
    assert 0.75 < estimate.sigma0 < 1.25
    assert calibrate(made, optional_terms=False).sigma0 > 5.0
