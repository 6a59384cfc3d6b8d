"""Figures 5.5 to 5.8 of Hayal (2010): the standard deviations of tables 5.5 to 5.7 as pictures, and what they show.

The pictures' numbers are those of the tables. What is judged here is what only a picture tells: how far the
scenarios lie apart, and how the errors grow with the length of an outage.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Curve, Marks, Outcome, Plot, Row
from tumble_papers.hayal.field_campaign import (
    GAPS,
    OUTAGES,
    SLIDING,
    SUB_SCENARIOS,
    Case,
    Found,
    Positions,
)
from tumble_papers.hayal.positions import (
    RANGE,
    SOURCE,
    TABLES,
    printed_outages,
    scenario_positions,
    sub_scenario_positions,
)
from tumble_papers.hayal.scenarios import MINUTES, SCENARIOS
from tumble_papers.published import hayal

_MINUTES = np.array(MINUTES, dtype=float)
_LENGTHS = np.array(OUTAGES)
_GYROS = (3, 9)


def reproduce_scenario_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 5.5 (HG1700) or 5.6 (HG1900) anew: scenarios 1 to 4 after outages of 2 s.

    Parameters
    ----------
    figure : "5.5" or "5.6".
    repetitions, seed : how many campaigns, from what.
    """
    found = scenario_positions(figure, repetitions, seed)
    printed = hayal()["position_tables"][figure]
    said = {
        gyro: np.array(
            [
                [row["minutes"][str(m)]["sigma"] for m in MINUTES]
                for row in printed["rows"]
                if row["gyro_parameters"] == gyro
            ]
        )
        for gyro in _GYROS
    }
    rows = [_spread_row(gyro, said[gyro], _by_scenario(found, gyro)) for gyro in _GYROS]
    rows.append(_nine_row(said, found))
    plots = [_scenario_plot(figure, gyro, said[gyro], found) for gyro in _GYROS]
    return Outcome(
        f"hayal-figure-{figure}",
        f"Figure {figure}: position errors after outages of 2 s by scenario, {TABLES[figure]}",
        SOURCE,
        ("thesis", "ours: median", "lowest", "highest"),
        rows,
        _criterion(repetitions),
        plots,
        repetitions=repetitions,
        seed=seed,
    )


def _criterion(campaigns: int) -> str:
    if campaigns < RANGE:
        return f"judged from {RANGE} campaigns on"
    return f"inside: the thesis' number lies between the lowest and the highest of {campaigns} simulated campaigns"


def _by_scenario(found: Found, gyro: int) -> AnyArray:
    """Return (campaigns, scenarios, minutes) m."""
    return np.stack(
        [
            np.stack(
                [found[Case(s, m, gyro)].sigmas[GAPS][:, 0] for m in MINUTES],
                axis=1,
            )
            for s in SCENARIOS
        ],
        axis=1,
    )


def _spread_row(gyro: int, said: AnyArray, ours: AnyArray) -> Row:
    flat = ours.reshape(len(ours), -1)
    apart: Series = np.nanmax(flat, axis=1) / np.nanmin(flat, axis=1)
    label = f"gyros {gyro} par.: largest σ over the smallest, all scenarios and minutes"
    return _row(
        label,
        float(said.max() / said.min()),
        apart,
        "the thesis' scenarios lie {} apart than ours",
        ("farther", "less far"),
    )


def _nine_row(said: dict[int, AnyArray], found: Found) -> Row:
    """In how many of the twelve cells nine gyro parameters give the better position."""
    three, nine = (_by_scenario(found, gyro) for gyro in _GYROS)
    better = np.sum(np.where(np.isfinite(nine), nine, np.inf) < three, axis=(1, 2)).astype(float)
    count = float(np.sum(said[9] < said[3]))
    return _row(
        "cells of 12 in which nine gyro parameters are better than three",
        count,
        better,
        "{} than in ours",
        ("more", "fewer"),
    )


def _row(
    label: str, said: float, ours: Series, words: str, either: tuple[str, str], campaigns: int | None = None
) -> Row:
    """The thesis' number beside ours, of which a campaign may have several."""
    cells = (said, float(np.median(ours)), float(ours.min()), float(ours.max()))
    if (len(ours) if campaigns is None else campaigns) < RANGE:
        return Row(label, "", cells, UNJUDGED, f"fewer than {RANGE} campaigns have no range")
    if cells[2] <= said <= cells[3]:
        return Row(label, "", cells, INSIDE)
    return Row(label, "", cells, OUTSIDE, words.format(either[0] if said > cells[3] else either[1]))


def _curve(name: str, x: Series, sigmas: AnyArray) -> Curve:
    """The median with the lowest and the highest of the campaigns: a few that are lost make every mean."""
    there = np.isfinite(sigmas).any(axis=0)
    middle, low, high = (
        np.where(there, function(np.where(there, sigmas, 1.0), axis=0), np.nan)
        for function in (np.nanmedian, np.nanmin, np.nanmax)
    )
    return Curve(name, x, np.asarray(middle), np.asarray(low), np.asarray(high))


def _scenario_plot(figure: str, gyro: int, said: AnyArray, found: Found) -> Plot:
    ours = _by_scenario(found, gyro)
    curves = tuple(_curve(f"sc. {s}", _MINUTES, ours[:, k]) for k, s in enumerate(SCENARIOS))
    marks = Marks(f"thesis, table {figure}", np.tile(_MINUTES, len(said)), said.ravel())
    return Plot(
        f"gyros-{gyro}",
        f"{TABLES[figure]}, 2 s, gyros {gyro} par.",
        "minutes of each pose",
        "σ of the position / m",
        curves,
        marks,
        line="median",
        band="all campaigns",
    )


def reproduce_outage_figure(figure: str, repetitions: int, seed: int) -> Outcome:
    """Make figure 5.7 (HG1700) or 5.8 (HG1900) anew: parts of scenario 3 after outages of 2 to 60 s.

    Parameters
    ----------
    figure : "5.7" or "5.8".
    repetitions, seed : how many campaigns, from what.
    """
    imu = {"5.7": "HG1700", "5.8": "HG1900"}[figure]
    found = sub_scenario_positions(imu, repetitions, seed, wandering=False)
    printed = printed_outages(imu)
    said = np.array([[cell["sigma"] for cell in printed[f"{length:g}"]] for length in OUTAGES])
    rows = [
        _growth_row(name, at, said[:, k], found[case])
        for k, (name, case) in enumerate(SUB_SCENARIOS.items())
        for at in range(len(OUTAGES) - 1)
    ]
    plots = [_outage_plot(imu, protocol, said, found) for protocol in (GAPS, SLIDING)]
    return Outcome(
        f"hayal-figure-{figure}",
        f"Figure {figure}: position errors by the length of the outage, {imu}",
        SOURCE,
        ("thesis", "ours: median", "lowest", "highest"),
        rows,
        f"{_criterion(repetitions)}, with gaps or each outage by itself",
        plots,
        [_EXPONENTS],
        repetitions,
        seed,
    )


_EXPONENTS = (
    "The exponent p of σ ~ tᵖ between two lengths. It is 1 of an error of velocity, 2 of a constant "
    "error of the accelerometers or of the tilt. It is 3 of a constant error of the gyros from a "
    "start that is known, 1.5 and 2.5 of their white noise. More is a filter that is worse after "
    "every longer gap."
)


def _growth_row(name: str, at: int, said: Series, ours: Positions) -> Row:
    ratio = np.log(_LENGTHS[at + 1] / _LENGTHS[at])
    exponents = [
        np.log(ours.sigmas[protocol][:, at + 1] / ours.sigmas[protocol][:, at]) / ratio
        for protocol in (GAPS, SLIDING)
    ]
    both = np.concatenate(exponents)
    growth = float(np.log(said[at + 1] / said[at]) / ratio)
    label = f"{name}: exponent from {_LENGTHS[at]:g} to {_LENGTHS[at + 1]:g} s"
    whole = np.isfinite(np.stack(exponents)).any(axis=0)
    return _row(
        label,
        growth,
        both[np.isfinite(both)],
        "it grows {} than ours",
        ("faster", "more slowly"),
        int(whole.sum()),
    )


def _outage_plot(imu: str, protocol: str, said: AnyArray, found: Found) -> Plot:
    curves = tuple(
        _curve(name, _LENGTHS, found[case].sigmas[protocol]) for name, case in SUB_SCENARIOS.items()
    )
    words = "gaps with one position between" if protocol == GAPS else "each outage by itself"
    marks = Marks("thesis, table 5.7", np.repeat(_LENGTHS, said.shape[1]), said.ravel())
    return Plot(
        protocol,
        f"{imu}, {words}",
        "outage / s",
        "σ of the position / m",
        curves,
        marks,
        line="median",
        band="all campaigns",
    )
