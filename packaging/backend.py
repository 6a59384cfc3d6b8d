"""The build back end: setuptools, with a compiler from the package index where the machine has none."""

from __future__ import annotations

import os
import shutil
import sysconfig
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import build_editable, build_sdist, build_wheel, get_requires_for_build_sdist

Settings = dict[str, Any] | None


def compiler() -> list[str]:
    """Return what has to be installed to compile: nothing where Python's own compiler, or `cc`, is found.

    A wheel for another machine (`make wheels`) is compiled by the package index's compiler.
    """
    if os.environ.get("TUMBLE_WHEEL"):
        return ["ziglang>=0.13"]
    own = (sysconfig.get_config_var("CC") or "cc").split()[0]
    return [] if sysconfig.get_platform().startswith("win") or shutil.which(own) else ["ziglang>=0.13"]


def get_requires_for_build_wheel(settings: Settings = None) -> list[str]:
    """Return what a wheel is built with."""
    return [*build_meta.get_requires_for_build_wheel(settings), *compiler()]


def get_requires_for_build_editable(settings: Settings = None) -> list[str]:
    """Return what an editable installation is built with."""
    return [*build_meta.get_requires_for_build_editable(settings), *compiler()]


__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
]
