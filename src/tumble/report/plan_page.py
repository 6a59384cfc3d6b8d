"""A planned test as one HTML page: what it will be worth, beside the papers' schemes, with maps of the sphere."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from tumble.report.sphere_map import draw_scale, draw_sphere_map, force_sigmas

if TYPE_CHECKING:
    from tumble.design.pose_plan import PosePlan

_STYLE = """
.maps { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(440px, 100%), 1fr)); gap: 1rem; }
.maps svg { width: 100%; height: auto; }
.maps figcaption { font-size: .92rem; }
.number { text-align: right; }
tr.plan td { font-weight: 600; }
"""
# A scheme that is worse than this many times the plan is drawn as dark as can be.
_DARKEST = 2.5


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
    """Return the page; it works offline and runs nothing.

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
    worth = _table(("parameter", "standard uncertainty", "unit", "of noise alone"), parameters, 1)
    listed = "".join(f"<dt>{_text(name)}</dt><dd>{_text(value)}</dd>" for name, value in facts)
    body = (
        f"<style>{_STYLE}</style><h1>{_text(title)}</h1>"
        f'<dl class="facts">{listed}</dl>'
        f"<h2>What it will be worth</h2>{worth}"
        "<h2>Beside other schemes in the same time</h2>"
        f'<div class="scroll">{_table(schemes[0], schemes[1], 1, first="plan")}</div>'
        '<h2>On the sphere</h2><p class="note">Every direction that can point up, on two half spheres (equal areas). '
        "Points are the poses, numbered in their order; the shade is the standard uncertainty of the corrected "
        "specific force in that direction, from the noise of the test alone: the lighter the better.</p>"
        f'<div class="maps">{_maps(plan, others)}</div>'
        f"<h2>Poses in order</h2>{_table(('', 'pose', 'x, y, z of up', 'rest'), _poses(plan, names), 9)}"
        f"<h2>Remarks</h2><ul>{''.join(f'<li>{_text(one)}</li>' for one in sentences)}</ul>"
        "<footer>protocol.yaml beside this page is the test for tumble simulate and tumble calibrate, sheet.html the "
        "operator's sheet to print, plan.json everything as numbers.</footer>"
    )
    style = (files("tumble.report") / "page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{_text(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}\n"
        "</main>\n</body>\n</html>\n"
    )


def _maps(plan: PosePlan, others: Sequence[PosePlan]) -> str:
    grid = _grid()
    known = [one for one in (plan, *others) if float(np.max(np.diag(one.covariance))) < 0.1]
    if not known:
        return '<p class="note">Not every parameter is told, so that no direction is.</p>'
    top = _rounded(_DARKEST * float(np.max(force_sigmas(known[0].covariance, grid))))
    drawn: list[str] = []
    for one in known:
        values = force_sigmas(one.covariance, grid)
        words = (
            f"{one.name}, {len(one.dwells)} poses: {1e6 * float(np.sqrt(np.mean(values**2))):.3g} µg on the average, "
            f"{1e6 * float(values.max()):.3g} µg at worst"
        )
        labels = [str(number) for number in range(1, len(one.dwells) + 1)]
        picture = draw_sphere_map(one.covariance, one.directions, labels, top=top, label=words)
        drawn.append(f"<figure><figcaption>{_text(words)}</figcaption>{picture}</figure>")
    drawn.append(f"<figure><figcaption>Scale</figcaption>{draw_scale(1e6 * top, 'µg')}</figure>")
    return "".join(drawn)


def _grid() -> np.ndarray:
    from tumble.design.candidates import sphere_grid

    return sphere_grid(600)[26:]


def _poses(plan: PosePlan, names: Sequence[str]) -> list[list[str]]:
    ups: list[list[float]] = np.round(plan.directions, 3).tolist()
    dwells: list[float] = plan.dwells.tolist()
    return [
        [str(number), name, ", ".join(f"{part + 0.0:.3f}" for part in up), f"{dwell:.0f} s"]
        for number, (up, name, dwell) in enumerate(zip(ups, names, dwells, strict=True), 1)
    ]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: int, first: str = "") -> str:
    """A table whose columns from `numbers` on are set to the right."""

    def cells(kind: str, values: Sequence[str]) -> str:
        return "".join(
            f"<{kind}{' class=number' if place >= numbers else ''}>{_text(value).replace('-', '−')}</{kind}>"
            for place, value in enumerate(values)
        )

    body = "".join(
        f"<tr{f' class={first}' if first and not place else ''}>{cells('td', row)}</tr>"
        for place, row in enumerate(rows)
    )
    return f"<table><thead><tr>{cells('th', heads)}</tr></thead><tbody>{body}</tbody></table>"


def _rounded(value: float) -> float:
    """Up to the next of 1, 1.6, 2.4, 4, 6.4, 8 of a decade: eight shades with short numbers."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(step * decade for step in (1.0, 1.6, 2.4, 4.0, 6.4, 8.0, 16.0) if step * decade >= value)


def _text(value: str) -> str:
    return html.escape(value, quote=True)
