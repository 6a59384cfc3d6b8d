"""What the documentation publishes is what the code gives: schemas, keys, figures; notebooks run."""

import ast
import json
import re
import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import tumble
from tumble.protocol import read_protocol, sequence_steps

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def script(path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module of a script that lies outside the package."""
    spec = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setitem(sys.modules, path.stem, module)
    spec.loader.exec_module(module)
    return module


# --- schemas and keys

SCHEMA = json.loads((DOCS / "schema" / "calibration.schema.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["calibration", "protocol", "noise", "filter"])
def test_the_published_schema_is_the_code_s(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    published = (DOCS / "schema" / f"{name}.schema.json").read_text(encoding="utf-8")
    made = script(DOCS / "schema" / "write_schema.py", monkeypatch).schema_text(name)
    assert published == made, "run make schema"


@pytest.mark.parametrize(
    ("section", "properties"),
    [
        ("# calibration.json, key by key", SCHEMA["properties"]),
        ("## accelerometer, gyroscope", SCHEMA["$defs"]["TriadBlock"]["properties"]),
        ("## thermal", SCHEMA["$defs"]["ThermalBlock"]["properties"]),
        ("## quality", SCHEMA["$defs"]["QualityBlock"]["properties"]),
    ],
)
def test_every_key_is_documented_and_every_documented_key_exists(section, properties):
    """In the first column of the first table after the heading."""
    text = (DOCS / "file-format.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", text.partition(section)[2].partition("\n## ")[0], re.M)
    assert {key for row in rows for key in re.findall(r"`(\w+)`", row)} == set(properties)


# --- the procedures' pages


@pytest.mark.parametrize(
    ("name", "drawn", "pages"),
    [
        (
            "expected_uncertainty",
            {"motion", "uncertainty-by-poses", "uncertainty-by-seconds"},
            ("hand-held",),
        ),
        (
            "classical_uncertainty",
            {"classical-uncertainty"},
            ("six-position", "rate-table", "modified-multi-position"),
        ),
        ("turntable_uncertainty", {"turntable-uncertainty"}, ("turntable", "laboratory")),
        ("strapdown_uncertainty", {"strapdown-uncertainty"}, ("strapdown-rotation",)),
    ],
)
def test_figures_and_tables_are_drawn_from_the_published_medians(name, drawn, pages, tmp_path, monkeypatch):
    module = script(DOCS / "figures" / f"{name}.py", monkeypatch)
    if hasattr(module, "expected_uncertainty"):
        # These figures have a fourth grade, which the module of the first figure is not to keep.
        monkeypatch.setattr(module.expected_uncertainty, "GRADES", dict(module.expected_uncertainty.GRADES))
    figures, procedures = tmp_path / "figures", tmp_path / "procedures"
    figures.mkdir()
    procedures.mkdir()
    for page in pages:
        shutil.copy(DOCS / "procedures" / f"{page}.md", procedures)
    monkeypatch.setattr(module, "FOLDER", figures)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "--draw"])
    module.main()
    assert {path.stem for path in figures.iterdir()} == drawn
    for path in [*figures.iterdir(), *procedures.iterdir()]:
        published = (DOCS / path.relative_to(tmp_path)).read_text(encoding="utf-8")
        assert path.read_text(encoding="utf-8") == published, f"run docs/figures/{name}.py --draw"


@pytest.mark.parametrize("page", ["turntable", "laboratory", "strapdown-rotation"])
def test_the_steps_on_a_page_are_steps_of_a_protocol(page: str, tmp_path: Path) -> None:
    text = (DOCS / "procedures" / f"{page}.md").read_text("utf-8")
    (steps,) = re.findall(r"^```yaml\n(.*?)^```$", text, re.M | re.S)
    head = f"format: tumble protocol\nversion: 1\nname: mine\nprocedure: {page}\n"
    path = tmp_path / "protocol.yaml"
    path.write_text(f"{head}site:\n  latitude_deg: 48\n  height_m: 500\nsteps:\n{steps}", encoding="utf-8")
    protocol = read_protocol(path)
    assert protocol.procedure == page
    if page == "strapdown-rotation":
        assert [sequence.name for sequence in sequence_steps(protocol)] == ["8"]
    else:
        assert len(protocol.steps) == 2


# --- Python and notebooks


def test_the_page_on_python_names_what_the_front_has() -> None:
    page = (DOCS / "python.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `tumble\.(\w+)", page, re.M)) == set(tumble.__all__) - {"__version__"}


# How many tables the cells end in.
NOTEBOOKS = {"quickstart": 2, "noise-at-rest": 0, "two-estimators": 1}


@pytest.mark.parametrize("notebook", NOTEBOOKS)
def test_every_cell_runs_and_what_it_ends_in_has_a_table_for_a_notebook(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document = json.loads((DOCS / f"{notebook}.ipynb").read_text(encoding="utf-8"))
    assert document["nbformat"] == 4
    names: dict[str, object] = {}
    shown: list[str] = []
    for cell in (one for one in document["cells"] if one["cell_type"] == "code"):
        assert cell["outputs"] == [], "outputs are made by running it, not stored"
        body = ast.parse("".join(cell["source"])).body
        last = body[-1]
        code = body[:-1] if isinstance(last, ast.Expr) else body
        exec(compile(ast.Module(code, []), cell["id"], "exec"), names)
        if isinstance(last, ast.Expr):
            value: Any = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)
            if hasattr(value, "_repr_html_"):
                shown.append(value._repr_html_())
    assert len(shown) == NOTEBOOKS[notebook]
    if shown:
        assert "fit for use" in shown[-1]
        assert shown[-1].count("<tr>") > 18


def test_every_notebook_runs_here() -> None:
    assert {path.stem for path in DOCS.glob("*.ipynb")} == set(NOTEBOOKS)
