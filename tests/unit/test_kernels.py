"""Compiled loops do what their sources say when run as Python, and their stubs name what they have."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tumble.errors import NotBuiltError, require_compiled

SOURCES = sorted(Path(__file__).resolve().parents[2].glob("src/**/*.pyi"))


def _functions(path: Path) -> dict[str, list[str]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {f.name: [a.arg for a in f.args.args] for f in functions if "cfunc" not in ast.dump(f)}


@pytest.mark.parametrize("stub", SOURCES, ids=lambda p: p.parent.name)
def test_a_stub_names_the_functions_of_its_source(stub: Path) -> None:
    public = {name: names for name, names in _functions(stub.with_suffix(".py")).items() if name[0] != "_"}
    assert public
    assert _functions(stub) == public


def test_a_source_run_as_python_is_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(NotBuiltError, match="make kernels"):
        require_compiled(str(tmp_path / "kernels.py"))
    require_compiled(importlib.import_module("tumble.attitude.kernels").__file__ or "")


def _both(
    as_python: Callable[[str], ModuleType], module: str, function: str, arguments: Callable[[], list[object]]
) -> None:
    """Run a function compiled and as Python on equal arguments, and hold all of them side by side afterwards."""
    given = [arguments(), arguments()]
    answers = [
        getattr(maker(module), function)(*own)
        for maker, own in zip((importlib.import_module, as_python), given, strict=True)
    ]
    assert answers[0] == answers[1]
    for compiled, python in zip(*given, strict=True):
        np.testing.assert_allclose(compiled, python, rtol=1e-12, atol=1e-13)  # pyright: ignore[reportArgumentType]


def test_attitude(as_python: Callable[[str], ModuleType]) -> None:
    def turns() -> list[object]:
        rng = np.random.default_rng(1)
        rate, force = rng.normal(0.0, 20.0, (99, 3)), rng.normal(0.0, 9.0, (99, 3))
        inverse, coupling = np.eye(3) + 0.1 * rng.random((3, 3)), 1e-3 * rng.random((3, 3))
        ranges = np.array([2, 18]), np.array([17, 99])
        time = np.cumsum(rng.uniform(0.001, 0.03, 99))
        bias = rng.random(3)
        results = np.zeros((2, 3, 3)), np.zeros((2, 3, 3, 7))
        return [
            time,
            rate,
            force,
            inverse,
            bias,
            coupling,
            inverse.T.copy(),
            bias[::-1].copy(),
            *ranges,
            *results,
        ]

    _both(as_python, "tumble.attitude.kernels", "integrate_segments", turns)


def test_noise(as_python: Callable[[str], ModuleType]) -> None:
    def sums() -> list[object]:
        return [np.random.default_rng(2).normal(0.0, 1.0, 301).cumsum(), np.array([1, 3, 40]), np.zeros(3)]

    _both(as_python, "tumble.noise.kernels", "second_difference_squares", sums)


def test_estimation(as_python: Callable[[str], ModuleType]) -> None:
    def chain() -> list[object]:
        rng = np.random.default_rng(3)
        half = rng.normal(0.0, 0.1, (4, 3, 3))
        diagonal = np.eye(3) + half @ half.transpose(0, 2, 1)
        lower, border = rng.normal(0.0, 0.1, (3, 3, 3)), rng.normal(0.0, 0.1, (4, 3, 2))
        return [diagonal, lower, border, rng.random((4, 3))]

    _both(as_python, "tumble.estimation.kernels", "eliminate", chain)


def test_segmentation(as_python: Callable[[str], ModuleType]) -> None:
    def blocks() -> list[object]:
        signal = np.random.default_rng(4).normal(0.0, 1.0, (70, 3))
        return [signal, 5, np.zeros((14, 3)), np.zeros((14, 3), dtype=np.float32)]

    def smoothed() -> list[object]:
        return [np.random.default_rng(5).normal(0.0, 1.0, (14, 3)), 4, np.zeros((14, 3))]

    _both(as_python, "tumble.segmentation.kernels", "block_moments", blocks)
    _both(as_python, "tumble.segmentation.kernels", "triangle_smooth", smoothed)
