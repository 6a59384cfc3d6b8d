"""Notes are taken as people type them, and a wrong one is one sentence."""

from __future__ import annotations

import pytest

from tumble.errors import UsageError
from tumble.workflows.given.notes import notes_of


def test_notes_keep_their_order_and_their_values_and_names_are_small_letters() -> None:
    assert list(notes_of(["Place=hall 2", "operator= A. Smith ", "remarks=a=b, c"]).items()) == [
        ("place", "hall 2"),
        ("operator", "A. Smith"),
        ("remarks", "a=b, c"),
    ]
    assert notes_of({"Instrument": "table 7"}) == {"instrument": "table 7"}
    assert notes_of("operator=Smith") == {"operator": "Smith"}
    assert notes_of(None) == {}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["operator"], "give a name and a value"),
        (["=Smith"], "give a name and a value"),
        (["operator= "], "give a name and a value"),
        (["a=1", "A=2"], "--note a is given twice"),
        (["a=1\n2"], "line break"),
        (["a\x1b[2J=1"], "line break"),
    ],
)
def test_a_wrong_note_is_refused_in_a_sentence(given: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        notes_of(given)
