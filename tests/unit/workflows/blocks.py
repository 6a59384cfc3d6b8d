"""A recording that comes in many blocks, whatever its size."""

from importlib import import_module
from typing import Any

import pytest

from tumble.recording import read_blocks


def cut(patch: pytest.MonkeyPatch, workflow: str, rows: int) -> None:
    """Let a workflow have every block as blocks of so many rows."""

    def blocks(*paths: Any, **how: Any) -> Any:
        for block in read_blocks(*paths, **how):
            for first in range(0, len(block), rows):
                yield block.between(first, min(first + rows, len(block)))

    patch.setattr(import_module(f"tumble.workflows.{workflow}"), "read_blocks", blocks)
