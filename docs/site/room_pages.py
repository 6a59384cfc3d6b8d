"""One page for every room of the package: its docstring, and each public name with its own.

A room's public names are its `__all__`; a room without one is entered by its modules, and each of them is told.
"""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

from command_pages import write_page

import tumble

# Programs, not libraries: their reference is that of the commands.
PROGRAMS = ("cli",)


def rooms() -> dict[str, list[str]]:
    """Return the modules whose names each room offers."""
    found = {"tumble": ["tumble"]}
    for part in pkgutil.iter_modules(tumble.__path__):
        if part.name in PROGRAMS or part.name.startswith("_"):
            continue
        name = f"tumble.{part.name}"
        module = importlib.import_module(name)
        if part.ispkg and not getattr(module, "__all__", None):
            found[name] = [f"{name}.{below.name}" for below in pkgutil.iter_modules(module.__path__)]
        else:
            found[name] = [name]
    return found


def write_room_pages(folder: Path) -> list[Path]:
    """Write the pages and their list into `folder`; return their paths."""
    written = []
    for room, modules in rooms().items():
        title = (
            f"{room}: {(importlib.import_module(room).__doc__ or room).strip().splitlines()[0].rstrip('.')}"
        )
        lines = [title, "=" * len(title), ""]
        if modules != [room]:
            lines += [f".. automodule:: {room}", "   :no-members:", ""]
        for module in modules:
            if modules != [room]:
                lines += [module, "-" * len(module), ""]
            lines += [f".. automodule:: {module}", *_members(module), ""]
        path = folder / f"{room}.rst"
        write_page(path, "\n".join(lines))
        written.append(path)
    lines = ["The package, room by room", "=========================", "", ".. toctree::", ""]
    write_page(folder / "index.rst", "\n".join([*lines, *(f"   {path.stem}" for path in written), ""]))
    return written


def _members(module: str) -> list[str]:
    """The front's names are told in their own rooms; a package's are those of its modules that it offers."""
    if module == "tumble":
        return [
            "   :no-members:",
            "",
            "Its names: " + ", ".join(f"``{name}``" for name in tumble.__all__) + ".",
        ]
    package = hasattr(importlib.import_module(module), "__path__")
    return ["   :members:", *(["   :imported-members:"] if package else [])]
