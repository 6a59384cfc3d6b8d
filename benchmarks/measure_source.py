"""How large the source is and how it hangs together: one table, read from the source itself.

    python benchmarks/measure_source.py            # the packages under src
    python benchmarks/measure_source.py --no-demo  # without running the demo

Code lines are lines with a token that is neither a comment nor a docstring. A function's lines run from its
`def` to its end, docstring excluded, inner functions included. Import depth counts modules on the longest
chain of imports at module level, circles collapsed; imports under TYPE_CHECKING do not count. Circles are
strongly connected components of all imports, those inside functions too. What the demo enters are modules
whose functions ran during `tumble calibrate` (sys.setprofile); what runs at import alone is not counted,
and neither are compiled loops.
"""

from __future__ import annotations

import ast
import io
import os
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
LONG_FUNCTIONS = (45, 60)
LONG_MODULE = 450
SHOWN_ROOMS = 12
Function = ast.FunctionDef | ast.AsyncFunctionDef

RUN_DEMO = """
import contextlib, io, sys, tempfile, threading
from pathlib import Path
from tumble.cli.main import main
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
    lines: int
    code: int
    functions: list[tuple[int, str]]
    inner_imports: int
    early: set[str] = field(default_factory=set)
    late: set[str] = field(default_factory=set)

    @property
    def room(self) -> str:
        """Package and room: the first two parts of the name, the package's own modules as one room."""
        parts = self.name.split(".")
        inside = len(parts) > 2 or (len(parts) == 2 and self.is_package)
        return ".".join(parts[:2]) if inside else f"{parts[0]} (top)"


def docstring_lines(tree: ast.AST) -> set[int]:
    """Return the numbers of the lines that are docstrings."""
    lines: set[int] = set()
    for node in ast.walk(tree):
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
    for node in ast.walk(tree):
        if isinstance(node, Function):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if ast.get_docstring(node, clean=False) is not None:
                lines -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
            found.append((lines, f"{name}.{node.name}"))
    return found


def imports_of(tree: ast.AST, *, inner: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Yield imports, each with whether it stands inside a function; those for type checkers alone are left out."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, inner
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            for other in node.orelse:
                yield from imports_of(ast.Module([other], []), inner=inner)
        else:
            yield from imports_of(node, inner=inner or isinstance(node, Function | ast.Lambda))


def targets_of(node: ast.Import | ast.ImportFrom, module: Module, names: set[str]) -> Iterator[str]:
    """Yield the modules of ours that an import asks for."""
    if isinstance(node, ast.Import):
        asked = [alias.name for alias in node.names]
    else:
        base = node.module or ""
        if node.level:
            parts = module.name.split(".")
            above = parts[: len(parts) - node.level + module.is_package]
            base = ".".join([*above, base] if base else above)
        asked = [f"{base}.{alias.name}" if f"{base}.{alias.name}" in names else base for alias in node.names]
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
        lines = len(text.splitlines())
        modules[name] = Module(name, is_package, lines, code_lines(text, tree), functions_of(name, tree), 0)
        trees[name] = tree
    for name, module in modules.items():
        for node, inner in imports_of(trees[name]):
            module.inner_imports += inner
            (module.late if inner else module.early).update(targets_of(node, module, set(modules)))
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

    sys.setrecursionlimit(100_000)
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


def entries(modules: Iterable[Module]) -> Counter[str]:
    """Return how many modules and subpackages each package holds at one level."""
    return Counter(module.name.rpartition(".")[0] for module in modules if "." in module.name)


def demo_modules() -> str:
    """Return how many modules the demo enters, and how many it imports."""
    environment = {**os.environ, "PYTHONPATH": str(SOURCE), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", RUN_DEMO, str(SOURCE)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return f"failed: {done.stderr.strip().splitlines()[-1]}"
    entered, imported = done.stdout.split()
    return f"{entered} (imported: {imported})"


def rows(modules: dict[str, Module], *, demo: bool) -> Iterator[tuple[str, object]]:
    """Yield the table."""
    everything = modules.values()
    functions = sorted((one for module in everything for one in module.functions), reverse=True)
    longest = max(everything, key=lambda module: module.lines)
    early = {name: module.early for name, module in modules.items()}
    both = {name: module.early | module.late for name, module in modules.items()}
    circles = sorted((len(one) for one in components(both) if len(one) > 1), reverse=True)
    early_circles = sorted((len(one) for one in components(early) if len(one) > 1), reverse=True)
    yield "modules", len(modules)
    yield "lines", sum(module.lines for module in everything)
    yield "code lines", sum(module.code for module in everything)
    yield "import depth", import_depth(early)
    yield "circles of imports at module level", f"{len(early_circles)} {early_circles}"
    yield "circles with imports in functions", f"{len(circles)} {circles}"
    yield "imports inside functions", sum(module.inner_imports for module in everything)
    yield "longest function", f"{functions[0][0]} {functions[0][1]}"
    for limit in LONG_FUNCTIONS:
        yield f"functions over {limit} lines", sum(lines > limit for lines, _ in functions)
    yield "longest module", f"{longest.lines} {longest.name}"
    yield f"modules over {LONG_MODULE} lines", sum(module.lines > LONG_MODULE for module in everything)
    if demo:
        yield "modules that the demo enters", demo_modules()
    yield "most entries at one level", ""
    for name, count in entries(everything).most_common(SHOWN_ROOMS):
        yield f"  {name}", count
    yield "room", "modules   lines    code"
    rooms = sorted({module.room for module in everything})
    for room in sorted(rooms, key=lambda room: -sum(m.code for m in everything if m.room == room)):
        inside = [module for module in everything if module.room == room]
        lines, code = sum(module.lines for module in inside), sum(module.code for module in inside)
        yield f"  {room}", f"{len(inside):7d} {lines:7d} {code:7d}"


def main() -> None:
    for name, value in rows(read_modules(), demo="--no-demo" not in sys.argv[1:]):
        print(f"{name:38s} {value}")


if __name__ == "__main__":
    main()
