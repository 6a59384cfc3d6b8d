"""N of a sensor whose white noise is filtered before it is sampled: what a filter is to be given."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tumble.export.noise import read_noise
from tumble.noise.characterisation import Channel, Characterisation, characterise
from tumble.noise.deviation import allan_deviation
from tumble.noise.terms import GaussMarkov, NoiseModel
from tumble.noise.triads import triad_terms
from tumble.noise.white_part import shortest_time, slower_part, white_beyond, white_part
from tumble.recording import Recording
from tumble.report.noise import noise_rows
from tumble.report.noise_document import noise_document
from tumble.workflows.noise import read_noise_models

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
    assert channel.white is not None
    assert channel.random_walk is not None
    assert channel.white.times == pytest.approx([TIME], rel=0.3)
    assert abs(channel.random_walk.value - TOGETHER) < 3.0 * channel.random_walk.sigma < 0.1 * TOGETHER
    assert channel.random_walk.low < TOGETHER < channel.random_walk.high
    alone = channel.term("N")
    assert alone is None or alone.value < 0.6 * TOGETHER  # what was stated as N before
    others = [c for c in noise.channels if c.name != "gy"]
    assert all(c.white is None and c.random_walk == c.term("N") for c in others)


def test_a_triad_and_a_table_state_it(noise: Characterisation) -> None:
    gyros = [channel for channel in noise.channels if channel.is_gyro]
    (white,) = (term for term in triad_terms(gyros) if term.letter == "N")
    assert white.seen == ("gx", "gy", "gz")
    assert white.mean == pytest.approx(np.sqrt((2.0 * WHITE**2 + TOGETHER**2) / 3.0), rel=0.05)
    first, second = noise_rows(filtered(noise))[:2]
    assert first.letter == "N"
    assert first.name == "angle random walk"
    assert first.seen
    assert second.name == "of it white from sample to sample"
    assert any("N is what it is over longer times" in sentence for sentence in noise.sentences)


def test_what_other_programs_get_holds_it_once(noise: Characterisation, tmp_path: Path) -> None:
    path = tmp_path / "noise.json"
    document = noise_document(noise)
    channels = document["channels"]
    channels |= {
        name.replace("g", "a"): channel for name, channel in channels.items()
    }  # a file wants both triads
    path.write_text(json.dumps(document))
    value = channels["gy"]["random_walk"]["value"]
    assert read_noise(path).gyroscope.densities[1] == value
    _, model = read_noise_models(path).channels["gy"]
    assert model.random_walk == value
    assert not model.gauss_markov


def test_a_document_that_lacks_it_is_read_as_before(noise: Characterisation, tmp_path: Path) -> None:
    path = tmp_path / "noise.json"
    document = noise_document(noise)
    for channel in document["channels"].values():
        del channel["random_walk"]
    path.write_text(json.dumps(document))
    _, model = read_noise_models(path).channels["gy"]
    assert [process.correlation_time for process in model.gauss_markov] == pytest.approx([TIME], rel=0.3)


def test_the_density_is_that_of_samples_at_instants_and_its_slope_right(noise: Characterisation) -> None:
    fit = filtered(noise).fit
    assert fit is not None
    (process,) = fit.model.gauss_markov
    part = white_part(fit)
    assert part is not None
    # the sum of the autocovariance over all lags, by brute force
    lags = np.arange(1, 3000) / RATE
    memory = np.exp(-lags / process.correlation_time)
    density = process.sigma**2 / RATE * (1.0 + 2.0 * memory.sum())
    assert part.value**2 == pytest.approx(density + fit.model.random_walk**2, rel=1e-9)
    # one sigma more of T alone moves N by what is stated for it alone
    names = [term.letter for term in fit.terms]
    place = names.index("correlation time")
    only = np.zeros_like(fit.covariance)
    only[place, place] = 1e-10
    moved = replace(
        fit,
        model=replace(
            fit.model,
            gauss_markov=(replace(process, correlation_time=process.correlation_time + 1e-5),),
        ),
    )
    slope = white_part(moved)
    stated = white_part(replace(fit, covariance=only))
    assert slope is not None
    assert stated is not None
    assert slope.value - part.value == pytest.approx(stated.sigma, rel=1e-2)


def test_a_slower_process_is_left_apart_and_told() -> None:
    rng = np.random.default_rng(2)
    slow = NoiseModel(random_walk=0.05, gauss_markov=(GaussMarkov(0.3, 2.0),))
    octaves = allan_deviation(slow.simulate(40_000, 20.0, rng), 20.0, taus="octave")
    from tumble.noise.fitting.fit import fit_curve

    fit = fit_curve(octaves)
    assert white_part(fit) is None
    part = slower_part(fit)
    assert part is not None
    assert part.value == pytest.approx(np.hypot(0.05, 0.3 * np.sqrt(2.0 * 2.0)), rel=0.15)
    assert shortest_time(20.0) == 0.2
    assert shortest_time(1000.0) == 0.1


def test_where_no_process_makes_the_shape_the_curve_beyond_it_counts() -> None:
    """A moving mean of 8 samples of white noise is no Gauss-Markov process; over long times its N is the noise's."""
    rng = np.random.default_rng(3)
    smooth = np.convolve(rng.standard_normal(60_007) * np.sqrt(RATE), np.full(8, 0.125), "valid")
    octaves = allan_deviation(smooth, RATE, taus="octave")
    from tumble.noise.fitting.fit import fit_curve

    fit = fit_curve(octaves)
    assert fit.probability < 0.01
    part = white_beyond(fit, octaves)
    assert part is not None
    assert part.value == pytest.approx(1.0, abs=3.0 * part.sigma + 0.03)
    assert part.low < 1.0 < 1.1 * part.high
