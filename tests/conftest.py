"""What every test stands on: shapes are checked, examples are the same every time, data are found."""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

# Before tumble.arrays is first imported. The slow tests set it empty: they run the same code at length, unchecked.
os.environ.setdefault("TUMBLE_CHECK_SHAPES", "1")
# Of a program that a test starts too: a warning of numpy is a fault, and ends it.
os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line sets it; before numpy is imported

# Started in the background, with Ctrl-C ignored, a shell's programs ignore it too; tests of Ctrl-C start such programs.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import hypothesis
import jaxtyping
import pytest
from jaxtyping import install_import_hook

# The rooms that numbers pass through. The outer rooms import lazily, so that names in their
# annotations may not exist while they run, and have no shapes to check.
CHECKED_ROOMS = (
    "attitude",
    "earth",
    "sensor",
    "recording",
    "estimation",
    "noise",
    "segmentation",
    "simulation",
    "navigation",
    "calibration",
    "document",
    "design",
)


# An int is a float, as type checkers have it (PEP 484).
CHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
# Of each function, in each test. A solver makes thousands of calls: to check them all doubled the time of the suite.
CHECKED_CALLS = 20


class _CheckedFirst:
    """Checks the first calls of every function in each test."""

    test = 0
    checking = staticmethod(jaxtyping.jaxtyped)

    @classmethod
    def jaxtyped(cls, *, typechecker: Any) -> Callable[[Any], Any]:
        """Return what decorates a function or a class so that its first calls in a test are checked."""

        def decorate(made: Any) -> Any:
            if not inspect.isclass(made):
                return cls._first(made, cls.checking(made, typechecker=typechecker))
            plain: Any = made.__init__
            checked = cls.checking(made, typechecker=typechecker)
            if checked.__init__ is not plain:
                checked.__init__ = cls._first(plain, checked.__init__)
            return checked

        return decorate

    @classmethod
    def _first(cls, plain: Callable[..., Any], checked: Callable[..., Any]) -> Callable[..., Any]:
        test, calls = -1, 0

        @functools.wraps(plain)
        def call(*arguments: Any, **named: Any) -> Any:
            nonlocal test, calls
            if test != cls.test:
                test, calls = cls.test, 0
            if calls >= CHECKED_CALLS:
                return plain(*arguments, **named)
            calls += 1
            return checked(*arguments, **named)

        return call


def check_shapes() -> None:
    """Check every annotated shape of the core rooms at run time, compiled kernels excepted."""
    already = [name for name in sys.modules if name.startswith("tumble.")]
    if already:
        raise RuntimeError(f"{already[0]} was imported before its shapes could be checked.")
    jaxtyping.jaxtyped = _CheckedFirst.jaxtyped
    hook = install_import_hook([f"tumble.{room}" for room in CHECKED_ROOMS], CHECKER).hook
    instruments = hook.should_instrument
    # Run as Python they hold sources of Cython, whose annotations are C types.
    hook.should_instrument = lambda name: instruments(name) and not name.endswith(("kernels", "_kernel"))


if os.environ["TUMBLE_CHECK_SHAPES"]:
    check_shapes()


def pytest_runtest_setup() -> None:
    """Check the first calls anew."""
    _CheckedFirst.test += 1


def pytest_runtest_teardown() -> None:
    """Fail a test that leaves stops ignored: a program that a later test starts would ignore them, too."""
    left = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is signal.SIG_IGN]
    for number in left:
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.default_int_handler)
    assert not left, "call a command by tumble.cli.main, which hears stops again at its end"


hypothesis.settings.register_profile(
    "tumble",
    derandomize=True,  # the same examples every time: a red test stays red until it is mended
    deadline=None,  # the first example imports
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("tumble")

ROOT = Path(__file__).resolve().parent.parent


def refuse_stale_kernels() -> None:
    """End with a sentence if the compiled loops are not those of their sources."""
    built = ROOT / "build" / "kernels.sha256"
    if not (ROOT / "src").exists() or not Path(sys.modules["tumble"].__file__ or "").is_relative_to(ROOT):
        return
    lines = built.read_text(encoding="utf-8").splitlines() if built.exists() else ["  setup.py"]
    for line in lines:
        digest, name = line.split("  ", 1)
        if not (ROOT / name).exists() or hashlib.sha256((ROOT / name).read_bytes()).hexdigest() != digest:
            pytest.exit(f"The compiled loops were not built from {name} as it is now: run `make kernels`.", 2)


def pytest_sessionstart() -> None:
    """Begin with compiled loops that are those of their sources."""
    import tumble  # noqa: F401 (says where it is)

    refuse_stale_kernels()


# Whole calibrations of simulated tests, many times over: `make test` leaves them to `make test-all`.
SLOW_FOLDERS = ("recovery", "statistics", "unit/papers")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of a slow folder as slow."""
    slow = tuple(ROOT / "tests" / folder for folder in SLOW_FOLDERS)
    for item in items:
        if any(folder in item.path.parents for folder in slow):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's top folder."""
    return ROOT


@pytest.fixture(scope="session")
def reference_data() -> Path:
    """The folder of reference sets; each has its data and a SOURCE.md."""
    return ROOT / "tests" / "reference"


@pytest.fixture(scope="session")
def as_python() -> Callable[[str], ModuleType]:
    """A function that gives the source of compiled loops as plain Python, by the module's name."""

    def load(name: str) -> ModuleType:
        path = ROOT / "src" / f"{name.replace('.', '/')}.py"
        module = ModuleType(name)
        module.__file__ = f"{path}, as Python"
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), module.__dict__)
        return module

    return load
