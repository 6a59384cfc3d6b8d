"""The strapdown rotation test's page: figure and table are those of the published medians, its step is one."""

from __future__ import annotations

import re
import shutil
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tumble.calibration.closed_forms.rotation_sequences import sequence_model
from tumble.calibration.closed_forms.sequence_inversion import solve_measurements
from tumble.protocol import read_protocol, sequence_steps
from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "procedures" / "strapdown-rotation.md"


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = spec_from_file_location("strapdown_uncertainty", DOCS / "figures" / "strapdown_uncertainty.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec.loader.exec_module(module)
    # The figure has a fourth grade, which the module of the other figure is not to keep.
    monkeypatch.setattr(module.expected_uncertainty, "GRADES", dict(module.expected_uncertainty.GRADES))
    return module


def test_figure_and_table_are_drawn_from_the_published_medians(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: ModuleType
) -> None:
    figures, procedures = tmp_path / "figures", tmp_path / "procedures"
    figures.mkdir()
    procedures.mkdir()
    shutil.copy(PAGE, procedures)
    monkeypatch.setattr(module, "FOLDER", figures)
    monkeypatch.setattr(sys, "argv", ["strapdown_uncertainty.py", "--draw"])
    module.main()
    for path in (figures / "strapdown-uncertainty.svg", procedures / PAGE.name):
        published = DOCS / path.relative_to(tmp_path)
        again = "run docs/figures/strapdown_uncertainty.py --draw"
        assert path.read_text(encoding="utf-8") == published.read_text(encoding="utf-8"), again


def test_the_sequence_on_the_page_is_row_8_of_table_1(tmp_path: Path) -> None:
    (steps,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    head = "format: tumble protocol\nversion: 1\nname: mine\nprocedure: strapdown-rotation\n"
    path = tmp_path / "protocol.yaml"
    path.write_text(head + "site:\n  latitude_deg: 48\n  height_m: 500\nsteps:\n" + steps)
    (sequence,) = sequence_steps(read_protocol(path))
    assert sequence.name == "8"


def test_what_a_missing_sequence_leaves_untold_is_what_the_page_says() -> None:
    """The table of missing sequences, row by row, by least squares on the linear model."""
    text = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (any of [^|]*|1a, 2a or 3a|6|7, 9, 10, 12) \| ([^|]*) \|$", text, re.M)
    assert len(rows) == 4
    models = {row.name: sequence_model(row.rotations, start_down(row), 9.81) for row in SEQUENCES}
    said: dict[str, str] = {}
    for names, words in rows:
        for name in re.findall(r"\d+a?", names.removeprefix("any of ")):
            said[name] = words
    assert set(said) == set(models)
    for gone, words in said.items():
        left = [model for name, model in models.items() if name != gone]
        solution = solve_measurements(left, [m.coefficients[:, 0] for m in left], [np.eye(5) for _ in left])
        untold = [name for name, told in zip(NAMES, solution.determined, strict=True) if not told]
        if gone.endswith("a"):
            assert [name.split()[0] for name in untold] == ["kappa", "kappa"]
        elif words.startswith("nothing"):
            assert untold == []
        else:
            greek = [name.replace("upsilon ", "υ").replace("mu ", "μ") for name in untold]
            assert greek
            assert all(name in words for name in greek)
