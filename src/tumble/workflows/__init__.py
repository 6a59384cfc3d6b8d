"""What a user asks for, end to end: inspect, calibrate, apply, verify, demonstrate."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.workflows.apply import apply
    from tumble.workflows.calibrate import calibrate
    from tumble.workflows.verify import verify

__all__ = ["apply", "calibrate", "verify"]


def __getattr__(name: str) -> object:
    """Fetch a workflow from its module at first use.

    Raises
    ------
    AttributeError
        If there is no such workflow.
    """
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{name}"), name)
