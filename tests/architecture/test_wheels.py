"""`make wheels` builds every wheel that the build knows."""

from __future__ import annotations

import ast
import re
from pathlib import Path


def test_every_target_of_the_build_is_made(root: Path) -> None:
    tree = ast.parse((root / "setup.py").read_text(encoding="utf-8"))
    (targets,) = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "TARGETS"
    ]
    named = re.search(r"^WHEELS := (.*)$", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert named is not None
    assert named[1].split() == list(targets)
