"""A page as one HTML file that needs nothing else: its templates escape.

The plotting library is embedded where there are figures; its figures are plain data. A content security policy
forbids the page every connection.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from tumble.files import templates
from tumble.report.figures.on_page import plot
from tumble.report.page import Cards

if TYPE_CHECKING:
    from jinja2 import Environment

    from tumble.report.page import Block, Page

# What a page's plotting library is called that lies beside it.
LIBRARY = "plotly.min.js"
# The page may run what it holds and draw what it made, and fetch nothing.
_RUNS = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
# As `_RUNS`, with the plotting library beside the page.
_RUNS_BESIDE = _RUNS.replace("script-src", "script-src 'self' file:")
_RUNS_NOTHING = "default-src 'none'; style-src 'unsafe-inline'"
# Before a number, an exponent or the name of an axis it is no hyphen.
_MINUS = re.compile(r"(?<![\w-])-(?=[\d.]|[xyz]\b)|(?<=[\d)]e)-(?=\d)")


def render_page(page: Page, data: Mapping[str, Any] | None = None, library: str | None = None) -> str:
    """Return the page as HTML that works offline.

    Parameters
    ----------
    page : what stands on it.
    data : documents that it carries as JSON, by the identifiers of their elements.
    library : where the plotting library lies, seen from the page; None puts it into the page.
    """
    printed = any(isinstance(block, Cards) for block in page.blocks)
    figures = [plot(figure) for figure in page.figures]
    carried = {**(data or {}), **({"figures": figures} if figures else {})}
    return (
        _templates()
        .get_template("sheet.html" if printed else "page.html")
        .render(
            page=page,
            policy=(_RUNS if library is None else _RUNS_BESIDE) if figures else _RUNS_NOTHING,
            library=library if figures else None,
            data={name: Markup(_json(value)) for name, value in carried.items()},
            scripts=_scripts(library) if figures else [],
            style=Markup(_resource("sheet.css" if printed else "page.css")),
        )
    )


@cache
def _templates() -> Environment:
    made = templates()
    made.filters |= {"minus": _with_minus, "kind": _kind}
    return made


def _with_minus(text: str) -> str:
    return _MINUS.sub("−", text)


def _kind(block: Block) -> str:
    return type(block).__name__.lower()


def _scripts(library: str | None) -> list[Any]:
    own = [] if library is not None else [Markup(plotting_library())]
    return [*own, Markup(_resource("page.js"))]


@cache
def plotting_library() -> str:
    """Return the source of plotly.js as the installed plotly package brings it."""
    return (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@cache
def _resource(name: str) -> str:
    return (files("tumble.report") / "templates" / name).read_text(encoding="utf-8")


def _json(value: Any) -> str:
    """Return JSON that cannot end the script element it stands in, and that has no NaN."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
