"""A planned test: what it will be worth, beside the papers' schemes, with maps of the sphere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.report.figures.sphere_map import draw_scale, draw_sphere_map, force_sigmas
from tumble.report.html import render_page
from tumble.report.page import Block, Drawing, Drawings, Facts, Footer, Page, Sentences, Table, section

if TYPE_CHECKING:
    from tumble.design.pose_plan import PosePlan

# A scheme that is worse than this many times the plan is drawn as dark as can be.
_DARKEST = 2.5
_SPHERE = (
    "Every direction that can point up, on two half spheres (equal areas). Points are the poses, "
    "numbered in their order. The shade is the standard uncertainty of the corrected specific force "
    "in that direction, from the noise of the test alone. The lighter the better."
)
_FILES = (
    "protocol.yaml beside this page is the test for tumble simulate and tumble calibrate, sheet.html the operator's "
    "sheet to print, plan.json everything as numbers."
)


def render_plan(
    *,
    title: str,
    facts: Sequence[tuple[str, str]],
    parameters: Sequence[Sequence[str]],
    plan: PosePlan,
    names: Sequence[str],
    others: Sequence[PosePlan],
    schemes: tuple[Sequence[str], Sequence[Sequence[str]]],
    sentences: Sequence[str],
) -> str:
    """Return the page as HTML; it works offline and runs nothing.

    Parameters
    ----------
    title : plain text.
    facts : what the plan was made for.
    parameters : rows of name, standard uncertainty, unit and what is without gravity's.
    plan : what was found; `names` of its poses.
    others : schemes to draw beside it.
    schemes : heads and rows of the comparison; the first row is the plan.
    sentences : remarks.
    """
    worth = Table(
        ("parameter", "standard uncertainty", "unit", "of noise alone"), parameters, right=(1, 2, 3)
    )
    heads, rows = schemes
    compared = Table(heads, rows, {0: "chosen"}, right=range(1, len(heads)))
    poses = Table(("", "pose", "x, y, z of up", "rest"), _poses(plan, names))
    blocks: list[Block] = [
        Facts(facts),
        *section("What it will be worth", worth),
        *section("Beside other schemes in the same time", compared),
        *section("On the sphere", Sentences([_SPHERE], "notes"), _maps(plan, others)),
        *section("Poses in order", poses),
        *section("Remarks", Sentences(sentences)),
        Footer(_FILES),
    ]
    return render_page(Page(title, blocks))


def _maps(plan: PosePlan, others: Sequence[PosePlan]) -> Block:
    from tumble.design.candidates import sphere_grid

    grid = sphere_grid(600)[26:]
    known = [one for one in (plan, *others) if float(np.max(np.diag(one.covariance))) < 0.1]
    if not known:
        return Sentences(["Not every parameter is determined, so that no direction is."], "notes")
    top = _rounded(_DARKEST * float(np.max(force_sigmas(known[0].covariance, grid))))
    drawn: list[Drawing] = []
    for one in known:
        values = force_sigmas(one.covariance, grid)
        words = (
            f"{one.name}, {len(one.dwells)} poses: {1e6 * float(np.sqrt(np.mean(values**2))):.3g} µg on the average, "
            f"{1e6 * float(values.max()):.3g} µg at worst"
        )
        labels = [str(number) for number in range(1, len(one.dwells) + 1)]
        picture = draw_sphere_map(one.covariance, one.directions, labels, top=top, label=words)
        drawn.append(Drawing(picture, words))
    return Drawings([*drawn, Drawing(draw_scale(1e6 * top, "µg"), "Scale")])


def _poses(plan: PosePlan, names: Sequence[str]) -> list[list[str]]:
    ups: list[list[float]] = np.round(plan.directions, 3).tolist()
    dwells: list[float] = plan.dwells.tolist()
    return [
        [str(number), name, ", ".join(f"{part + 0.0:.3f}" for part in up), f"{dwell:.0f} s"]
        for number, (up, name, dwell) in enumerate(zip(ups, names, dwells, strict=True), 1)
    ]


def _rounded(value: float) -> float:
    """Up to the next of 1, 1.6, 2.4, 4, 6.4, 8 of a decade: eight shades with short numbers."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(step * decade for step in (1.0, 1.6, 2.4, 4.0, 6.4, 8.0, 16.0) if step * decade >= value)
