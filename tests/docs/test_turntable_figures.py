"""The figure and the tables of the turntable's and the laboratory's pages are those of the published medians."""

from __future__ import annotations

import re
import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from tumble.protocol import read_protocol

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = ("turntable", "laboratory")


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = spec_from_file_location("turntable_uncertainty", DOCS / "figures" / "turntable_uncertainty.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec.loader.exec_module(module)
    # The figure has a fourth grade, which the module of the other figure is not to keep.
    monkeypatch.setattr(module.expected_uncertainty, "GRADES", dict(module.expected_uncertainty.GRADES))
    return module


def test_figure_and_tables_are_drawn_from_the_published_medians(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: ModuleType
) -> None:
    figures, procedures = tmp_path / "figures", tmp_path / "procedures"
    figures.mkdir()
    procedures.mkdir()
    for page in PAGES:
        shutil.copy(DOCS / "procedures" / f"{page}.md", procedures)
    monkeypatch.setattr(module, "FOLDER", figures)
    monkeypatch.setattr(sys, "argv", ["turntable_uncertainty.py", "--draw"])
    module.main()
    drawn = [figures / "turntable-uncertainty.svg", *(procedures / f"{page}.md" for page in PAGES)]
    for path in drawn:
        published = DOCS / path.relative_to(tmp_path)
        again = "run docs/figures/turntable_uncertainty.py --draw"
        assert path.read_text(encoding="utf-8") == published.read_text(encoding="utf-8"), again


@pytest.mark.parametrize("page", PAGES)
def test_the_steps_on_the_pages_are_steps_of_a_protocol(page: str, tmp_path: Path) -> None:
    text = (DOCS / "procedures" / f"{page}.md").read_text(encoding="utf-8")
    steps = re.findall(r"^```yaml\n(.*?)^```$", text, re.M | re.S)
    assert len(steps) == 1
    head = f"format: tumble protocol\nversion: 1\nname: mine\nprocedure: {page}\nsite:\n  gravity: 9.81\nsteps:\n"
    path = tmp_path / "protocol.yaml"
    path.write_text(head + steps[0])
    protocol = read_protocol(path)
    assert protocol.procedure == page
    assert len(protocol.steps) == 2
