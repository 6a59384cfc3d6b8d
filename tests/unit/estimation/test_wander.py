"""How a wander is stood for by cosines, and what neighbouring holds and turns have in common of it."""

import numpy as np
import pytest

from tumble.estimation import Drift, covariance_about_the_mean, faster_variance, wander_basis
from tumble.estimation.wander import shared_wander


def test_the_variance_of_all_cosines_is_the_integral_of_the_density():
    windows, count = 64, 20
    modes, share = wander_basis((np.arange(windows) + 0.5) / windows, count)
    # of -ln |t - s|, the mean over a window and over all of the stretch differ by so much
    variance = float(np.mean(modes**2 @ share)) + faster_variance(windows, count)
    assert variance == pytest.approx(np.log(windows), rel=1e-12)


def test_a_cosine_has_the_variance_that_the_logarithm_gives_it():
    """The double integral of -4 ln |t - s| cos cos, cell by cell; a 400th is fine enough for a thousandth."""
    edges = np.linspace(0.0, 1.0, 401)
    covariance = covariance_about_the_mean(edges[:-1], edges[1:], (0.0, 1.0))
    modes, share = wander_basis(0.5 * (edges[1:] + edges[:-1]), 6)
    amplitudes = 2.0 / 400 * modes
    np.testing.assert_allclose(np.diag(amplitudes.T @ covariance @ amplitudes), share, rtol=1e-3)


def test_holds_wander_together_about_the_mean_of_a_drawn_1_over_f_noise():
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


def test_many_stretches_are_taken_together_and_tell_the_same():
    """A mean over the same time, however many stretches it is cut into: more than 2,000 are taken together."""

    def told(count):
        edges = np.linspace(8.0, 40.0, count + 1)
        by_bias = np.broadcast_to(np.eye(3) / count, (count, 3, 3))
        drift = Drift(edges[:-1], edges[1:], by_bias, np.zeros((count, 3, 3)))
        gain = np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (count, 3, 3))
        return shared_wander([(drift, gain)], np.array([1.0, 2.0, 5.0]), (0.0, 64.0))

    np.testing.assert_allclose(told(4096), told(256), rtol=1e-9, atol=1e-15)
    assert told(256)[2, 2] == pytest.approx(9.0 * 5.0 * told(256)[0, 0], rel=1e-9)
