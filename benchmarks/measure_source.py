"""How large the house is and how it hangs together, beside its ceilings and aims (`ceilings.toml`).

    python benchmarks/measure_source.py            # every figure, its ceiling, its aim
    python benchmarks/measure_source.py --no-demo  # without running the demo
    python benchmarks/measure_source.py --lower    # lower each ceiling to its figure

A ceiling only falls: `--lower` never raises one, and `tests/architecture/test_ceilings.py` fails above it.

Code lines are lines with a token that is neither a comment nor a docstring. A function's lines run from its
`def` to its end, docstring excluded, inner functions included; compiled loops are not counted among the long
ones. What a room's front lists (`__init__.pyi`) is counted in names, not in lines. Import depth counts
modules on the longest chain of imports, circles collapsed. Circles are strongly connected components. Both
count all imports: at module level, inside functions, and under TYPE_CHECKING; an import from a room's front
is one of the module that the front fetches the name from. What the demo enters are modules whose functions
ran during `tumble calibrate` (sys.setprofile); what runs at import alone is not counted, and neither are
compiled loops. Words are those of all Markdown pages that git tracks. Options are those of all commands, hidden
ones too.
"""

from __future__ import annotations

import ast
import io
import os
import subprocess
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src"
CEILINGS = ROOT / "ceilings.toml"
LONG_FUNCTION = 60
Function = ast.FunctionDef | ast.AsyncFunctionDef

RUN_DEMO = """
import contextlib, io, sys, tempfile, threading
from pathlib import Path
from tumble.cli import main
source, entered = sys.argv[1], set()
def profile(frame, event, argument):
    code = frame.f_code
    if event == "call" and code.co_name != "<module>" and code.co_filename.startswith(source):
        # The body of a class runs at import and is no function.
        if code.co_flags & 2:
            entered.add(code.co_filename)
with tempfile.TemporaryDirectory() as folder:
    sys.argv = ["tumble", "demo", "-o", folder]
    threading.setprofile(profile)
    sys.setprofile(profile)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            main()
    except SystemExit as end:
        assert end.code == 0, end.code
    finally:
        sys.setprofile(None)
print(len(entered), sum(name.partition(".")[0] == "tumble" for name in sys.modules))
"""


@dataclass
class Module:
    """What is counted of one file."""

    name: str
    is_package: bool
    code: int
    functions: list[tuple[int, str]]
    imports: set[str] = field(default_factory=set)
    front: dict[str, str] = field(default_factory=dict)

    @property
    def room(self) -> str:
        """The first part of the name below the package, `root` for the package's own modules."""
        parts = self.name.split(".")
        if parts[0] == "tumble_papers":
            return "tumble_papers"
        return parts[1] if len(parts) > 2 or (len(parts) == 2 and self.is_package) else "root"


def statements_of(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a module and all statements in it: no expression holds an import, a function or a docstring."""
    yield node
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for inner in getattr(node, part, []):
            yield from statements_of(inner)


def docstring_lines(tree: ast.AST) -> set[int]:
    """Return the numbers of the lines that are docstrings."""
    lines: set[int] = set()
    for node in statements_of(tree):
        if (
            isinstance(node, ast.Module | ast.ClassDef | Function)
            and ast.get_docstring(node, clean=False) is not None
        ):
            lines.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return lines


def code_lines(text: str, tree: ast.AST) -> int:
    """Return how many lines have code on them."""
    empty = {
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    }
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in empty:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - docstring_lines(tree))


def functions_of(name: str, tree: ast.AST) -> list[tuple[int, str]]:
    """Return lines and name of every function."""
    found = []
    for node in statements_of(tree):
        if isinstance(node, Function):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if ast.get_docstring(node, clean=False) is not None:
                lines -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
            found.append((lines, f"{name}.{node.name}"))
    return found


def imports_of(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield all imports, those inside functions and for type checkers too."""
    yield from (node for node in statements_of(tree) if isinstance(node, ast.Import | ast.ImportFrom))


def front_of(room: str, stub: ast.Module) -> dict[str, str]:
    """Return the module that a room's front fetches each name from."""
    return {
        alias.name: f"{room}.{node.module}"
        for node in imports_of(stub)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def targets_of(node: ast.Import | ast.ImportFrom, module: Module, names: dict[str, Module]) -> Iterator[str]:
    """Yield the modules of ours that an import asks for."""
    if isinstance(node, ast.Import):
        asked = [alias.name for alias in node.names]
    else:
        base = node.module or ""
        if node.level:
            parts = module.name.split(".")
            above = parts[: len(parts) - node.level + module.is_package]
            base = ".".join([*above, base] if base else above)
        front = names[base].front if base in names else {}
        inside = [f"{base}.{alias.name}" for alias in node.names]
        asked = [
            front.get(alias.name, name if name in names else base)
            for alias, name in zip(node.names, inside, strict=True)
        ]
    yield from (name for name in asked if name in names and name != module.name)


def read_modules() -> dict[str, Module]:
    """Return every module under src."""
    modules: dict[str, Module] = {}
    trees: dict[str, ast.Module] = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_package else parts)
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        modules[name] = Module(name, is_package, code_lines(text, tree), functions_of(name, tree))
        trees[name] = tree
        stub = path.with_suffix(".pyi")
        if stub.exists():
            modules[name].front = front_of(name, ast.parse(stub.read_text(encoding="utf-8")))
    for name, module in modules.items():
        for node in imports_of(trees[name]):
            module.imports.update(targets_of(node, module, modules))
    return modules


def components(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected components, those that are imported first."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        order[name] = low[name] = len(order)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in order:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], order[other])
        if low[name] == order[name]:
            at = stack.index(name)
            found.append(stack[at:])
            del stack[at:]

    for name in graph:
        if name not in order:
            visit(name)
    return found


def import_depth(graph: dict[str, set[str]]) -> int:
    """Return how many modules the longest chain of imports has, each circle taken as one."""
    depth: dict[str, int] = {}
    for circle in components(graph):
        below = {other for name in circle for other in graph[name]} - set(circle)
        depth |= dict.fromkeys(circle, 1 + max((depth[name] for name in below), default=0))
    return max(depth.values(), default=0)


def documentation_words() -> int:
    """Return how many words the pages have."""
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    pages = [ROOT / name for name in listed.stdout.splitlines()]
    return sum(len(page.read_text(encoding="utf-8").split()) for page in pages if page.exists())


def commands_and_options() -> tuple[int, int]:
    """Return how many commands the program has, those of `registry` one by one, and how many options in all."""
    sys.path.insert(0, str(SOURCE))
    import typer

    from tumble.cli import app

    counts: list[int] = []

    def walk(command: object) -> None:
        inside = getattr(command, "commands", None)
        if inside is None:
            counts.append(sum(one.param_type_name == "option" for one in command.params))  # type: ignore[attr-defined]
        else:
            for name in inside:
                walk(inside[name])

    walk(typer.main.get_command(app))
    return len(counts), sum(counts)


def demo_modules() -> str:
    """Return how many modules the demo enters, and how many it imports."""
    environment = {**os.environ, "PYTHONPATH": str(SOURCE), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", RUN_DEMO, str(SOURCE)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return f"failed: {done.stderr.strip().splitlines()[-1]}"
    entered, imported = done.stdout.split()
    return f"{entered} (imported: {imported})"


def figures(modules: dict[str, Module]) -> dict[str, int]:
    """Return every figure that has a ceiling, by the name that it has in `ceilings.toml`."""
    everything = modules.values()
    graph = {name: module.imports for name, module in modules.items()}
    commands, options = commands_and_options()
    found = {
        "code lines": sum(module.code for module in everything),
        "modules": len(modules),
        "import depth": import_depth(graph),
        "circles of imports": sum(len(one) > 1 for one in components(graph)),
        f"functions over {LONG_FUNCTION} lines": len(long_functions(modules)),
        "names at fronts": sum(len(module.front) for module in everything),
        "lines of tests": sum(
            len(path.read_text(encoding="utf-8").splitlines()) for path in (ROOT / "tests").rglob("*.py")
        ),
        "words of documentation": documentation_words(),
        "commands": commands,
        "options": options,
    }
    for rooms in tomllib.loads(CEILINGS.read_text(encoding="utf-8")):
        if rooms not in found:
            inside = [module for module in everything if module.room in rooms.split(", ")]
            found[rooms] = sum(module.code for module in inside)
            found[f"{rooms}: modules"] = len(inside)
    return found


def long_functions(modules: dict[str, Module]) -> list[tuple[int, str]]:
    """Return lines and names of functions that fit on no screen, compiled loops left out."""
    inside = [one for name, one in modules.items() if name.rpartition(".")[2] != "kernels"]
    return sorted(
        (one for module in inside for one in module.functions if one[0] > LONG_FUNCTION), reverse=True
    )


def ceilings() -> dict[str, tuple[int, int | None]]:
    """Return ceiling and aim of every figure; the modules of a room stand behind its code lines and have no aim."""
    found: dict[str, tuple[int, int | None]] = {}
    for name, row in tomllib.loads(CEILINGS.read_text(encoding="utf-8")).items():
        found[name] = row["ceiling"], row["aim"]
        if "modules" in row:
            found[f"{name}: modules"] = row["modules"], None
    return found


def lower(found: dict[str, int]) -> None:
    """Write `ceilings.toml` anew, each ceiling at most its figure."""
    limits = ceilings()
    lines = [
        line for line in CEILINGS.read_text(encoding="utf-8").splitlines() if line.startswith("#") or not line
    ]
    for name, (ceiling, aim) in limits.items():
        if aim is None:
            continue
        row = f'"{name}" = {{ ceiling = {min(ceiling, found[name])}, aim = {aim}'
        inside = f"{name}: modules"
        if inside in limits:
            row += f", modules = {min(limits[inside][0], found[inside])}"
        lines.append(row + " }")
    CEILINGS.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    modules = read_modules()
    found = figures(modules)
    if "--lower" in sys.argv[1:]:
        lower(found)
        return
    print(f"{'':76s}{'figure':>8s}{'ceiling':>9s}{'aim':>8s}")
    for name, (ceiling, aim) in ceilings().items():
        print(f"{name:76s}{found[name]:8d}{ceiling:9d}{'' if aim is None else aim:>8}")
    for lines, name in long_functions(modules):
        print(f"over {LONG_FUNCTION} lines: {lines} {name}")
    for circle in components({name: module.imports for name, module in modules.items()}):
        if len(circle) > 1:
            print(f"a circle: {', '.join(sorted(circle)[:8])}{', …' if len(circle) > 8 else ''}")
    if "--no-demo" not in sys.argv[1:]:
        print(f"modules that the demo enters (aim 100): {demo_modules()}")


if __name__ == "__main__":
    main()
