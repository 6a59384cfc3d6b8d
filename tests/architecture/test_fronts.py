"""Nobody imports below a room's front, and a front names what others use and nothing else."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FRONTS = {
    ".".join(stub.parent.relative_to(ROOT / "src").parts): stub
    for stub in sorted(ROOT.glob("src/*/*/__init__.pyi"))
}
PYTHON = re.compile(r"```python\n(.*?)```", re.DOTALL)
TEXTS = [
    path for top in ("src", "tests", "benchmarks", "docs") for path in sorted((ROOT / top).rglob("*.py"))
]
TEXTS += [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "docs").glob("*.ipynb")),
]


def room_of(module):
    room = ".".join(module.split(".")[:2])
    return room if room in FRONTS else None


def rooms_of_reader(path):
    """The rooms whose inside a file may see: its own; of tests those of the room."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[0] == "src":
        return (".".join(parts[1:3]),)
    if parts[:2] == ("tests", "cli"):
        return ("tumble.cli",)
    if parts[:3] == ("tests", "unit", "papers"):
        return tuple(room for room in FRONTS if room.startswith("tumble_papers"))
    return (f"tumble.{parts[2]}",) if parts[:2] == ("tests", "unit") and len(parts) > 2 else ()


@cache
def imported(path):
    """Module and name of each import of ours, those in strings that a test runs or patches included."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        text = "\n".join(PYTHON.findall(text))
    elif path.suffix == ".ipynb":
        return tuple(re.findall(r"from (tumble[\w.]*) import (\w+)", text))
    return tuple(_in_tree(ast.parse(text)))


def _in_tree(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"from (tumble[\w.]*) import (\w+)", node.value)
            yield from re.findall(r"^(tumble\w*\.\w+(?:\.[a-z_]+)*)\.(\w+)$", node.value)


def names_of(room):
    tree = ast.parse(FRONTS[room].read_text(encoding="utf-8"))
    listed = {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    return listed | {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_nobody_imports_below_a_front():
    below = [
        f"{path.relative_to(ROOT)}: {module} {name}"
        for path in TEXTS
        for module, name in imported(path)
        if (room := room_of(module)) and room not in rooms_of_reader(path)
        if module != room or (name and name not in names_of(room))
    ]
    assert not below


def test_a_front_names_what_others_use():
    used = {
        (module, name)
        for path in TEXTS
        for module, name in imported(path)
        if (room := room_of(module)) and room not in rooms_of_reader(path)
    }
    idle = [f"{room} {name}" for room in FRONTS for name in names_of(room) if (room, name) not in used]
    assert not idle
