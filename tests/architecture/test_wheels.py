"""`make wheels` builds every wheel that the build knows."""

import ast
import re
import tomllib
from fnmatch import fnmatch

import pytest


def test_every_target_of_the_build_is_made(root):
    tree = ast.parse((root / "setup.py").read_text(encoding="utf-8"))
    (targets,) = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "TARGETS"
    ]
    named = re.search(r"^WHEELS := (.*)$", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert named is not None
    assert named[1].split() == list(targets)


@pytest.mark.parametrize(
    "made", ["attitude/kernels.cpython-311-x86_64-linux-gnu.so", "sensor/__pycache__/triad.cpython-311.pyc"]
)
def test_a_wheel_takes_nothing_that_was_made_in_the_checkout(root, made):
    """As setuptools matches them: a pattern after the package's folder, in which a star stands for slashes, too."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["exclude-package-data"]["*"]
    for package in ("src/tumble", f"src/tumble/{made.partition('/')[0]}"):
        assert any(fnmatch(f"src/tumble/{made}", f"{package}/{pattern}") for pattern in patterns)
