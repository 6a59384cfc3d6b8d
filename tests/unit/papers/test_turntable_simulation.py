"""The simulated unit on a table: sample by sample against a slow one, and by its statistics against both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tumble.earth.site import EARTH_RATE
from tumble_papers.zhang.pose_sets import LEFT_OUT, NINE
from tumble_papers.zhang.tables import scatter_factors
from tumble_papers.zhang.turntable import (
    CHOICES,
    GRAVITY,
    ORIENTATIONS,
    Setting,
    evaluate,
    in_paper_units,
    norths,
    simulate,
    table_setting,
)

# x, y, z; and a rate that is no divisor of the sampling rate.
FAST = {"dwell": 2.0, "duration": 36.0, "lever_arm": (0.05, -0.02, 0.03)}


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))


def exact(setting: Setting) -> Setting:
    quiet = replace(setting, force_noise=0.0, rate_noise=0.0, perturbation=0.0)
    return replace(quiet, angle_error=0.0, placement=0.0)


def test_the_nine_have_one_edge_in_each_plane_and_the_rest_are_the_others() -> None:
    assert sorted({*NINE, *LEFT_OUT}) == list(range(1, 19))
    edges = [ORIENTATIONS[n - 1] for n in NINE if np.count_nonzero(ORIENTATIONS[n - 1]) == 2]
    assert sorted(int(np.flatnonzero(edge == 0.0)[0]) for edge in edges) == [0, 1, 2]
    assert all(np.count_nonzero(ORIENTATIONS[n - 1]) == 2 for n in LEFT_OUT)
    assert len({tuple(o) for o in ORIENTATIONS}) == 18


def test_north_is_across_up_and_where_the_shortest_way_takes_it() -> None:
    found = norths(ORIENTATIONS)
    np.testing.assert_allclose(np.sum(found * ORIENTATIONS, axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-14)
    for up, north in zip(ORIENTATIONS, found, strict=True):
        across = np.cross([0.0, 0.0, 1.0], up)
        if np.linalg.norm(across) == 0.0:
            continue
        shortest = Rotation.from_rotvec(
            across / np.linalg.norm(across) * np.arccos(np.clip(up[2], -1.0, 1.0))
        )
        np.testing.assert_allclose(shortest.apply([1.0, 0.0, 0.0]), north, atol=1e-14)


def played_slowly(setting: Setting, axis: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the gyros' integral and the accelerometers' scatter of a rotation, a rotation matrix a sample.

    p turns about its axis, which points north and is level; the earth below it is north, west, up.
    """
    unit, count = setting.unit, round(setting.duration * setting.sampling)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    up = across / np.linalg.norm(across)
    C_pn = np.column_stack([axis, np.cross(up, axis), up])  # at the beginning
    earth = EARTH_RATE * np.array([np.cos(setting.latitude), 0.0, np.sin(setting.latitude)])
    rate = sign * setting.rate * axis
    readings: list[np.ndarray] = []
    for k in range(count):
        turned = Rotation.from_rotvec((k + 0.5) / setting.sampling * rate).as_matrix()
        # A vector that is fixed in n is seen from p turned back.
        C_pn_now = turned.T @ C_pn
        lever = np.array(setting.lever_arm)
        force = GRAVITY * C_pn_now[:, 2] + np.cross(rate, np.cross(rate, lever))
        speed = rate + C_pn_now @ earth
        readings.append(
            np.concatenate(
                [
                    unit.force_matrix @ force + unit.force_bias,
                    unit.rate_matrix @ unit.rotation @ speed + unit.rate_bias,
                ]
            )
        )
    raw = np.array(readings)
    return raw[:, 3:].sum(axis=0) / setting.sampling, np.cov(raw[:, :3].T, bias=True)


@pytest.mark.parametrize(("sampled", "duration"), [(True, 36.0), (False, 36.0), (True, 11.0)])
def test_a_rotation_is_that_of_rotation_matrices(sampled: bool, duration: float) -> None:
    """Over whole turns, and over 110°, in which the Earth rate and the way round do not average out."""
    setting = replace(exact(table_setting("2")), **{**FAST, "duration": duration}, sampling=20.0)
    found = simulate(setting, 1, generator(0), sampled=sampled)
    for r, axis in enumerate(setting.axes):
        plus, minus = (played_slowly(setting, axis, sign) for sign in (1.0, -1.0))
        # 1e9 counts·s summed over 720 samples: twelve digits
        np.testing.assert_allclose(found.rotation[0, r], plus[0] - minus[0], rtol=0.0, atol=1e-3)
        # 1e6 counts²
        np.testing.assert_allclose(found.scatter[0, r], 0.5 * (plus[1] + minus[1]), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.angle, 2.0 * setting.rate * setting.duration)


def test_statistics_of_part_of_a_turn_are_refused() -> None:
    setting = replace(table_setting("2"), duration=11.0)
    with pytest.raises(ValueError, match="whole turns"):
        simulate(setting, 1, generator(0), sampled=False)


def test_readings_at_rest_have_gravity_the_earth_rate_and_the_latitude() -> None:
    setting = exact(table_setting("2"))
    still = simulate(setting, 1, generator(0), sampled=False)
    unit = setting.unit
    force = np.linalg.solve(unit.force_matrix, (still.force[0] - unit.force_bias).T).T
    rate = np.linalg.solve(unit.rate_matrix @ unit.rotation, (still.rate[0] - unit.rate_bias).T).T
    np.testing.assert_allclose(force, GRAVITY * setting.up, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rate, axis=1), EARTH_RATE, rtol=1e-9)
    np.testing.assert_allclose(
        np.sum(rate * setting.up, axis=1), EARTH_RATE * np.sin(setting.latitude), rtol=1e-9
    )


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize("choice", CHOICES)
def test_without_noise_all_parameters_come_back(sampled: bool, choice: str) -> None:
    """All 21 are different and of both signs: a transpose or a swapped sign would be hundreds of arcseconds."""
    setting = replace(exact(table_setting("2")), **FAST)
    estimates = evaluate(simulate(setting, 1, generator(0), sampled=sampled))
    off = in_paper_units(estimates.parameters(choice), setting.unit.parameters())
    # The paper prints 1e-4 °/h, 0.01 ppm, µg and ″.
    assert np.max(np.abs(off)) < 1e-6


def test_the_true_parameters_are_those_of_the_table() -> None:
    found = table_setting("2").unit.parameters()
    second = np.degrees(3600.0 * found)
    np.testing.assert_allclose(found[:3], 100.0)
    np.testing.assert_allclose(second[3:6], [-180.0, 60.0, 330.0])
    np.testing.assert_allclose(found[6:9] / 9.8e-6, [612.24, -2040.82, -1020.41])
    np.testing.assert_allclose(second[12:15], [300.0, -360.0, 48.0])
    np.testing.assert_allclose(np.degrees(3600.0 * found[15:18]), [0.12, -0.20, 0.05])
    np.testing.assert_allclose(second[18:], [-600.0, 120.0, -420.0])


def test_runs_do_not_depend_on_their_number_nor_on_the_threads() -> None:
    setting = replace(table_setting("3"), **FAST)
    few, many = simulate(setting, 2, generator(5), threads=1), simulate(setting, 5, generator(5), threads=3)
    for name in ("force", "rate", "rotation", "scatter"):
        np.testing.assert_array_equal(getattr(few, name), getattr(many, name)[:2])
    other = simulate(setting, 2, generator(6))
    assert not np.array_equal(few.force, other.force)


def test_the_noise_of_samples_is_what_it_is_said_to_be() -> None:
    setting = replace(table_setting("3"), **FAST, placement=0.0, angle_error=0.0, perturbation=0.05)
    found, true = simulate(setting, 400, generator(7)), simulate(exact(setting), 1, generator(7))
    for means, sigma in (("force", setting.sigma[:3]), ("rate", setting.sigma[3:])):
        noise = getattr(found, means) - getattr(true, means)
        expected = sigma / np.sqrt(setting.dwell * setting.sampling)
        # 3,600 numbers an axis know it to 1.2 %
        np.testing.assert_allclose(noise.std(axis=(0, 1)), expected, rtol=0.06)
    turned = (found.rotation - true.rotation).std(axis=(0, 1))
    expected = setting.sigma[3:] * np.sqrt(2.0 * setting.duration / setting.sampling)
    np.testing.assert_allclose(turned, expected, rtol=0.08)
    # Along the axis of a rotation there is no signal: only the noise, less one sample's share.
    inverse = np.linalg.inv(setting.unit.force_matrix)
    along = np.einsum("ri,nrij,rj->nr", setting.axes @ inverse, found.scatter, setting.axes @ inverse)
    count = setting.duration * setting.sampling
    # 500 µg/√Hz at 100 Hz, and the perturbed acceleration of 0.05 m/s²
    expected = ((500e-6 * 9.8 * 10.0) ** 2 + 0.05**2) * (1.0 - 1.0 / count)
    # misalignments of 330″ make products of 2e-3; the samples are 17 millions
    np.testing.assert_allclose(along.mean(axis=0), expected, rtol=5e-3)


def test_table_errors_are_in_angles_and_attitudes() -> None:
    quiet = exact(table_setting("3"))
    setting = replace(quiet, angle_error=2e-5, placement=3e-5, dwell=1.0)
    found = simulate(setting, 2000, generator(8), sampled=False)
    true = simulate(quiet, 1, generator(8), sampled=False)
    # The x gyro sees the angle about x; the difference of two directions has the root of two of an error.
    angle = (found.rotation - true.rotation)[:, 0, 0] / setting.unit.rate_matrix[0, 0]
    assert angle.std() == pytest.approx(np.sqrt(2.0) * 2e-5, rel=0.08)
    # With z up, x sees a tilt about y.
    tilt = (found.force - true.force)[:, 8, 0] / setting.unit.force_matrix[0, 0] / GRAVITY
    assert tilt.std() == pytest.approx(3e-5, rel=0.08)


def test_samples_and_statistics_scatter_alike() -> None:
    """Standard deviations of 400 runs each, in 21 parameters and by every choice of axes."""
    setting = replace(table_setting("3"), dwell=20.0, duration=36.0)
    truth = setting.unit.parameters()
    one, other = (
        evaluate(simulate(setting, 400, generator(seed), sampled=sampled))
        for seed, sampled in ((1, True), (2, False))
    )
    # F of 399 and 399 degrees of freedom: 99.9 % of ratios are within 0.85 to 1.18; some 30 ratios here
    for choice in CHOICES:
        sigma = [in_paper_units(e.parameters(choice), truth).std(axis=0, ddof=1) for e in (one, other)]
        assert np.all(np.abs(np.log(sigma[0] / sigma[1])) < 0.18)
    # and the scatter matrices have the same mean, within five of its standard deviations
    scatter = [simulate(setting, 400, generator(s), sampled=f).scatter for s, f in ((3, True), (4, False))]
    spread = np.sqrt(sum(s.var(axis=0) for s in scatter) / 400)
    assert np.all(np.abs(scatter[0].mean(axis=0) - scatter[1].mean(axis=0)) < 5.0 * spread)
    # with the same spread from run to run: of 36 variances the largest ratio is beyond 1.6 in no study
    ratio = scatter[0].var(axis=0) / scatter[1].var(axis=0)
    assert np.all((ratio > 0.6) & (ratio < 1.0 / 0.6))


def test_a_scatter_of_as_many_runs_lies_around_ours() -> None:
    low, high = scatter_factors(500)
    assert low == pytest.approx(1.0 / high, rel=1e-9)
    # two standard deviations of 500 runs differ by 4.5 %: 3.29 of it
    assert high == pytest.approx(1.0 + 3.29 * 0.045, abs=0.02)
    assert scatter_factors(20)[1] > 1.5
