"""What all rooms stand on: units, arrays, records, counting, compiled loops, and the tests' own checks of shapes."""

from __future__ import annotations

import ast
import copy
import dataclasses
import importlib
import inspect
import math
import pickle
import time
from collections.abc import Callable, Iterator
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from tumble import counting, records
from tumble.arrays import block_means, extremes
from tumble.counting import Stage, about, counted, listening, part, stepped, time_words
from tumble.errors import NotBuiltError, UsageError, require_compiled
from tumble.recording import Recording
from tumble.units import (
    angle_increment_factor,
    angular_rate_factor,
    find_unit,
    known_units,
    specific_force_factor,
    time_factor,
    velocity_increment_factor,
)

# --- factors of units against numbers worked out by hand from their definitions

FACTORS: dict[Callable[[str], float | None], dict[str, float | None]] = {
    specific_force_factor: {
        "m/s^2": 1.0, "m/s²": 1.0, "M/S2": 1.0, "m s^-2": 1.0, "g": 9.80665, "mg": 0.00980665,
        "milli-g": 0.00980665, "Gal": 0.01, "cm/s^2": 0.01, "counts": None,
    },
    angular_rate_factor: {
        "rad/s": 1.0, "rad s^-1": 1.0, "deg/s": pi / 180, "°/s": pi / 180, "DPS": pi / 180,
        "mdeg/s": pi / 180_000, "deg/h": pi / 648_000, "rpm": pi / 30, "LSB": None,
    },
    time_factor: {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6, "NS": 1e-9},
    velocity_increment_factor: {"m/s": 1.0},
    angle_increment_factor: {"arcsec": pi / 648_000},
}  # fmt: skip


@pytest.mark.parametrize("factor", FACTORS)
def test_a_unit_has_its_defined_factor_and_an_unknown_one_is_refused(factor):
    for name, value in FACTORS[factor].items():
        rounded = value and pytest.approx(value, rel=1e-15)  # one or two roundings of a double
        assert factor(name) == rounded, name
    with pytest.raises(UsageError, match=r"'furlong' is not a known unit of .*; known are"):
        factor("furlong")


def test_every_known_name_of_a_unit_is_found_as_itself() -> None:
    for kind in ("specific force", "angular rate", "time", "velocity increment", "angle increment"):
        assert [find_unit(kind, name) for name in known_units(kind)] == list(known_units(kind))


# --- arrays


@pytest.mark.parametrize("shape", [(23,), (23, 3), (23, 2, 4), (4, 3), (0, 3)])
def test_means_of_blocks_are_the_means_of_their_rows(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).normal(5.0, 1.0, shape)
    means = block_means(values, 5)
    assert means.shape == (shape[0] // 5, *shape[1:])
    for k, mean in enumerate(means):
        assert np.allclose(mean, values[5 * k : 5 * k + 5].mean(axis=0), rtol=1e-15, atol=0.0)


def test_extremes_are_of_each_axis() -> None:
    low, high = extremes(np.array([[1.0, -2.0, 3.0], [0.5, 7.0, -3.0]]))
    assert (low.tolist(), high.tolist()) == ([0.5, -2.0, -3.0], [1.0, 7.0, 3.0])


# --- records are what `dataclasses` makes of the same class

MAKERS = pytest.mark.parametrize("maker", [dataclasses.dataclass, records.dataclass], ids=["library", "ours"])
KINDS = pytest.mark.parametrize("given", [{}, {"frozen": True}])


@records.dataclass(frozen=True)
class Kept:
    """At the top of a module, where pickle finds it."""

    place: int
    names: list[str] = dataclasses.field(default_factory=list)


def made(maker: Any, given: dict[str, bool]) -> Any:
    @maker(**given)
    class Base:
        first: int
        second: str = "two"

    @maker(**given)
    class Record(Base):
        """A record on another."""

        third: list[int] = dataclasses.field(default_factory=list)
        fourth: float = dataclasses.field(default=4.0, repr=False)

        def __post_init__(self) -> None:
            if self.first < 0:
                raise ValueError("first")

    return Record


@MAKERS
@KINDS
def test_a_record_is_made_and_compared_and_shown(maker: Any, given: dict[str, bool]) -> None:
    kind = made(maker, given)
    record = kind(1, third=[3])
    assert dataclasses.astuple(record) == (1, "two", [3], 4.0)
    assert record == kind(1, "two", [3]) != kind(2)
    assert record != (1, "two", [3], 4.0)
    assert repr(record).endswith(".Record(first=1, second='two', third=[3])")
    assert kind(1).third is not kind(1).third
    assert dataclasses.replace(record, first=5) == kind(5, third=[3])
    assert copy.deepcopy(record) == record
    assert kind.__match_args__ == ("first", "second", "third", "fourth")
    assert str(inspect.signature(kind)).replace("'", "") == (
        "(first: int, second: str = two, third: list[int] = <factory>, fourth: float = 4.0) -> None"
    )
    for call, error, words in (
        (lambda: dataclasses.replace(record, first=-1), ValueError, "first"),
        (kind, TypeError, "first"),
        (lambda: kind(1, fifth=5), TypeError, "fifth"),
    ):
        with pytest.raises(error, match=words):
            call()


@MAKERS
@KINDS
def test_what_may_be_set_and_hashed_is_the_same(maker: Any, given: dict[str, bool]) -> None:
    kind = made(maker, given)
    record = kind(1, third=())
    if given.get("frozen"):
        assert hash(record) == hash(kind(1, third=()))
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'first'"):
            record.first = 2
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'first'"):
            del record.first
    else:
        record.first = 2
        assert record == kind(2, third=())
        with pytest.raises(TypeError, match="unhashable"):
            hash(record)


@MAKERS
def test_what_a_class_defines_itself_stays(maker: Any) -> None:
    @maker(frozen=True)
    class Record:
        first: int

        def __eq__(self, other: object) -> bool:
            return True

        def __hash__(self) -> int:
            return 7

        def __repr__(self) -> str:
            return "itself"

    assert Record(1) == Record(2)
    assert (hash(Record(1)), repr(Record(1))) == (7, "itself")


def test_a_record_goes_to_another_process_and_a_class_on_it_without_fields_is_made() -> None:
    class Child(Kept):
        pass

    record = Kept(3, ["a"])
    assert pickle.loads(pickle.dumps(record)) == copy.copy(record) == record
    assert Child(1).names == []
    assert repr(Child(1)).endswith("Child(place=1, names=[])")


# --- how far work is, and how long the rest takes


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    monkeypatch.setattr(counting, "_OFTEN", -1.0)
    shares: list[float] = []
    with listening(shares.append):
        yield shares


def test_a_loop_says_how_much_of_it_is_done_and_one_within_it_nothing(said: list[float]) -> None:
    assert list(counted([3.0, 1.0, 4.0], 8.0, float)) == [3.0, 1.0, 4.0]
    assert said == [0.0, 3.0 / 8.0, 4.0 / 8.0, 1.0]
    said.clear()
    for _ in counted("ab", 2):
        assert list(counted(range(5), 5)) == [0, 1, 2, 3, 4]
    assert said == [0.0, 0.5, 1.0]
    # What ended early does not silence what comes next.
    for _ in counted("ab", 2):
        break
    assert list(counted("c", 1)) == ["c"]
    assert said[3:] == [0.0, 1.0, 0.0, 1.0]


def test_where_nobody_listens_nothing_is_said() -> None:
    assert list(counted("abc", 3)) == ["a", "b", "c"]
    with part(0.2, 0.6), about(3):
        stepped()


def test_loops_one_after_the_other_are_parts_of_one_bar_and_steps_are_counted(said: list[float]) -> None:
    with part(0.0, 0.5):
        assert list(counted("ab", 2)) == ["a", "b"]
    with part(0.5, 1.0):
        assert list(counted("cd", 2)) == ["c", "d"]
    assert said == [0.0, 0.25, 0.5, 0.5, 0.5, 0.75, 1.0]
    said.clear()
    # Against the usual number of them: of what takes longer nobody knows how much is done.
    stepped()
    with about(4):
        for _ in counted(range(6), 6):
            stepped()
    stepped()
    assert [str(share) for share in said] == ["0.0", "0.25", "0.5", "0.75", "nan", "nan", "nan", "1.0"]


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The clock, which a test sets."""
    clock = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    return clock


def test_the_rest_takes_as_long_as_what_is_done_or_is_not_foretold(now: list[float]) -> None:
    stage = Stage()
    stage.begin("reading")
    now[0] = 150.0
    stage.at(0.0)  # the loop begins now, whenever the stage did
    now[0] = 150.5
    stage.at(0.01)
    assert stage.words() == "reading"
    now[0] = 160.0
    stage.at(0.25)
    assert stage.words() == "reading ━━━━━╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 25 %, 30 s left"
    assert time_words(180.0) == "3 min"
    now[0] = 100.0
    stage.begin("adjustment")
    stage.at(0.0)
    now[0] = 105.0
    stage.at(0.5)
    assert stage.words().endswith("50 %, 5 s left")
    now[0] = 112.0
    assert stage.words().endswith("50 %, 12 s so far")
    stage.at(math.nan)
    assert stage.words() == "adjustment, 12 s so far"


def test_words_change_while_nobody_counts(now: list[float]) -> None:
    """A time left runs down, a name makes room for the bar, and of unknown work it is said how long it has taken."""
    stage = Stage()
    stage.begin("adjustment")
    now[0] = 101.0
    assert stage.words() == "adjustment"
    now[0] = 105.0
    assert stage.words() == "adjustment, 5 s so far"
    stage.begin("reading")
    stage.at(0.0)
    now[0] = 115.0
    stage.at(0.25)
    now[0] = 120.0
    assert stage.words().endswith("25 %, 25 s left")
    stage.begin("the next of several in a loop, which has a rather long name of its own")
    assert stage.words(77) == "the next of several in a loop, which ha… ━━━━━╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 25 %, 25 s left"
    assert len(stage.words(77)) == 77
    now[0] = 200.0
    assert stage.words().endswith("25 %, 95 s so far")
    stage.at(1.0)
    now[0] = 201.0
    assert stage.words(20) == "the ne…, 96 s so far"
    stage.begin("writing")
    assert stage.words() == "writing"


# --- compiled loops do what their sources say when run as Python, and their stubs name what they have

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(ROOT.glob("src/**/kernels*.pyi"))


def _functions(path: Path) -> dict[str, list[str]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {f.name: [a.arg for a in f.args.args] for f in functions if "cfunc" not in ast.dump(f)}


@pytest.mark.parametrize("stub", SOURCES, ids=lambda p: p.parent.name)
def test_a_stub_names_the_functions_of_its_source_which_is_compiled(stub: Path) -> None:
    public = {name: names for name, names in _functions(stub.with_suffix(".py")).items() if name[0] != "_"}
    assert public
    assert _functions(stub) == public
    module = importlib.import_module(".".join(stub.relative_to(ROOT / "src").with_suffix("").parts))
    # The tests' checks of shapes do not wrap it.
    assert type(module.__loader__).__module__ != "jaxtyping._import_hook"
    require_compiled(module.__file__ or "")


def test_a_source_run_as_python_is_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(NotBuiltError, match="make kernels"):
        require_compiled(str(tmp_path / "kernels.py"))


def turns() -> list[object]:
    rng = np.random.default_rng(1)
    rate, force = rng.normal(0.0, 20.0, (99, 3)), rng.normal(0.0, 9.0, (99, 3))
    inverse, coupling = np.eye(3) + 0.1 * rng.random((3, 3)), 1e-3 * rng.random((3, 3))
    time, bias = np.cumsum(rng.uniform(0.001, 0.03, 99)), rng.random(3)
    more = inverse.T.copy(), bias[::-1].copy(), np.array([2, 18]), np.array([17, 99])
    return [time, rate, force, inverse, bias, coupling, *more, np.zeros((2, 3, 3)), np.zeros((2, 3, 3, 7))]


def chain() -> list[object]:
    rng = np.random.default_rng(3)
    half = rng.normal(0.0, 0.1, (4, 3, 3))
    diagonal = np.eye(3) + half @ half.transpose(0, 2, 1)
    return [diagonal, rng.normal(0.0, 0.1, (3, 3, 3)), rng.normal(0.0, 0.1, (4, 3, 2)), rng.random((4, 3))]


def normal(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 1.0, shape)


@pytest.mark.parametrize(
    ("room", "function", "arguments"),
    [
        ("attitude", "integrate_segments", turns),
        (
            "noise",
            "second_difference_squares",
            lambda: [normal(2, 301).cumsum(), np.array([1, 3, 40]), np.zeros(3)],
        ),
        ("estimation", "eliminate", chain),
        (
            "segmentation",
            "block_moments",
            lambda: [normal(4, 70, 3), 5, np.zeros((14, 3)), np.zeros((14, 3), dtype=np.float32)],
        ),
        ("segmentation", "triangle_smooth", lambda: [normal(5, 14, 3), 4, np.zeros((14, 3))]),
    ],
)
def test_compiled_and_as_python_a_loop_does_the_same(as_python, room, function, arguments):
    given = [arguments(), arguments()]
    modules = [make(f"tumble.{room}.kernels") for make in (importlib.import_module, as_python)]
    answers = [getattr(module, function)(*own) for module, own in zip(modules, given, strict=True)]
    assert answers[0] == answers[1]
    for compiled, python in zip(*given, strict=True):
        np.testing.assert_allclose(compiled, python, rtol=1e-12, atol=1e-13)


# --- the shape checks of the tests are on


def test_an_array_of_the_wrong_shape_is_refused_and_a_whole_number_serves_as_a_float() -> None:
    given: dict[str, Any] = {
        "specific_force": np.zeros((4, 3)),
        "angular_rate": None,
        "specific_force_unit": "m/s²",
        "angular_rate_unit": "rad/s",
        "rate": 100,
    }
    with pytest.raises(TypeCheckError, match="time"):
        Recording(time=np.zeros((4, 3)), **given)
    assert Recording(time=np.arange(4.0), **given).rate == 100
