"""The shape checks of the tests are on: a wrong shape is refused, and compiled kernels still compile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from tumble.recording.recording import Recording


def test_an_array_of_the_wrong_shape_is_refused() -> None:
    with pytest.raises(TypeCheckError, match="time"):
        Recording(
            time=np.zeros((4, 3)),
            specific_force=np.zeros((4, 3)),
            angular_rate=None,
            specific_force_unit="m/s²",
            angular_rate_unit="rad/s",
            rate=100.0,
        )


def test_a_whole_number_serves_as_a_float() -> None:
    recording = Recording(
        time=np.arange(4.0),
        specific_force=np.zeros((4, 3)),
        angular_rate=None,
        specific_force_unit="m/s²",
        angular_rate_unit="rad/s",
        rate=100,
    )
    assert recording.rate == 100


def test_compiled_kernels_are_not_wrapped(root: Path) -> None:
    from importlib import import_module

    modules = [
        ".".join(path.relative_to(root / "src").with_suffix("").parts)
        for path in (root / "src" / "tumble").rglob("kernels.py")
    ]
    assert modules
    for name in modules:
        loader = import_module(name).__loader__
        assert type(loader).__module__ != "jaxtyping._import_hook"
