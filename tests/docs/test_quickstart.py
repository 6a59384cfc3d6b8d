"""The quick-start notebook runs from its first cell to its last, and what its cells end in shows itself."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

import tumble

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "quickstart.ipynb"


def test_the_page_on_python_names_what_the_front_has() -> None:
    page = (NOTEBOOK.parent / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `tumble\.(\w+)", page, re.M))
    assert named == set(tumble.__all__) - {"__version__"}


def test_every_cell_runs_and_what_it_ends_in_has_a_table_for_a_notebook(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert document["nbformat"] == 4
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    shown = []
    for cell in document["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert cell["outputs"] == [], "outputs are made by running it, not stored"
        body = ast.parse("".join(cell["source"])).body
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), cell["id"], "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)
            if value is not None:
                shown.append(value._repr_html_())
    assert len(shown) == 2
    assert "22 poses" in "".join(document["cells"][0]["source"])
    assert "fit for use" in shown[1]
    assert shown[1].count("<tr>") > 18
