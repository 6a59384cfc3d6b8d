"""Elements of SVG drawings, which escape what stands in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

_NAMESPACE = "http://www.w3.org/2000/svg"


def drawing(view: str, label: str = "", **look: Any) -> Element:
    """Return an empty drawing.

    Parameters
    ----------
    view : its view box: left, top, width, height.
    label : what a screen reader says.
    look : further attributes; an underscore stands for a hyphen.
    """
    told = {"role": "img", "aria-label": label} if label else {}
    return Element("svg", {"xmlns": _NAMESPACE, "viewBox": view, **told, **_attributes(look)})


def add(parent: Element, name: str, words: str = "", **look: Any) -> Element:
    """Add an element and return it.

    Parameters
    ----------
    parent : that it stands in.
    name, words : of the element, and its text.
    look : its attributes; an underscore stands for a hyphen, floats get one decimal.
    """
    made = SubElement(parent, name, _attributes(look))
    made.text = words or None
    return made


def path(parent: Element, places: Sequence[str], **look: Any) -> Element:
    """Add a closed line through places, each "x y".

    Parameters
    ----------
    parent, look : as for `add`.
    places : one after the other.
    """
    return add(parent, "path", d=f"M{'L'.join(places)}Z", **look)


def as_text(made: Element) -> str:
    """Return a drawing as it is written.

    Parameters
    ----------
    made : with all its elements.
    """
    return tostring(made, encoding="unicode")


def _attributes(look: dict[str, Any]) -> dict[str, str]:
    return {
        name.replace("_", "-"): f"{value:.1f}" if isinstance(value, float) else str(value)
        for name, value in look.items()
    }
