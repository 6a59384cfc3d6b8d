"""The front in Python: its names, what is passed by mistake, places and notes, and what results show of themselves."""

from __future__ import annotations

import inspect
import json
import math
import re
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import threadpoolctl
from msgspec import structs
from tests.laws.test_frame_and_difference import document as stated_in_full
from tests.unit.export import a_unit
from tests.unit.given import given as known

import tumble
from tumble.border import border
from tumble.document import turned_to
from tumble.errors import SiteError, TumbleError, UsageError, install
from tumble.sensor import ImuModel, Triad
from tumble.workflows.calibrate import CalibrationRun
from tumble.workflows.given import choose_site
from tumble.workflows.plan import information_of
from tumble.workflows.request import THREADS_OF, StreamRequest, asked, matched, notes_of, one_thread
from tumble.workflows.verify import force_wander, norm_covariance

# --- the names


def printed(code: str, folder: Path | None = None) -> str:
    """What a program of its own prints, where the tests' shape checks are off, as they are for users."""
    made = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    return made.stdout.strip()


def test_every_public_name_resolves_and_shows_in_dir_and_its_function_stands_behind_the_border() -> None:
    assert set(tumble.__all__) <= set(dir(tumble))
    assert version("tumble") == tumble.__version__
    functions = [one for name in tumble.__all__ if inspect.isfunction(one := getattr(tumble, name))]
    assert len(functions) >= 9
    for function in functions:
        with pytest.raises(UsageError, match="has no option sight"):
            function(sight=1)
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = tumble.calibrat  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_the_package_imports_no_other_library_and_a_workflow_is_a_function() -> None:
    """Though its module has the same name."""
    heavy = ("numpy", "scipy", "polars", "msgspec", "typer", "rich", "plotly", "yaml", "jinja2")
    assert printed(f"import sys, tumble; print([m for m in {heavy!r} if m in sys.modules])") == "[]"
    names = ("calibrate", "verify", "apply", "simulate")
    modules = ", ".join(f"tumble.workflows.{name}" for name in names)
    assert printed(
        f"import {modules}, tumble; print([callable(getattr(tumble, n)) for n in {names}])"
    ) == str([True] * 4)


def test_an_extra_is_named_by_its_packages_which_does_in_a_clone_too() -> None:
    assert install("fleet").startswith("pip install distributed")
    assert "'psycopg[binary]'" in install("registry")
    assert install("no-such-extra") == "pip install 'tumble[no-such-extra]'"


# --- what is passed by mistake


def read(path: str | Path, rate: float | None = None, *, columns: str | None = None) -> str:
    """Stand in for a public function; the tests' own check of arguments does not reach it."""
    return f"{path} {rate} {columns}"


CHECKED: Any = border(read)
NO_SITE: Any = (48.1, 520.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: CHECKED("a.csv", sight=1), "has no option sight"),
        (lambda: CHECKED("a.csv", column="t"), "Is columns meant"),
        (lambda: CHECKED(), "missing a required argument: 'path'"),
        (lambda: CHECKED("a.csv", "fast"), "rate is 'fast', of the type str: give a number"),
        (lambda: CHECKED("a.csv", columns=5), "columns is 5, of the type int: give text"),
        (lambda: tumble.calibrate("no.csv", site=NO_SITE), "site is a tuple: give a tumble.Site, as tumble"),
    ],
)
def test_what_is_passed_by_mistake_is_refused_in_a_sentence(call: Any, said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        call()


def test_what_is_meant_passes_the_border(tmp_path: Path) -> None:
    assert CHECKED("a.csv", 5) == "a.csv 5 None"
    assert CHECKED("a.csv", np.float64(5.0), columns="t") == "a.csv 5.0 t"
    assert inspect.signature(CHECKED) == inspect.signature(read)
    np.savetxt(tmp_path / "a.csv", np.zeros((5, 7)), delimiter=",")
    with pytest.raises(TumbleError, match=r"--topic /imu: a\.csv is text"):  # a mere string is one topic
        tumble.read_recording(tmp_path / "a.csv", topics="/imu")


@pytest.fixture
def calibration() -> tumble.Calibration:
    """Misalignments of ten milliradians, which PX4 does not hold."""
    matrix = np.array([[1.01, 0.0, 0.0], [0.01, 0.99, 0.0], [0.004, -0.01, 1.0]])
    model = ImuModel(Triad(matrix, np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    return a_unit.document(model)


SHAPES = """
import numpy as np
import tumble

calibration, rows = tumble.read_calibration("calibration.json"), np.zeros((5, 3))
for given in ((rows.T,), (rows[0],), (rows, rows[:4]), (rows, rows, np.zeros(6)), ([["a", 0, 0]],)):
    try:
        calibration.correct(*given)
    except tumble.TumbleError as error:
        print(error)
print(calibration.correct(rows.tolist())[0].shape)
"""


def test_arrays_of_a_wrong_shape_are_refused_in_a_sentence(calibration, tmp_path):
    calibration.write(tmp_path / "calibration.json")
    said = printed(SHAPES, tmp_path).splitlines()
    for line, words in zip(
        said,
        (
            ("raw_specific_force has the shape (3, 5)", "turn it round (.T)"),
            ("raw_specific_force has the shape (3,)", "of one sample (1, 3)"),
            ("(raw_specific_force 5, raw_angular_rate 4): give as many",),
            ("(raw_specific_force 5, raw_angular_rate 5, time 6): give as many",),
            ("raw_specific_force holds something that is no number",),
            ("(5, 3)",),
        ),
        strict=True,
    ):
        assert all(word in line for word in words), line


def test_a_conversion_takes_its_limit_by_name(calibration: tumble.Calibration, tmp_path: Path) -> None:
    with pytest.raises(TumbleError, match="cannot hold this calibration"):
        tumble.convert_to(calibration, "px4", output=tmp_path / "a.params", largest_loss=0.001)
    tumble.convert_to(calibration, "px4", output=tmp_path / "a.params", largest_loss=0.1)
    assert "CAL_ACC0_XOFF" in (tmp_path / "a.params").read_text()


# --- places and notes


def place(site: str | None, gravity: str | None = None) -> tumble.Site:
    return known(choose_site(site, gravity))


def test_a_latitude_gives_normal_gravity_and_gravity_is_good_to_its_digits_or_to_what_is_said() -> None:
    """WGS 84 at 45°: 9.80620 m/s² (NGA.STND.0036); 1000 m higher 3.086e-3 m/s² less."""
    assert place("45").latitude == pytest.approx(math.pi / 4)
    assert place("45,0").gravity == pytest.approx(9.80620, abs=1e-5)
    assert place("45").gravity == pytest.approx(9.80620 - 500 * 3.086e-6, abs=1e-5)
    assert place("45,0").gravity - place("45,1000").gravity == pytest.approx(3.086e-3, rel=2e-3)
    alone = place(None, "9.8120")
    assert (alone.gravity, alone.latitude) == (9.812, None)
    assert alone.gravity_sigma == pytest.approx(0.00005 / math.sqrt(3.0))
    assert place(None, "9.81203±0.00002").gravity_sigma == 2e-5
    both = place("-33.9,20", "9.797")
    assert (both.gravity, both.height) == (9.797, 20.0)
    assert both.latitude == pytest.approx(math.radians(-33.9))
    # of two digits less is known than of the place
    assert place("-33.9,20", "9.80") == place("-33.9,20")
    with pytest.raises(SiteError, match="contradicts"):
        choose_site("0", "9.83")
    for text in ("here", "", "1,2,3", "nan", "inf,0", "45;100", "45,"):
        with pytest.raises(UsageError, match=r"48\.1,520"):
            choose_site(text, None)


def test_notes_keep_their_order_and_their_values_and_names_are_small_letters() -> None:
    noted = notes_of(["Place=hall 2", "operator= A. Smith ", "remarks=a=b, c"])
    assert list(noted.items()) == [("place", "hall 2"), ("operator", "A. Smith"), ("remarks", "a=b, c")]
    assert notes_of({"Instrument": "table 7"}) == {"instrument": "table 7"}
    assert notes_of("operator=Smith") == {"operator": "Smith"}
    assert notes_of(None) == {}
    for given, said in (
        (["operator"], "give a name and a value"),
        (["=Smith"], "give a name and a value"),
        (["operator= "], "give a name and a value"),
        (["a=1", "A=2"], "--note a is given twice"),
        (["a=1\n2"], "line break"),
        (["a\x1b[2J=1"], "line break"),
    ):
        with pytest.raises(UsageError, match=said):
            notes_of(given)


# --- results


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("session")
    tumble.simulate("multi-position-18", output=made / "sim", site=tumble.Site.from_gravity(9.81), seed=3)
    (made / "sim" / "recording.csv").rename(made / "imu.csv")
    return made


@pytest.fixture(scope="module")
def help_run(folder: Path) -> dict[str, Any]:
    """The names of the example in `help(tumble)`, after it has run."""
    found = known(re.search(r"::\n\n(.*?)\n\n(?=\S)", known(tumble.__doc__), re.S))
    names: dict[str, Any] = {"raw_force": np.zeros((2, 3)), "raw_rate": np.zeros((2, 3))}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(textwrap.dedent(found[1]), names)
    return names


def test_the_example_of_help_runs_and_every_result_is_one_line(help_run: dict[str, Any]) -> None:
    run = help_run["run"]
    assert isinstance(run, CalibrationRun)
    assert help_run["force"].shape == (2, 3)
    for one in (run, run.calibration, run.recording, run.estimate, run.timeline, run.means):
        assert "\n" not in repr(one)
        assert len(repr(one)) < 400, repr(one)
    assert repr(run.timeline).startswith("<Timeline: 18 holds, ")
    assert f"{len(run.recording)} samples at 100 Hz" in repr(run.recording)
    assert ("NOT fit" in repr(run.calibration)) == (not run.calibration.verdict.fit)


def test_parameters_are_a_data_frame_and_figures_those_of_the_report(help_run, folder):
    frame, parameters = help_run["run"].to_frame(), help_run["calibration"].parameters
    assert frame.columns == ["parameter", "value", "standard_uncertainty", "unit"]
    assert frame.rows() == [(p.name, p.value, p.standard_uncertainty, p.unit) for p in parameters]
    page = (folder / "calibrated" / "report.html").read_text(encoding="utf-8")
    carried = json.loads(re.findall(r'id="figures">(.*?)</script>', page, re.S)[0])
    figures = help_run["run"].figures()
    assert list(figures) == [plot["name"] for plot in carried]
    assert len(figures["holds"].data) == len(carried[list(figures).index("holds")]["data"])


def test_residuals_three_times_what_is_explained_do_not_serve(folder: Path, help_run: dict[str, Any]) -> None:
    """Of another session of the unit a bias of b on each axis moves norms by up to b √3, by b rms over directions."""
    tumble.simulate("hand-held", output=folder / "two", unit=3, seed=2, rate=50.0)
    tumble.simulate("hand-held", output=folder / "one", unit=3, seed=1, rate=50.0)
    units = "m/s^2,rad/s,s"
    calibration = tumble.calibrate(folder / "one" / "recording.csv", units=units).calibration

    def shifted(bias: float) -> Any:
        rows = np.loadtxt(folder / "two" / "recording.csv", delimiter=",", skiprows=1)
        rows[:, 1:4] += bias
        path = folder / "shifted.csv"
        np.savetxt(path, rows, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
        return tumble.verify(calibration, path, units=units)[0]

    straight = shifted(0.0)
    assert straight.fit
    assert 1.0 <= straight.norm_freedom <= straight.hold_norm_error.size
    rms = float(np.sqrt(np.mean(straight.hold_norm_standard_uncertainty**2)))
    result = shifted(3.0 * rms)
    excess = float(np.sqrt(np.mean((result.hold_norm_error / result.hold_norm_standard_uncertainty) ** 2)))
    assert 2.0 < excess < 4.0
    assert not result.fit
    assert f"{excess:.1f} times what the calibration's own uncertainty" in result.reasons[0]


def test_the_expected_norm_counts_quadratic_terms(help_run: dict[str, Any]) -> None:
    """q u² more of an axis's raw output puts the norm off by as much along it."""
    calibration = help_run["calibration"]
    names, force, site = (
        ["accelerometer.quadratic[0]"],
        np.array([[9.8, 0.0, 0.0]]),
        tumble.Site.from_gravity(9.79),
    )
    both = (structs.replace(calibration, covariance_parameters=names, covariance=[[v]]) for v in (1e-8, 0.0))
    with_one, without = (float(norm_covariance(one, force, np.zeros(1), site, None)[0, 0]) for one in both)
    assert np.sqrt(with_one - without) == pytest.approx(1e-4 * 9.8**2, rel=0.05)


# --- linear algebra works on one thread inside a call, and on as many as before after it


def threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """A process in which nobody set the number, and the library takes two."""
    for name in THREADS_OF:
        monkeypatch.delenv(name, raising=False)
    assert np.linalg
    with threadpoolctl.threadpool_limits(2, "blas"):
        yield threads()


def test_a_call_of_the_front_takes_one_thread_or_what_the_user_set(two_threads, monkeypatch):
    def seen(_: StreamRequest) -> list[int]:
        return threads()

    assert 2 in two_threads
    assert set(asked(StreamRequest)(seen)()) == {1}
    assert threads() == two_threads
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with one_thread():
        assert threads() == two_threads


def test_calls_beside_each_other_leave_no_limit_behind(two_threads: list[int]) -> None:
    inside, leave = threading.Event(), threading.Event()

    def first() -> None:
        with one_thread():
            inside.set()
            leave.wait(30)

    other = threading.Thread(target=first)
    other.start()
    inside.wait(30)
    with one_thread():
        leave.set()
        other.join()
    assert threads() == two_threads


def test_a_plan_takes_what_is_known_from_a_calibration_in_a_fixture() -> None:
    """What a fixture's axes add is no matter of the thirty parameters: the accelerometers' own frame has the same."""
    both = (stated_in_full(), turned_to(stated_in_full(), "accelerometer-x"))
    known = [information_of(one).matrix for one in both]
    assert np.allclose(known[0], known[1], rtol=1e-6)
    assert np.linalg.matrix_rank(known[0]) > 20


def test_a_pattern_stands_for_the_files_that_it_matches(tmp_path: Path) -> None:
    for name in ("b.csv", "a.csv", "c.txt", "[1].csv"):
        (tmp_path / name).write_text("x")
    assert matched([tmp_path / "?.csv"]) == [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert matched([tmp_path / "[1].csv"]) == [tmp_path / "[1].csv"]  # a file of that name goes first
    with pytest.raises(UsageError, match=r"No file matches the pattern .*\*\.bag"):
        matched([tmp_path / "*.bag"])
    assert matched([tmp_path / "none.bag"]) == [tmp_path / "none.bag"]  # which reading says is not there


def test_of_turn_ons_biases_move_from_hold_to_hold_as_in_the_mean_of_them(help_run: dict[str, Any]) -> None:
    calibration = help_run["calibration"]
    moved = {f"accelerometer bias from hold to hold, m/s² ({day})": 3e-3 for day in ("monday", "tuesday")}
    quality = structs.replace(calibration.quality, variance_components=moved)
    of_two = structs.replace(calibration, quality=quality, turn_ons=SimpleNamespace(recordings=list(moved)))
    assert force_wander(of_two) == pytest.approx(3e-3)
