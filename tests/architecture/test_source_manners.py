"""What the plan of the house asks of every module, read from the source itself."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src"
MODULES = sorted(SOURCE.rglob("*.py"))
CORE = (
    "attitude",
    "earth",
    "sensor",
    "recording",
    "estimation",
    "segmentation",
    "simulation",
    "navigation",
    "calibration",
    "document",
)

# Suffixes of what is not SI. `_celsius` is let in: every temperature of this field is given in it.
NOT_SI = re.compile(
    r"(_(deg|mdeg|arcmin|arcsec|rpm|dps|g|mg|ug|gal|mgal|gauss|ppm|ppb|percent"
    r"|km|cm|mm|um|minutes|hours|days|ms|us|ns|knots|kmh|fahrenheit|deg_per_\w+)|_per_(h|hour|min|deg))$"
)
# The letter g is also a frame, the gyro triad's: no rate and no rotation has the unit g.
FRAME_G = re.compile(r"^(angular_rate|earth_rate|C|rotation|quaternion)(_\w+)?_g$")

type_of_function = ast.FunctionDef | ast.AsyncFunctionDef


def functions_of(tree):
    """Every public function, and every public method of a public class."""
    for node in tree.body:
        if isinstance(node, type_of_function) and not node.name.startswith("_"):
            yield node.name, node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for member in node.body:
                if isinstance(member, type_of_function) and not member.name.startswith("_"):
                    yield f"{node.name}.{member.name}", member


def statements_of(function):
    """What stands in the function itself, not in one that is defined inside it."""
    pending: list[ast.AST] = list(function.body)
    while pending:
        node = pending.pop()
        yield node
        if not isinstance(node, type_of_function | ast.ClassDef):
            for part in ("body", "orelse", "finalbody", "handlers", "cases"):
                pending += getattr(node, part, [])


def has_silent_raise(function):
    """Whether the function raises and its docstring has no Raises section."""
    raises = any(isinstance(node, ast.Raise) for node in statements_of(function))
    return raises and not re.search(r"^\s*Raises\n\s*------\s*$", ast.get_docstring(function) or "", re.M)


def file_models_of(tree):
    """The module's parts of documents: their fields are the keys of a file, which is an edge."""
    models = {"DocumentPart"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and models & {ast.unparse(base) for base in node.bases}:
            models.add(node.name)
    return models


def names_of(tree):
    """Names that a caller writes: parameters of every function, fields of every class."""
    files = file_models_of(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.arguments):
            yield from (argument.arg for argument in [*node.posonlyargs, *node.args, *node.kwonlyargs])
        elif isinstance(node, ast.ClassDef) and node.name not in files:
            for field in node.body:
                if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                    yield field.target.id


def names_that_are_not_si(tree):
    return [name for name in names_of(tree) if NOT_SI.search(name) and not FRAME_G.search(name)]


@cache
def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def label(path):
    return path.relative_to(SOURCE).as_posix()


def faults_of(fault, *, among=MODULES):
    """What a check finds in each module, as lines that name the module."""
    return [f"{label(path)}: {name}" for path in among for name in fault(tree_of(path))]


def functions_that_raise_in_silence(tree):
    return [name for name, function in functions_of(tree) if has_silent_raise(function)]


def test_every_public_function_that_raises_says_so():
    # A command's docstring is its help text; what it raises is its exit status.
    outside = [path for path in MODULES if "cli" not in path.relative_to(SOURCE).parts]
    assert not faults_of(functions_that_raise_in_silence, among=outside)


def test_the_core_names_no_unit_that_is_not_si():
    core = [path for path in MODULES if path.relative_to(SOURCE).parts[1] in CORE]
    assert not faults_of(names_that_are_not_si, among=core)


def test_no_module_is_a_drawer_for_anything():
    drawers = {"utils", "util", "helpers", "helper", "common", "misc", "tools", "stuff"}
    assert not [label(path) for path in MODULES if drawers & set(path.with_suffix("").parts[-3:])]


def test_the_second_simulator_shares_no_code_with_tumble(root):
    ours = re.compile(r"^\s*(import|from) tumble", re.MULTILINE)
    folder = root / "tests/second_simulator"
    asked = {path.name for path in folder.glob("*.py") if ours.search(path.read_text("utf-8"))}
    assert {name for name in asked if not name.startswith("test_")} == {"calibrating.py"}


# What follows shows that the checks above can fail.


def test_a_raise_without_its_section_is_found_and_one_of_an_inner_function_is_let_through():
    silent = 'def f(x):\n    """F."""\n    if x:\n        raise ValueError\n'
    said = 'def f():\n    """F.\n\n    Raises\n    ------\n    OSError\n        Always.\n    """\n    raise OSError\n'
    inner = 'def f():\n    """F."""\n    def g():\n        raise ValueError\n    return g\n'
    found = [functions_that_raise_in_silence(ast.parse(source)) for source in (silent, said, inner)]
    assert found == [["f"], [], []]


@pytest.mark.parametrize("name", ["latitude_deg", "bias_mg", "noise_g", "rate_deg_per_h", "drift_per_hour"])
def test_a_name_with_a_unit_that_is_not_si_is_found_but_as_the_key_of_a_file(name):
    for source in (f"def f(*, {name}): ...", f"class A:\n    {name}: float"):
        assert names_that_are_not_si(ast.parse(source)) == [name]
    block = f"class Block(DocumentPart): ...\nclass Site(Block):\n    {name}: float\n    def at(self, height_km): ..."
    assert names_that_are_not_si(ast.parse(block)) == ["height_km"]


def test_frames_and_celsius_are_let_through():
    names = "angular_rate_ib_g, C_ag, temperature_celsius, matrix, weights"
    assert not names_that_are_not_si(ast.parse(f"def f({names}): ..."))


def test_objections_are_said_in_one_file_and_repeated_of_several_recordings(root):
    """What decides FIT stands in two files: `objections` says it, `verdict` judges."""
    say, source = re.compile(r"""\.say\(\s*"objection\""""), root / "src/tumble/calibration"
    saying = {path for path in (root / "src").rglob("*.py") if say.search(path.read_text("utf-8"))}
    assert saying == {source / "objections.py", source / "turn_ons/estimate.py"}
