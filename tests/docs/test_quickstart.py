"""Each notebook runs from its first cell to its last, and what its cells end in shows itself."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import pytest

import tumble

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_on_python_names_what_the_front_has() -> None:
    page = (DOCS / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `tumble\.(\w+)", page, re.M))
    assert named == set(tumble.__all__) - {"__version__"}


def _shown_by(notebook: Path) -> list[str]:
    """Run a notebook's cells; return as HTML what they end in."""
    document = json.loads(notebook.read_text(encoding="utf-8"))
    assert document["nbformat"] == 4
    names: dict[str, object] = {}
    shown: list[str] = []
    for cell in document["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert cell["outputs"] == [], "outputs are made by running it, not stored"
        body = ast.parse("".join(cell["source"])).body
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), cell["id"], "exec"), names)
        if last is not None:
            value: Any = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)
            if hasattr(value, "_repr_html_"):
                shown.append(value._repr_html_())
    return shown


@pytest.mark.parametrize(
    ("notebook", "tables"), [("quickstart", 2), ("noise-at-rest", 0), ("two-estimators", 1)]
)
def test_every_cell_runs_and_what_it_ends_in_has_a_table_for_a_notebook(
    notebook: str, tables: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shown = _shown_by(DOCS / f"{notebook}.ipynb")
    assert len(shown) == tables
    if shown:
        assert "fit for use" in shown[-1]
        assert shown[-1].count("<tr>") > 18


def test_every_notebook_runs_here() -> None:
    assert {path.stem for path in DOCS.glob("*.ipynb")} == {"quickstart", "noise-at-rest", "two-estimators"}
