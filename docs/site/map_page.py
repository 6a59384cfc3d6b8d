"""The map of the house, made from the openings of its modules and from the contract of its floors.

`python docs/site/map_page.py` (or `make map`) writes it anew into `docs/architecture.md`, between two marks; a test
fails when the page is behind the source.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "architecture.md"
SOURCE = HERE.parents[1] / "src"


def opening(path: Path) -> str:
    """Return the first sentence of a module's docstring: all before its first blank line, on one line."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).replace("|", r"\|")


def rooms(package: Path) -> list[Path]:
    """Return a package and all packages below it, in the order of their names."""
    return sorted(path.parent for path in package.rglob("__init__.py"))


def map_of(source: Path = SOURCE) -> str:
    """Return the map: for every room its opening, and a row for every module in it."""
    lines: list[str] = []
    for package in sorted(path.parent for path in source.glob("*/__init__.py")):
        for room in rooms(package):
            name = ".".join(room.relative_to(source).parts)
            lines += [f"### `{name}`", "", opening(room / "__init__.py"), ""]
            modules = sorted(path for path in room.glob("*.py") if path.name != "__init__.py")
            if modules:
                lines += ["| module | opens with |", "|---|---|"]
                lines += [f"| `{path.stem}` | {opening(path)} |" for path in modules]
                lines.append("")
    return "\n".join(lines)


def floors() -> str:
    """Return the contract that imports point down, a floor a line, from the top."""
    settings = tomllib.loads((SOURCE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (layers,) = (one["layers"] for one in contracts if one["id"] == "floors")
    return "\n".join(["```", *layers, "```", ""])


def page_with_map(text: str) -> str:
    """Return the page with what is made of the source, between its marks.

    Raises
    ------
    ValueError
        If the marks are not there.
    """
    for mark, made in (("map", map_of), ("floors", floors)):
        begin, end = f"<!-- {mark}: made by `make map` -->\n", f"<!-- /{mark} -->\n"
        start = text.index(begin) + len(begin)
        text = f"{text[:start]}\n{made()}\n{text[text.index(end) :]}"
    return text


if __name__ == "__main__":
    PAGE.write_text(page_with_map(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
