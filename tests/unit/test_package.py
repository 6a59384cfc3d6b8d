"""The front of the package: its names are there, and asking for it costs nothing."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import pytest

import tumble


@pytest.mark.parametrize("name", tumble.__all__)
def test_every_public_name_resolves(name: str) -> None:
    assert getattr(tumble, name) is not None


def test_public_names_show_in_dir() -> None:
    assert set(tumble.__all__) <= set(dir(tumble))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = tumble.calibrat  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_the_package_imports_no_other_library() -> None:
    heavy = ("numpy", "scipy", "numba", "polars", "pydantic", "typer", "rich", "plotly", "yaml")
    code = f"import sys, tumble; print([m for m in {heavy!r} if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_the_installed_version_is_the_package_s_own() -> None:
    assert version("tumble") == tumble.__version__


def test_a_workflow_is_a_function_though_its_module_has_the_same_name() -> None:
    code = (
        "import tumble.workflows.demo, tumble.workflows.verify, tumble.workflows.apply, tumble.workflows.simulate, "
        "tumble; print(all(map(callable, [tumble.calibrate, tumble.verify, tumble.apply, tumble.simulate])))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "True"
