"""Records are what `dataclasses` makes of the same class."""

import copy
import dataclasses
import inspect
import pickle
from typing import Any

import pytest

from tumble import records

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
    with pytest.raises(ValueError, match="first"):
        dataclasses.replace(record, first=-1)
    with pytest.raises(TypeError, match="first"):
        kind()
    with pytest.raises(TypeError, match="fifth"):
        kind(1, fifth=5)


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
    assert hash(Record(1)) == 7
    assert repr(Record(1)) == "itself"


@MAKERS
def test_the_signature_names_the_fields(maker: Any) -> None:
    text = str(inspect.signature(made(maker, {"frozen": True})))
    assert text.replace("'", "") == (
        "(first: int, second: str = two, third: list[int] = <factory>, fourth: float = 4.0) -> None"
    )


def test_a_record_goes_to_another_process() -> None:
    record = Kept(3, ["a"])
    assert pickle.loads(pickle.dumps(record)) == record
    assert copy.copy(record) == record


def test_a_constructor_of_a_class_without_its_own_fields() -> None:
    class Child(Kept):
        pass

    assert Child(1).names == []
    assert repr(Child(1)).endswith("Child(place=1, names=[])")
