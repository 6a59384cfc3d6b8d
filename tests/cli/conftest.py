"""A user's folder with a good recording in it, `tumbled.csv`, and its calibration, `calibrated`."""

import shutil

import pytest
from tests.cli.program import GRAVITY, Bench, tumbled_rows


@pytest.fixture(scope="session")
def rows():
    """The rows of the good recording; tests copy them before they spoil them."""
    return tumbled_rows(3)


@pytest.fixture(scope="session")
def good(tmp_path_factory, rows):
    """Where the good recording was calibrated, once."""
    bench = Bench(tmp_path_factory.mktemp("good"))
    bench.write("tumbled.csv", rows)
    bench("calibrate tumbled.csv -o calibrated --gravity", str(GRAVITY))
    return bench


@pytest.fixture
def tumble(good, tmp_path):
    (tmp_path / "calibrated").mkdir()
    for name in ("tumbled.csv", "calibrated/calibration.json"):
        shutil.copyfile(good.folder / name, tmp_path / name)
    return Bench(tmp_path)


@pytest.fixture
def bench(tmp_path):
    """An empty folder."""
    return Bench(tmp_path)
