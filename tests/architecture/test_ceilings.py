"""The house grows no more: no figure is above its ceiling, and a ceiling falls with its figure."""

import importlib.util
import sys

import pytest


@pytest.fixture(scope="module")
def measure(root):
    spec = importlib.util.spec_from_file_location("measure_source", root / "benchmarks/measure_source.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def found(measure):
    return measure.figures(measure.read_modules())


def test_every_figure_is_at_its_ceiling(measure, found):
    """Above it something has to go, see ceilings.toml; below it `python benchmarks/measure_source.py --lower`."""
    assert {name: found[name] for name in measure.ceilings()} == {
        name: limit for name, (limit, _) in measure.ceilings().items()
    }


def test_every_module_stands_in_one_room(measure, found):
    rooms = [name for name in found if f"{name}: modules" in found]
    assert sum(found[name] for name in rooms) == found["code lines"]
    assert sum(found[f"{name}: modules"] for name in rooms) == found["modules"]
