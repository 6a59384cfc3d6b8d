"""How a wander over a table's rotation is stood for by a few cosines."""

from __future__ import annotations

import numpy as np
import pytest

from tumble.calibration.joint_wander import faster_variance, mode_count, wander_basis


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
    # a cosine's mean square is a half; from half a half-period to the last window: ln(64 / 0.5)
    variance = float(np.mean(modes**2 @ share)) + faster_variance(windows, count)
    assert variance == pytest.approx(np.log(windows / 0.5), rel=1e-12)
