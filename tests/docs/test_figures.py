"""Figures and tables of the procedures' pages are those of the published medians; steps on them are a protocol's."""

from __future__ import annotations

import re
import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from tumble.protocol import read_protocol, sequence_steps

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize(
    ("script", "drawn", "pages"),
    [
        (
            "expected_uncertainty",
            ("motion", "uncertainty-by-poses", "uncertainty-by-seconds"),
            ("hand-held",),
        ),
        (
            "classical_uncertainty",
            ("classical-uncertainty",),
            ("six-position", "rate-table", "modified-multi-position"),
        ),
        ("turntable_uncertainty", ("turntable-uncertainty",), ("turntable", "laboratory")),
        ("strapdown_uncertainty", ("strapdown-uncertainty",), ("strapdown-rotation",)),
    ],
)
def test_figures_and_tables_are_drawn_from_the_published_medians(
    script: str,
    drawn: tuple[str, ...],
    pages: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    spec = spec_from_file_location(script, DOCS / "figures" / f"{script}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setitem(sys.modules, script, module)
    spec.loader.exec_module(module)
    if hasattr(module, "expected_uncertainty"):
        # These figures have a fourth grade, which the module of the first figure is not to keep.
        monkeypatch.setattr(module.expected_uncertainty, "GRADES", dict(module.expected_uncertainty.GRADES))
    figures, procedures = tmp_path / "figures", tmp_path / "procedures"
    figures.mkdir()
    procedures.mkdir()
    for page in pages:
        shutil.copy(DOCS / "procedures" / f"{page}.md", procedures)
    monkeypatch.setattr(module, "FOLDER", figures)
    monkeypatch.setattr(sys, "argv", [f"{script}.py", "--draw"])
    module.main()
    assert {path.stem for path in figures.iterdir()} == set(drawn)
    for path in [*figures.iterdir(), *procedures.iterdir()]:
        published = DOCS / path.relative_to(tmp_path)
        again = f"run docs/figures/{script}.py --draw"
        assert path.read_text(encoding="utf-8") == published.read_text(encoding="utf-8"), again


@pytest.mark.parametrize("page", ["turntable", "laboratory", "strapdown-rotation"])
def test_the_steps_on_a_page_are_steps_of_a_protocol(page: str, tmp_path: Path) -> None:
    (steps,) = re.findall(
        r"^```yaml\n(.*?)^```$", (DOCS / "procedures" / f"{page}.md").read_text("utf-8"), re.M | re.S
    )
    head = f"format: tumble protocol\nversion: 1\nname: mine\nprocedure: {page}\n"
    path = tmp_path / "protocol.yaml"
    path.write_text(f"{head}site:\n  latitude_deg: 48\n  height_m: 500\nsteps:\n{steps}", encoding="utf-8")
    protocol = read_protocol(path)
    assert protocol.procedure == page
    if page == "strapdown-rotation":
        assert [sequence.name for sequence in sequence_steps(protocol)] == ["8"]
    else:
        assert len(protocol.steps) == 2
