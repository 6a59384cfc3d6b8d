"""The strapdown rotation test's page says what a missing sequence leaves undetermined."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tumble.protocol.strapdown_rotation import SEQUENCES, start_down
from tumble.sensor.conventions.savage import NAMES
from tumble_papers.savage.sequences import sequence_model, solve_measurements

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "procedures" / "strapdown-rotation.md"


def test_what_a_missing_sequence_leaves_untold_is_what_the_page_says() -> None:
    """The table of missing sequences, row by row, by least squares on the linear model."""
    text = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (any of [^|]*|1a, 2a or 3a|6|7, 9, 10, 12) \| ([^|]*) \|$", text, re.M)
    assert len(rows) == 4
    models = {row.name: sequence_model(row.rotations, start_down(row), 9.81) for row in SEQUENCES}
    said = {name: words for names, words in rows for name in re.findall(r"\d+a?", names)}
    assert set(said) == set(models)
    for gone, words in said.items():
        left = [model for name, model in models.items() if name != gone]
        each = [[np.round(m.coefficients[:, k], 9) for m in left] for k in range(24)]  # of one error alone
        found = [solve_measurements(left, shown, [np.eye(5) for _ in left]) for shown in each]
        untold = [name for k, name in enumerate(NAMES) if found[k][k] < 1.0 - 1e-6]
        if gone.endswith("a"):
            assert [name.split()[0] for name in untold] == ["kappa", "kappa"]
        elif words.startswith("nothing"):
            assert untold == []
        else:
            greek = [name.replace("upsilon ", "υ").replace("mu ", "μ") for name in untold]
            assert greek
            assert all(name in words for name in greek)
