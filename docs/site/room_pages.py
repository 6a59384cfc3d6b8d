"""One page for every room of the package: its docstring, and each public name with its own.

A room's public names are what its front lists (`__all__`).
"""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

from command_pages import write_page

import tumble

# Programs, not libraries: their reference is that of the commands.
PROGRAMS = ("cli",)


def rooms() -> list[str]:
    """Return the package and its rooms."""
    parts = (part.name for part in pkgutil.iter_modules(tumble.__path__))
    return ["tumble", *(f"tumble.{name}" for name in parts if name not in PROGRAMS and name[0] != "_")]


def write_room_pages(folder: Path) -> list[Path]:
    """Write the pages and their list into `folder`; return their paths."""
    written = []
    for room in rooms():
        title = (
            f"{room}: {(importlib.import_module(room).__doc__ or room).strip().splitlines()[0].rstrip('.')}"
        )
        lines = [title, "=" * len(title), "", f".. automodule:: {room}", *_members(room), ""]
        path = folder / f"{room}.rst"
        write_page(path, "\n".join(lines))
        written.append(path)
    lines = ["The package, room by room", "=========================", "", ".. toctree::", ""]
    write_page(folder / "index.rst", "\n".join([*lines, *(f"   {path.stem}" for path in written), ""]))
    return written


def _members(room: str) -> list[str]:
    """The names of the package's front are told in their own rooms; a room's are those that its front lists."""
    if room == "tumble":
        return [
            "   :no-members:",
            "",
            "Its names: " + ", ".join(f"``{name}``" for name in tumble.__all__) + ".",
        ]
    package = hasattr(importlib.import_module(room), "__path__")
    return ["   :members:", *(["   :imported-members:"] if package else [])]
