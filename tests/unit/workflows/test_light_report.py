"""A light report uses a plotting library that lies beside it, and writes one only where there is none."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tumble.errors import UsageError
from tumble.report.html import LIBRARY
from tumble.workflows import calibrate
from tumble.workflows.calibrate import write_run


def test_a_library_is_written_once_and_shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def named(run: Any, library: str | None) -> str:
        return f"with {library}"

    monkeypatch.setattr(calibrate, "report_of", named)
    run: Any = SimpleNamespace(calibration=SimpleNamespace(to_json=lambda: "{}"), files=[])

    def written(name: str, form: str) -> tuple[str, bool]:
        write_run(run, tmp_path / name, form)
        return (tmp_path / name / "report.html").read_text(), (tmp_path / name / LIBRARY).exists()

    assert written("whole", "full") == ("with None", False)
    assert written("alone", "light") == (f"with {LIBRARY}", True)
    before = (tmp_path / "alone" / LIBRARY).stat().st_mtime_ns
    assert written("alone", "light") == (f"with {LIBRARY}", True)
    assert (tmp_path / "alone" / LIBRARY).stat().st_mtime_ns == before
    (tmp_path / "alone" / LIBRARY).rename(tmp_path / LIBRARY)
    assert written("beside", "light") == (f"with ../{LIBRARY}", False)


def test_another_form_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--report heavy: give full or light"):
        calibrate.calibrate(tmp_path / "none.csv", report="heavy")
