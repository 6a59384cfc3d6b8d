"""How a wander is stood for by cosines, and what neighbouring holds and turns have in common of it."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.equations.observed import mode_count
from tumble.estimation import Drift, covariance_about_the_mean, faster_variance, shared_wander, wander_basis


def information(signal: np.ndarray, count: int, white: float) -> float:
    """What windows with white and 1/f noise, and a constant that is not known, tell of a signal's amplitude."""
    windows = signal.size
    places = (np.arange(windows) + 0.5) / windows
    modes, share = wander_basis(places, count)
    own = white + faster_variance(windows, count)
    covariance = modes @ np.diag(share) @ modes.T + own * np.eye(windows) + 1e3
    return float(signal @ np.linalg.solve(covariance, signal))


@pytest.mark.parametrize("white", [0.5, 0.01])
@pytest.mark.parametrize("phase", [0.0, 0.25, 0.1])
@pytest.mark.parametrize(("windows", "revolutions"), [(83, 4.0), (105, 5.0), (40, 1.5)])
def test_the_cosines_tell_no_more_of_what_goes_round_than_all_of_them_would(
    windows: int, revolutions: float, phase: float, white: float
) -> None:
    """A g-sensitivity shows as a sine in step with the table; as many cosines as windows are the wander itself."""
    places = (np.arange(windows) + 0.5) / windows
    signal = np.cos(2.0 * np.pi * (revolutions * places - phase))
    all_of_them = information(signal, windows - 1, white)
    told = information(signal, mode_count(windows, revolutions), white) / all_of_them
    # Three cosines a revolution without what is faster would claim ten times as much of a sine.
    assert 0.8 < told < 1.02


def test_the_variance_of_all_cosines_is_the_integral_of_the_density() -> None:
    windows, count = 64, 20
    modes, share = wander_basis((np.arange(windows) + 0.5) / windows, count)
    # of -ln |t - s|, the mean over a window and over all of the stretch differ by so much
    variance = float(np.mean(modes**2 @ share)) + faster_variance(windows, count)
    assert variance == pytest.approx(np.log(windows), rel=1e-12)


def test_a_cosine_has_the_variance_that_the_logarithm_gives_it() -> None:
    """The double integral of -4 ln |t - s| cos cos, cell by cell; a 400th is fine enough for a thousandth."""
    edges = np.linspace(0.0, 1.0, 401)
    covariance = covariance_about_the_mean(edges[:-1], edges[1:], (0.0, 1.0))
    modes, share = wander_basis(0.5 * (edges[1:] + edges[:-1]), 6)
    amplitudes = 2.0 / 400 * modes
    np.testing.assert_allclose(np.diag(amplitudes.T @ covariance @ amplitudes), share, rtol=1e-3)


def test_holds_wander_together_about_the_mean_of_a_drawn_1_over_f_noise() -> None:
    """Drawn by its spectrum: density h over f from an eighth of the recording's frequency on, 800 times.

    A variance from so many draws is known to 5 %, of which four.
    """
    rng, samples, step, density = np.random.default_rng(3), 4096, 0.05, 2.5
    edges = np.array([[0, 60], [300, 380], [1500, 1560], [1600, 1680], [3900, 4096]])
    f = np.fft.rfftfreq(8 * samples, step)[1:]
    size = np.sqrt(density * 8 * samples / (2.0 * f * step))
    means = np.zeros((800, len(edges)))
    for row in means:
        turned = np.concatenate([[0.0], size * np.exp(2j * np.pi * rng.random(f.size))])
        drawn = np.asarray(np.fft.irfft(turned)[:samples], dtype=np.float64)
        row[:] = [float(drawn[a:b].mean() - drawn.mean()) for a, b in edges.tolist()]
    expected = np.asarray(np.cov(means.T), dtype=np.float64)
    found = density * covariance_about_the_mean(step * edges[:, 0], step * edges[:, 1], (0.0, samples * step))
    sigma = np.sqrt(np.diag(expected))
    scale = np.outer(sigma, sigma)
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.2)
    # neighbours go together, the beginning and the end do not
    assert found[2, 3] > 0.4 * scale[2, 3]
    assert found[0, 4] < 0.0


def test_many_stretches_are_taken_together_and_tell_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mean over 256 stretches side by side; two at a time they are 128 that cover the same time."""
    count, span = 256, 64.0
    edges = np.linspace(8.0, 40.0, count + 1)
    by_bias = np.broadcast_to(np.eye(3) / count, (count, 3, 3))
    drift = Drift(edges[:-1], edges[1:], by_bias, np.zeros((count, 3, 3)))
    gain = np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (count, 3, 3))
    density = np.array([1.0, 2.0, 5.0])
    whole = shared_wander([(drift, gain)], density, (0.0, span))
    monkeypatch.setattr("tumble.estimation.wander.MOST_STRETCHES", 20)
    fewer = shared_wander([(drift, gain)], density, (0.0, span))
    np.testing.assert_allclose(fewer, whole, rtol=1e-9, atol=1e-15)
    assert np.diag(whole)[2] == pytest.approx(9.0 * 5.0 * np.diag(whole)[0], rel=1e-9)
