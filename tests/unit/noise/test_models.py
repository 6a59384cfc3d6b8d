"""Models of noise: closed forms that agree with one another, fits of curves, and what is stated of them.

What a short recording does not tell apart; where a model's curve misses the measured one; the N of a sensor whose
white noise is filtered before it is sampled; one number for three axes.
"""

import json
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.integrate import quad

from tumble.arrays import Series
from tumble.errors import UsageError
from tumble.export import read_noise
from tumble.noise.advice import advise
from tumble.noise.channel import Channel, characterise_channel
from tumble.noise.characterisation import Characterisation, characterise, triad_terms
from tumble.noise.deviation import allan_deviation
from tumble.noise.fitting.allan_covariance import AllanCovariance
from tumble.noise.fitting.fit import MISSED, NoiseFit, fit_curve
from tumble.noise.fitting.weighted_fit import AllanTask
from tumble.noise.terms import GaussMarkov, Line, NoiseModel
from tumble.noise.variances import LETTERS, allan_variance_of, markov_allan_variance
from tumble.noise.white_part import shortest_time, slower_part, white_beyond, white_part
from tumble.recording import Recording
from tumble.report import noise_document, noise_lines
from tumble.segmentation import mean_covariance
from tumble.workflows import read_noise_models
from unit.given import given

ALL = NoiseModel(2e-4, 0.03, 0.02, 0.005, 0.001, (GaussMarkov(0.04, 3.0),), (Line(0.05, 0.7),))
TAU = np.array([0.02, 0.1, 1.0, 7.0, 60.0, 900.0])


def test_the_five_terms_are_those_of_ieee_std_952() -> None:
    """The table of IEEE Std 952, annex C, by hand for τ = 4 s and coefficients of 3."""
    four = np.array([4.0])
    expected = {"Q": 3 * 9 / 16, "N": 9 / 4, "B": 9 * 2 * np.log(2) / np.pi, "K": 9 * 4 / 3, "R": 9 * 16 / 2}
    for letter, value in expected.items():
        assert NoiseModel.from_coefficients({letter: 3.0}).allan_variance(four)[0] == pytest.approx(value)


DENSITIES = {
    "N": lambda f: 1.0 + 0.0 * f,
    "B": lambda f: 1.0 / (2.0 * np.pi * f),
    "K": lambda f: 1.0 / (2.0 * np.pi * f) ** 2,
    "": lambda f: 5.0 / (1.0 + (5.0 * np.pi * f) ** 2),  # of a Gauss-Markov process of 2.5 s
}


@pytest.mark.parametrize("letter", DENSITIES)
def test_allan_variance_and_spectrum_are_one_another_s(letter: str) -> None:
    """σ²(τ) = 4 ∫ S(f) sin⁴(πfτ)/(πfτ)² df over positive f of the two-sided density (IEEE Std 952, C.2)."""
    size = 0.3
    markov = NoiseModel(gauss_markov=(GaussMarkov(size, 2.5),))
    model = NoiseModel.from_coefficients({letter: size}) if letter else markov
    for tau in (0.5, 4.0):

        def integrand(log_x: float, tau: float = tau) -> float:
            f = np.exp(log_x) / (np.pi * tau)
            return 4.0 * size**2 * DENSITIES[letter](f) * np.sin(np.exp(log_x)) ** 4 / np.exp(log_x) ** 2 * f

        low, _ = quad(integrand, -25.0, 2.0, limit=400)
        # above x = e²: sin⁴ averages to 3/8 within the tail's 5 %, by fine sums instead
        x = np.arange(np.exp(2.0), 3000.0, 0.02) + 0.01
        density = size**2 * DENSITIES[letter](x / (np.pi * tau))
        high = np.sum(4.0 * density * np.sin(x) ** 4 / x**2) * 0.02 / (np.pi * tau)
        # cut at x = 3000: 3/8 · 4 S / (π τ) / 3000, a 5000th of white noise's, less of others'
        assert low + high == pytest.approx(model.allan_variance(np.array([tau]))[0], rel=3e-4)


def test_the_sampled_processes_have_the_allan_variance_of_their_covariance() -> None:
    """Against the quadratic form of the second difference of block means, number by number."""
    rate, m = 20.0, 7
    contrast = np.concatenate([-np.ones(m), np.ones(m)]) / m / np.sqrt(2.0)
    i = np.arange(2 * m)
    lag, tau = np.abs(i[:, None] - i), np.array([m / rate])
    for time in (0.01, 0.4, 30.0, 1e5):
        expected = contrast @ np.exp(-lag / (rate * time)) @ contrast
        # at 1e5 s the sum itself loses seven digits
        assert markov_allan_variance(tau, time, rate)[0] == pytest.approx(expected, rel=1e-6)
    walk = np.minimum(i[:, None], i) / rate
    assert allan_variance_of("K", tau, rate)[0] == pytest.approx(contrast @ walk @ contrast, rel=1e-12)
    sine = 0.5 * np.cos(2 * np.pi * 3.1 * lag / rate)
    line = NoiseModel(lines=(Line(1.0, 3.1),))
    assert line.allan_variance(tau, rate)[0] == pytest.approx(contrast @ sine @ contrast, rel=1e-10)
    # and over long times a sampled sensor is an averaging one: 1e-4 at a hundred samples; flicker 0.2 %
    tau = np.array([2.0, 50.0])
    for letter in LETTERS:
        sampled = allan_variance_of(letter, tau, 50.0)
        np.testing.assert_allclose(sampled, allan_variance_of(letter, tau), rtol=3e-3)


@pytest.mark.parametrize("x", [1e-3, 0.05])
def test_the_branches_of_a_formula_meet(x: float) -> None:
    """Either side of where a series takes over: relative jumps no larger than the slope times the step."""
    m = np.round(np.array([0.995, 1.005]) * 2.0 * 50.0)
    for rate in (None, 50.0):
        values = markov_allan_variance(m / 50.0, 2.0 / x, rate)
        assert values[1] / values[0] == pytest.approx(m[1] / m[0], rel=1e-3)


def test_allan_variance_is_a_contrast_of_the_phase_s_covariance_and_adds_up() -> None:
    """σ² = (6 s(0) − 8 s(τ) + 2 s(2τ)) / (2 τ²), all terms but the ramp."""
    s = replace(ALL, ramp=0.0).phase_covariance
    phase = (6.0 * s(0.0 * TAU) - 8.0 * s(TAU) + 2.0 * s(2.0 * TAU)) / (2.0 * TAU**2)
    np.testing.assert_allclose(phase, replace(ALL, ramp=0.0).allan_variance(TAU), rtol=1e-7)
    parts = [part for _, part in ALL.allan_terms(TAU)]
    assert len(parts) == 7
    np.testing.assert_allclose(np.sum(parts, axis=0), ALL.allan_variance(TAU), rtol=1e-14)
    np.testing.assert_allclose(ALL.scaled(3.0).allan_variance(TAU), 9.0 * ALL.allan_variance(TAU), rtol=1e-13)


def test_the_mean_s_variance_anywhere_in_the_span_is_that_of_tiles() -> None:
    """Tiling the span with holds, the full covariance averages to the formula without places, term by term.

    Only what is taken against the span's mean tiles; N and Q have theirs in full.
    """
    span, count = 120.0, 12
    seconds, starts = np.full(count, span / count), np.arange(count) * span / count
    letters = [NoiseModel.from_coefficients({letter: 0.3}) for letter in "NQBKR"]
    slow = NoiseModel(gauss_markov=(GaussMarkov(0.3, 15.0),)), NoiseModel(lines=(Line(0.3, 0.013),))
    for model in (*letters, *slow):
        full = np.diag(model.mean_covariance(seconds, span, starts)).mean()
        assert full == pytest.approx(model.mean_covariance(seconds, span)[0, 0], rel=1e-9)
    # white noise and flicker by their known formulas
    seconds = np.array([5.0, 20.0])
    white, flicker = (np.diag(model.mean_covariance(seconds, 900.0)) for model in (letters[0], letters[2]))
    np.testing.assert_allclose(white, 0.09 / seconds)
    np.testing.assert_allclose(flicker, 0.09 / np.pi * np.log(900.0 / seconds))


def test_the_covariance_of_means_is_that_of_simulated_holds() -> None:
    """3000 sequences with all terms; each element's z below 4.5 (21 elements: a false alarm in 7,000)."""
    rng = np.random.default_rng(3)
    rate, samples = 10.0, 600
    first = np.array([0, 40, 150, 300, 450, 550])
    length = np.array([30, 50, 30, 100, 60, 50])
    model = NoiseModel(0.02, 0.05, 0.1, 0.04, 0.01, (GaussMarkov(0.1, 5.0),), (Line(0.2, 0.03),))
    off = np.empty((3000, 6))
    for k in range(len(off)):
        signal = model.simulate(samples, rate, rng)
        # white noise and lines of the span's mean belong to the difference too: hardly anything here
        means = np.array([signal[a : a + n].mean() for a, n in zip(first, length, strict=True)])
        off[k] = means - signal.mean()
    expected = model.mean_covariance(length / rate, samples / rate, first / rate)
    still = NoiseModel(0.02, 0.05, lines=model.lines)
    ends = np.append(first / rate, 0.0), np.append(length / rate, samples / rate)
    both = still.mean_covariance(ends[1], samples / rate, ends[0])
    less = np.column_stack([np.eye(6), -np.ones(6)])
    expected += less @ both @ less.T - both[:6, :6]
    products = off[:, :, None] * off[:, None, :]
    z = (products.mean(axis=0) - expected) / (products.std(axis=0) / np.sqrt(len(off)))
    assert np.max(np.abs(z)) < 4.5


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        # its floor is believed from 2.3 sigma on and grows from nothing: 35 %
        (NoiseModel(random_walk=0.005, bias_instability=0.02), 0.35),
        (NoiseModel(random_walk=0.02, gauss_markov=(GaussMarkov(0.01, 0.05),)), 0.2),
    ],
)
def test_wandering_means_are_found_by_segmentation_too(model: NoiseModel, tolerance: float) -> None:
    rng, rate, samples, hold = np.random.default_rng(6), 50.0, 60_000, 500
    items, found = [[(a, a + hold)] for a in range(0, samples, hold)], []
    for _ in range(5):
        signal = np.column_stack([model.simulate(samples, rate, rng) for _ in range(3)])
        found.append(np.diagonal(mean_covariance(signal, items).covariance, axis1=1, axis2=2).mean())
    expected = model.mean_covariance(np.array([hold / rate]), samples / rate)[0, 0]
    assert np.mean(found) == pytest.approx(expected, rel=tolerance)


def fitted(model: NoiseModel, minutes: float, rate: float, seed: int) -> NoiseFit:
    signal = model.simulate(round(60.0 * minutes * rate), rate, np.random.default_rng(seed))
    return fit_curve(allan_deviation(signal, rate, taus="octave"))


def test_what_ten_minutes_do_not_tell_apart_is_said_and_what_four_hours_tell_is_not_doubted() -> None:
    walks = NoiseModel(random_walk=0.01, rate_random_walk=8e-4)
    short, long = fitted(walks, 10.0, 100.0, 0), fitted(walks, 240.0, 10.0, 0)
    assert short.chosen == ("N", "B")  # wrong, and not known better
    assert any(text.startswith("B may really be K") for text in short.remarks)
    assert (long.chosen, long.missed) == (("N", "K"), {})
    assert not any("may be" in text for text in long.remarks)
    # white noise alone has no stand-in
    assert not fitted(NoiseModel(random_walk=0.01), 10.0, 100.0, 1).remarks


@pytest.mark.filterwarnings("error")
def test_a_ramp_alone_is_fitted_without_dividing_by_its_spread_of_nothing() -> None:
    """Its Allan deviation is R τ/√2 exactly."""
    curve = allan_deviation(1e-3 * np.arange(6000) / 10.0, 10.0, taus="octave")
    assert curve.deviation[:, 0] == pytest.approx(1e-3 * curve.tau / np.sqrt(2.0), rel=1e-9)
    found = fit_curve(curve)
    (ramp,) = found.terms
    assert ramp.value == pytest.approx(1e-3, rel=1e-6)
    assert np.isfinite([ramp.low, ramp.high]).all()
    assert np.isfinite(found.covariance).all()


HERTZ = 50.0
COUNT = 360_000
SECONDS = np.arange(COUNT) / HERTZ


def characterised(signal: Series) -> tuple[Channel, tuple[str, ...]]:
    curve = allan_deviation(signal, HERTZ, taus="octave")
    channel = characterise_channel("ax", "m/s²", curve, curve, (), 0.0)
    return channel, advise((channel,), curve)


def test_a_walk_that_ends_is_not_stated_to_five_percent_where_the_curve_falls_below_it() -> None:
    # filtered noise, of a shape that the model has not, makes the weights sharp; the walk lasts a tenth
    rng = np.random.default_rng(5)
    white = np.convolve(rng.standard_normal(COUNT) * 7e-3, np.ones(25) / 25, "same")
    walk = np.cumsum(rng.standard_normal(COUNT)) * 1e-3 / np.sqrt(HERTZ)
    channel, said = characterised(white + np.where(SECONDS < 1000.0, walk, 0.0))
    term, fit = given(channel.term("K")), given(channel.fit)
    at_1000 = int(np.argmin(np.abs(fit.tau - 1000.0)))
    missed = float(np.sqrt(fit.expected[at_1000] / fit.variance[at_1000]))
    assert missed > 2.0
    assert fit.missed["K"] > MISSED
    assert term.sigma > np.log(MISSED) * term.value
    assert term.low < term.value / MISSED**2
    assert any("misses the measured curve" in text and "K" in text for text in said)


def test_white_noise_keeps_its_uncertainty_where_only_long_times_are_missed() -> None:
    rng = np.random.default_rng(4)
    signal = 1e-3 * np.sqrt(HERTZ) * rng.standard_normal(COUNT) + 0.01 * np.sin(2.0 * np.pi * SECONDS / 600.0)
    channel, _ = characterised(signal)
    white, process = given(channel.term("N")), given(channel.term("sigma"))
    assert white.sigma < 0.1 * white.value
    assert process.sigma > process.value


RATE, TIME, WHITE = 100.0, 0.03, 1e-4
# Density 2 σ² T of the process is that of N = 1e-4; with N of its own of 3e-5 they are 1.044e-4 together.
FILTERED = NoiseModel(random_walk=3e-5, gauss_markov=(GaussMarkov(WHITE / np.sqrt(2.0 * TIME), TIME),))
TOGETHER = np.hypot(3e-5, WHITE)


@pytest.fixture(scope="module")
def noise() -> Characterisation:
    """A gyro of which y alone is filtered."""
    rng = np.random.default_rng(11)
    plain = NoiseModel(random_walk=WHITE)
    turn = np.column_stack([model.simulate(30_000, RATE, rng) for model in (plain, FILTERED, plain)])
    return characterise(Recording(np.arange(30_000) / RATE, None, turn, "m/s^2", "rad/s", RATE))


def filtered(noise: Characterisation) -> Channel:
    return next(channel for channel in noise.channels if channel.name == "gy")


def test_the_white_part_of_a_short_process_is_in_n(noise: Characterisation) -> None:
    channel = filtered(noise)
    stated = given(channel.random_walk)
    assert given(channel.white).times == pytest.approx([TIME], rel=0.3)
    assert abs(stated.value - TOGETHER) < 3.0 * stated.sigma < 0.1 * TOGETHER
    assert stated.low < TOGETHER < stated.high
    alone = channel.term("N")
    assert alone is None or alone.value < 0.6 * TOGETHER  # what was stated as N before
    others = [c for c in noise.channels if c.name != "gy"]
    assert all(c.white is None and c.random_walk == c.term("N") for c in others)


def test_a_triad_and_a_table_state_it(noise: Characterisation) -> None:
    (white,) = (term for term in triad_terms(noise.channels) if term.letter == "N")
    assert white.seen == ("gx", "gy", "gz")
    assert white.mean == pytest.approx(np.sqrt((2.0 * WHITE**2 + TOGETHER**2) / 3.0), rel=0.05)
    first, second = noise_lines((filtered(noise),), seen_only=True)[1:3]
    assert (first.split()[:5], second.split()[:3]) == (
        ["gy", "angle", "random", "walk", "N"],
        ["of", "it", "white"],
    )
    assert any("N is what it is over longer times" in sentence for sentence in noise.sentences)


def test_what_other_programs_get_holds_it_once_and_without_it_a_document_is_read_as_before(noise, tmp_path):
    path, document = tmp_path / "noise.json", noise_document(noise)
    channels = document["channels"]
    channels |= {f"a{name[1]}": channel for name, channel in channels.items()}  # a file wants both triads
    path.write_text(json.dumps(document))
    value = channels["gy"]["random_walk"]["value"]
    assert read_noise(path).gyroscope.densities[1] == value
    _, model = read_noise_models(path).channels["gy"]
    assert (model.random_walk, model.gauss_markov) == (value, ())
    for name in ("gx", "gy", "gz"):
        del channels[name]["random_walk"]
    path.write_text(json.dumps(document))
    _, model = read_noise_models(path).channels["gy"]
    assert [process.correlation_time for process in model.gauss_markov] == pytest.approx([TIME], rel=0.3)


def test_the_density_is_that_of_samples_at_instants_and_its_slope_right(noise: Characterisation) -> None:
    fit = given(filtered(noise).fit)
    (process,) = fit.model.gauss_markov
    part = given(white_part(fit))
    # the sum of the autocovariance over all lags, by brute force
    memory = np.exp(-np.arange(1, 3000) / RATE / process.correlation_time)
    density = process.sigma**2 / RATE * (1.0 + 2.0 * memory.sum())
    assert part.value**2 == pytest.approx(density + fit.model.random_walk**2, rel=1e-9)
    # one sigma more of T alone moves N by what is stated for it alone
    place = [term.letter for term in fit.terms].index("correlation time")
    only = np.zeros_like(fit.covariance)
    only[place, place] = 1e-10
    longer = replace(process, correlation_time=process.correlation_time + 1e-5)
    slope = given(white_part(replace(fit, model=replace(fit.model, gauss_markov=(longer,)))))
    stated = given(white_part(replace(fit, covariance=only)))
    assert slope.value - part.value == pytest.approx(stated.sigma, rel=1e-2)


def test_a_slower_process_is_left_apart_and_told() -> None:
    rng = np.random.default_rng(2)
    slow = NoiseModel(random_walk=0.05, gauss_markov=(GaussMarkov(0.3, 2.0),))
    octaves = allan_deviation(slow.simulate(40_000, 20.0, rng), 20.0, taus="octave")
    fit = fit_curve(octaves)
    assert white_part(fit) is None
    part = given(slower_part(fit))
    assert part.value == pytest.approx(np.hypot(0.05, 0.3 * np.sqrt(2.0 * 2.0)), rel=0.15)
    assert shortest_time(20.0) == 0.2
    assert shortest_time(1000.0) == 0.1


def test_where_no_process_makes_the_shape_the_curve_beyond_it_counts() -> None:
    """A moving mean of 8 samples of white noise is no Gauss-Markov process; over long times its N is the noise's."""
    rng = np.random.default_rng(3)
    smooth = np.convolve(rng.standard_normal(60_007) * np.sqrt(RATE), np.full(8, 0.125), "valid")
    octaves = allan_deviation(smooth, RATE, taus="octave")
    fit = fit_curve(octaves)
    assert fit.probability < 0.01
    part = given(white_beyond(fit, octaves))
    assert part.value == pytest.approx(1.0, abs=3.0 * part.sigma + 0.03)
    assert part.low < 1.0 < 1.1 * part.high


FEW_HERTZ, FEW = 10.0, 2**14
AVERAGING = tuple(2**k for k in range(12))


def task_of(model: NoiseModel, off: np.ndarray) -> AllanTask:
    """A curve of the model, its points off by factors e^off, in units of the first."""
    tau = np.array(AVERAGING) / FEW_HERTZ
    variance = model.allan_variance(tau) * np.exp(off)
    spread = AllanCovariance(AVERAGING, FEW_HERTZ, (FEW,))
    nothing = np.zeros(len(tau)), np.zeros((len(tau), len(tau)))
    return AllanTask("curve", tau, variance / variance[0], FEW_HERTZ, spread, *nothing)


def test_a_covariance_that_rounding_made_indefinite_still_has_a_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Correlations a few units in the last digits above those of a singular matrix."""
    task = task_of(NoiseModel(random_walk=0.05), np.zeros(12))
    singular = np.outer(np.arange(1.0, 13.0), np.arange(1.0, 13.0)) - 1e-12 * np.eye(12)
    monkeypatch.setattr(AllanTask, "covariance", lambda self, model: singular)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(singular)
    root = task.root(NoiseModel(random_walk=1.0), task.variance, "moments")
    assert np.all(np.isfinite(root))
    # what the matrix does know keeps its weight: along its one direction, whose variance is 650
    along = np.arange(1.0, 13.0) / np.sqrt(650.0)
    assert 1.0 / np.sum((root @ along) ** 2) == pytest.approx(650.0, rel=0.05)


def test_terms_that_cannot_make_the_curve_leave_what_was_found_first() -> None:
    """A walk alone on a curve that falls over a thousand times: finite, and not zero."""
    rng = np.random.default_rng(3)
    task = task_of(NoiseModel(quantisation=1.0), 0.3 * rng.standard_normal(12))
    solution = task.settle(("K",), ())
    assert np.isfinite(solution.misfit)
    assert solution.squares[0] > 0.0


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (UsageError("The signal is too short for a noise model."), "too short"),
        (np.linalg.LinAlgError("singular"), "averaging times enough, but the curve could not be weighed"),
    ],
)
def test_why_there_is_no_model_is_told_apart(monkeypatch, error, words):
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("tumble.noise.channel.fit_curve", refuse)
    force = 0.01 * np.random.default_rng(1).standard_normal((2000, 3)) + [0.1, 0.2, 9.8]
    found = characterise(Recording(np.arange(2000) / 50.0, force, None, "m/s^2", "rad/s", 50.0))
    assert all(channel.fit is None and words in channel.without_fit for channel in found.channels)
    [said] = [text for text in advise(found.channels, found.channels[0].allan) if "no model" in text]
    assert said.startswith("ax, ay, az: no model, the curve stands alone. ")
    assert words in said


def axis(name: str, value: float | None, sigma: float = 0.0, limit: float = 0.0) -> Channel:
    made = Mock(spec=Channel, random_walk=None, unseen={"B": limit} if value is None else {})
    made.name, made.term = name, {"B": value and Mock(value=value, sigma=sigma)}.get
    return made


def test_a_triad_s_mean_is_as_uncertain_as_its_axes_and_as_the_limit_of_one_that_does_not_show_it() -> None:
    two = axis("gx", 3.0, 0.1), axis("gy", 4.0, 0.2)
    (found,) = triad_terms([*two, axis("gz", None, limit=6.0)])
    assert found.mean == pytest.approx((25.0 / 3.0) ** 0.5)
    # squares: ± 0.6, ± 1.6 and, up to 36 at 95 %, ± 18; the mean's derivative by their sum is 1 / (6 mean)
    assert found.mean_sigma == pytest.approx((0.6**2 + 1.6**2 + 18.0**2) ** 0.5 / (6.0 * found.mean))
    assert (found.seen, found.worst_axis, found.worst_sigma) == (("gx", "gy"), "gy", 0.2)
    (found,) = triad_terms([*two, axis("gz", 12.0, 0.3)])
    assert found.mean == pytest.approx(13.0 / 3.0**0.5)
    assert found.mean_sigma == pytest.approx((0.3**2 + 0.8**2 + 3.6**2) ** 0.5 / (3.0 * found.mean))
