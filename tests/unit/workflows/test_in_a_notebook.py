"""What a plain session and a notebook show of results: one line, a data frame, figures; and help that runs."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tumble
from tumble.border import border
from tumble.errors import UsageError
from tumble.workflows.calibrate import CalibrationRun


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from tumble.workflows.simulate import simulate

    made = tmp_path_factory.mktemp("session")
    simulate("multi-position-18", output=made / "sim", site=tumble.Site.from_gravity(9.81), seed=3)
    (made / "sim" / "recording.csv").rename(made / "imu.csv")
    return made


@pytest.fixture(scope="module")
def help_run(folder: Path) -> dict[str, Any]:
    """The names of the example in `help(tumble)`, after it has run."""
    assert tumble.__doc__ is not None
    found = re.search(r"::\n\n(.*?)\n\n(?=\S)", tumble.__doc__, re.S)
    assert found is not None
    names: dict[str, Any] = {"raw_force": np.zeros((2, 3)), "raw_rate": np.zeros((2, 3))}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(textwrap.dedent(found[1]), names)
    return names


def test_the_example_of_help_runs(help_run: dict[str, Any], folder: Path) -> None:
    assert isinstance(help_run["run"], CalibrationRun)
    assert (folder / "calibrated" / "report.html").exists()
    assert help_run["force"].shape == (2, 3)


def test_every_result_is_one_line(help_run: dict[str, Any]) -> None:
    run = help_run["run"]
    for one in (run, run.calibration, run.recording, run.estimate, run.timeline, run.means):
        assert "\n" not in repr(one)
        assert len(repr(one)) < 400, repr(one)
    assert repr(run.timeline).startswith("<Timeline: 18 holds, ")
    assert f"{len(run.recording)} samples at 100 Hz" in repr(run.recording)
    assert ("NOT fit" in repr(run.calibration)) == (not run.calibration.verdict.fit)


def test_parameters_are_a_data_frame(help_run: dict[str, Any]) -> None:
    frame, calibration = help_run["run"].to_frame(), help_run["calibration"]
    assert frame.columns == ["parameter", "value", "standard_uncertainty", "unit"]
    assert frame["parameter"].to_list() == [p.name for p in calibration.parameters]
    assert frame["value"].to_list() == [p.value for p in calibration.parameters]
    assert frame["standard_uncertainty"].to_list() == [p.standard_uncertainty for p in calibration.parameters]


def test_figures_are_those_of_the_report(help_run: dict[str, Any], folder: Path) -> None:
    page = (folder / "calibrated" / "report.html").read_text(encoding="utf-8")
    carried = json.loads(re.findall(r'id="figures">(.*?)</script>', page, re.S)[0])
    figures = help_run["run"].figures()
    assert list(figures) == [plot["name"] for plot in carried]
    assert len(figures["holds"].data) == len(carried[list(figures).index("holds")]["data"])


def read(path: str | Path, rate: float | None = None, *, columns: str | None = None) -> str:
    """Stand in for a public function; the tests' own check of arguments does not reach it."""
    return f"{path} {rate} {columns}"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: CHECKED("a.csv", sight=1), "has no option sight"),
        (lambda: CHECKED("a.csv", column="t"), "Is columns meant"),
        (lambda: CHECKED(), "missing a required argument: 'path'"),
        (lambda: CHECKED("a.csv", "fast"), "rate is 'fast', of the type str: give a number"),
        (lambda: CHECKED("a.csv", columns=5), "columns is 5, of the type int: give text"),
    ],
)
def test_what_is_passed_by_mistake_is_refused_in_a_sentence(call: Any, said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        call()


def test_what_is_meant_passes_the_border() -> None:
    assert CHECKED("a.csv", 5) == "a.csv 5 None"
    assert CHECKED("a.csv", np.float64(5.0), columns="t") == "a.csv 5.0 t"
    assert inspect.signature(CHECKED) == inspect.signature(read)


CHECKED: Any = border(read)


def test_every_function_of_the_front_stands_behind_the_border() -> None:
    names = [name for name in tumble.__all__ if inspect.isfunction(getattr(tumble, name))]
    assert len(names) >= 9
    for name in names:
        with pytest.raises(UsageError, match="has no option sight"):
            getattr(tumble, name)(sight=1)
