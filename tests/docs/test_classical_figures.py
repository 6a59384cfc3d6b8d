"""The figure and the tables of the classical procedures' pages are those of the published medians."""

from __future__ import annotations

import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = ("six-position", "rate-table", "modified-multi-position")


def test_figure_and_tables_are_drawn_from_the_published_medians(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = spec_from_file_location("classical_uncertainty", DOCS / "figures" / "classical_uncertainty.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec.loader.exec_module(module)
    figures, procedures = tmp_path / "figures", tmp_path / "procedures"
    figures.mkdir()
    procedures.mkdir()
    for page in PAGES:
        shutil.copy(DOCS / "procedures" / f"{page}.md", procedures)
    monkeypatch.setattr(module, "FOLDER", figures)
    monkeypatch.setattr(sys, "argv", ["classical_uncertainty.py", "--draw"])
    module.main()
    drawn = [figures / "classical-uncertainty.svg", *(procedures / f"{page}.md" for page in PAGES)]
    for path in drawn:
        published = DOCS / path.relative_to(tmp_path)
        again = "run docs/figures/classical_uncertainty.py --draw"
        assert path.read_text(encoding="utf-8") == published.read_text(encoding="utf-8"), again
