"""A noise model as a linear system: what a Kalman filter needs, continuous and discrete."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.arrays import AnyArray, Series, Square
from tumble.noise.flicker import flicker_corners, flicker_variance
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.noise.terms import NoiseModel


@dataclass(frozen=True, slots=True)
class ContinuousNoise:
    """dx/dt = F x + w, signal = H x + v, with white w of density Q and white v of density R.

    Attributes
    ----------
    states : what each state is.
    F, Q : (states, states), 1/s and two-sided density, u²/s.
    H : (states,), what of each state is in the signal.
    start : (states, states) covariance at the start, u²; of a random walk zero (its start is the bias).
    white_density : R = N², u²/Hz.
    left_out : terms that no such system has, in words.
    """

    states: tuple[str, ...]
    F: Square
    Q: Square
    H: Series
    start: Square
    white_density: float
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DiscreteNoise:
    """x[i + 1] = Phi x[i] + w, signal[i] = H x[i] + v, with w of covariance Q and v of variance R.

    Attributes
    ----------
    states : what each state is.
    Phi, Q : (states, states), Q in u².
    H : (states,), what of each state is in the signal.
    start : (states, states) covariance at the first sample, u².
    white_variance : R = N²/interval, u², of each sample.
    interval : s between samples.
    """

    states: tuple[str, ...]
    Phi: Square
    Q: Square
    H: Series
    start: Square
    white_variance: float
    interval: float


def continuous_noise(model: NoiseModel, *, span: float, fastest: float, ratio: float) -> ContinuousNoise:
    """Return the system of a model; parameters as in `NoiseModel.discrete`, flicker up to `fastest`, Hz.

    Quantisation is left out: it is an error of the signal's integral, of variance Q², and of no density.
    """
    states: list[str] = []
    blocks: list[tuple[AnyArray, AnyArray, Series, AnyArray]] = []
    for name, sigma, correlation_time in _markov_states(model, span, fastest, ratio):
        states.append(name)
        density = 2.0 * sigma**2 / correlation_time
        one = np.ones((1, 1))
        blocks.append((-one / correlation_time, density * one, np.ones(1), sigma**2 * one))
    if model.rate_random_walk > 0.0:
        states.append("rate random walk")
        blocks.append(
            (np.zeros((1, 1)), np.full((1, 1), model.rate_random_walk**2), np.ones(1), np.zeros((1, 1)))
        )
    if model.ramp > 0.0:
        states += ["ramp", "slope of the ramp"]
        blocks.append(
            (
                np.array([[0.0, 1.0], [0.0, 0.0]]),
                np.zeros((2, 2)),
                np.array([1.0, 0.0]),
                np.diag([0.0, model.ramp**2]),
            )
        )
    for line in model.lines:
        turn = 2.0 * np.pi * line.frequency
        states += [f"line at {line.frequency:g} Hz", f"its quadrature at {line.frequency:g} Hz"]
        blocks.append(
            (
                np.array([[0.0, turn], [-turn, 0.0]]),
                np.zeros((2, 2)),
                np.array([1.0, 0.0]),
                0.5 * line.amplitude**2 * np.eye(2),
            )
        )
    left_out = ("quantisation",) if model.quantisation > 0.0 else ()
    F, Q, start = (_diagonal([block[k] for block in blocks]) for k in (0, 1, 3))
    H = np.concatenate([np.zeros(0), *(block[2] for block in blocks)])
    return ContinuousNoise(tuple(states), F, Q, H, start, model.random_walk**2, left_out)


def discrete_noise(model: NoiseModel, interval: float, *, span: float, ratio: float) -> DiscreteNoise:
    """Return the recursion of a model; parameters as in `NoiseModel.discrete`.

    Every part is the closed solution of the continuous system over the interval. Quantisation takes two
    states, the rounding of the integral now and before.
    """
    system = continuous_noise(model, span=span, fastest=0.5 / interval, ratio=ratio)
    transition, noise = _sampled(system, interval)
    states, output, start = system.states, system.H, system.start
    if model.quantisation > 0.0:
        states += ("rounding of the integral", "rounding before")
        transition = _diagonal([transition, np.array([[0.0, 0.0], [1.0, 0.0]])])
        noise = _diagonal([noise, np.diag([model.quantisation**2, 0.0])])
        start = _diagonal([start, model.quantisation**2 * np.eye(2)])
        output = np.concatenate([output, np.array([1.0, -1.0]) / interval])
    white = model.random_walk**2 / interval
    return DiscreteNoise(states, transition, noise, output, start, white, interval)


def _markov_states(
    model: NoiseModel, span: float, fastest: float, ratio: float
) -> list[tuple[str, float, float]]:
    """Name, standard deviation and correlation time of each Gauss-Markov state."""
    found = [
        (f"Gauss-Markov, {g.correlation_time:g} s", g.sigma, g.correlation_time) for g in model.gauss_markov
    ]
    if model.bias_instability > 0.0:
        sigma = model.bias_instability * float(np.sqrt(flicker_variance(ratio)))
        times = [float(0.5 / (np.pi * corner)) for corner in flicker_corners(span, fastest, ratio)]
        found += [(f"flicker, {time:.3g} s", sigma, time) for time in times]
    return found


def _sampled(system: ContinuousNoise, interval: float) -> tuple[Square, Square]:
    """Transition and its noise over an interval, from the closed solution of each block."""
    F = system.F
    rates = -np.diag(F)
    # blocks of two: a slope, or a turn
    pair = np.triu(F, 1)
    Phi = np.diag(np.exp(-rates * interval))
    for i, j in np.argwhere(pair != 0.0):
        turn = F[i, j] if F[j, i] != 0.0 else 0.0
        if turn:
            c, s = np.cos(turn * interval), np.sin(turn * interval)
            Phi[np.ix_([i, j], [i, j])] = [[c, s], [-s, c]]
        else:
            Phi[i, j] = F[i, j] * interval
    density = np.diag(system.Q)
    twice = 2.0 * rates * interval
    gathered = np.where(twice > 0.0, -np.expm1(-twice) / np.where(twice > 0.0, twice, 1.0), 1.0)
    return Phi, np.diag(density * interval * gathered)


def _diagonal(blocks: list[AnyArray]) -> Square:
    """The blocks along the diagonal of one matrix."""
    size = sum(len(block) for block in blocks)
    matrix = np.zeros((size, size))
    at = 0
    for block in blocks:
        matrix[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return matrix
