"""The front of the package: its names are there, and asking for it costs nothing."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import tumble
from tumble.document.imported import calibration_from_model
from tumble.sensor import ImuModel, Triad


@pytest.mark.parametrize("name", tumble.__all__)
def test_every_public_name_resolves(name: str) -> None:
    assert getattr(tumble, name) is not None


def test_public_names_show_in_dir() -> None:
    assert set(tumble.__all__) <= set(dir(tumble))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = tumble.calibrat  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_the_package_imports_no_other_library() -> None:
    heavy = ("numpy", "scipy", "polars", "msgspec", "typer", "rich", "plotly", "yaml", "jinja2")
    code = f"import sys, tumble; print([m for m in {heavy!r} if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_the_installed_version_is_the_package_s_own() -> None:
    assert version("tumble") == tumble.__version__


def test_a_workflow_is_a_function_though_its_module_has_the_same_name() -> None:
    code = (
        "import tumble.workflows.calibrate, tumble.workflows.verify, tumble.workflows.apply, tumble; "
        "import tumble.workflows.simulate; "
        "print(all(map(callable, [tumble.calibrate, tumble.verify, tumble.apply, tumble.simulate])))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "True"


def test_a_site_that_is_no_site_is_refused_with_how_to_make_one() -> None:
    with pytest.raises(tumble.TumbleError, match=r"site is a tuple: give a tumble\.Site, as tumble"):
        tumble.calibrate("none.csv", site=(48.1, 520.0))  # type: ignore[arg-type]  # on purpose


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


def test_arrays_of_a_wrong_shape_are_refused_in_a_sentence(
    calibration: tumble.Calibration, tmp_path: Path
) -> None:
    """In a process of its own, where the tests' shape checks are off, as they are for users."""
    calibration.write(tmp_path / "calibration.json")
    answer = subprocess.run(
        [sys.executable, "-c", SHAPES], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert answer.stdout.splitlines() == [
        "raw_specific_force has the shape (3, 5): give (samples, 3), one row a sample: turn it round (.T).",
        "raw_specific_force has the shape (3,): give (samples, 3), one row a sample, of one sample (1, 3).",
        (
            "The arrays have different numbers of samples (raw_specific_force 5, raw_angular_rate 4): "
            "give as many of each."
        ),
        (
            "The arrays have different numbers of samples (raw_specific_force 5, raw_angular_rate 5, time 6): "
            "give as many of each."
        ),
        "raw_specific_force holds something that is no number: give an array of (samples, 3).",
        "(5, 3)",
    ]


def test_a_conversion_takes_its_limit_by_name(calibration: tumble.Calibration, tmp_path: Path) -> None:
    with pytest.raises(tumble.TumbleError, match="cannot hold this calibration"):
        tumble.convert_to(calibration, "px4", output=tmp_path / "a.params", largest_loss=0.001)
    tumble.convert_to(calibration, "px4", output=tmp_path / "a.params", largest_loss=0.1)
    assert "CAL_ACC0_XOFF" in (tmp_path / "a.params").read_text()


def test_one_topic_may_be_a_mere_string(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.csv", np.zeros((5, 7)), delimiter=",")
    with pytest.raises(tumble.TumbleError, match=r"--topic /imu: a\.csv is text"):
        tumble.read_recording(tmp_path / "a.csv", topics="/imu")


@pytest.fixture
def calibration() -> tumble.Calibration:
    """Misalignments of ten milliradians, which PX4 does not hold."""
    matrix = np.array([[1.01, 0.0, 0.0], [0.01, 0.99, 0.0], [0.004, -0.01, 1.0]])
    model = ImuModel(Triad(matrix, np.zeros(3)), Triad(np.eye(3), np.zeros(3)))
    return calibration_from_model(
        model, ("m/s^2", "rad/s"), ("fixture", "axes"), [], procedure="by hand", remarks=[]
    )


def test_an_extra_is_named_by_its_packages_which_does_in_a_clone_too() -> None:
    from tumble.errors import install

    assert install("fleet").startswith("pip install distributed")
    assert "'psycopg[binary]'" in install("registry")
    assert install("no-such-extra") == "pip install 'tumble[no-such-extra]'"
