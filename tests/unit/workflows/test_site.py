"""From --site and --gravity to a place."""

from __future__ import annotations

import math

import pytest

from tumble.errors import SiteError, UsageError
from tumble.workflows.given.protocols import choose_site
from tumble.workflows.request import notes_of


def test_a_latitude_gives_normal_gravity_there() -> None:
    """WGS 84 at 45°: 9.80620 m/s² (NGA.STND.0036); 1000 m higher 3.086e-3 m/s² less."""
    place = choose_site("45", None)
    assert place is not None
    assert place.latitude == pytest.approx(math.pi / 4)
    lower, higher = choose_site("45,0", None), choose_site("45,1000", None)
    assert lower is not None
    assert higher is not None
    assert lower.gravity == pytest.approx(9.80620, abs=1e-5)
    assert place.gravity == pytest.approx(9.80620 - 500 * 3.086e-6, abs=1e-5)
    assert lower.gravity - higher.gravity == pytest.approx(3.086e-3, rel=2e-3)


def test_gravity_alone_is_good_to_its_digits_or_to_what_is_said() -> None:
    place, surveyed = choose_site(None, "9.8120"), choose_site(None, "9.81203±0.00002")
    assert place is not None
    assert surveyed is not None
    assert (place.gravity, place.latitude) == (9.812, None)
    assert place.gravity_sigma == pytest.approx(0.00005 / math.sqrt(3.0))
    assert surveyed.gravity_sigma == 2e-5


def test_with_both_gravity_is_the_one_given_and_the_latitude_stays() -> None:
    place, coarse = choose_site("-33.9,20", "9.797"), choose_site("-33.9,20", "9.80")
    assert place is not None
    assert coarse is not None
    assert (place.gravity, place.height) == (9.797, 20.0)
    # of two digits less is known than of the place
    assert coarse == choose_site("-33.9,20", None)
    assert place.latitude == pytest.approx(math.radians(-33.9))


def test_a_gravity_that_the_latitude_does_not_have_is_a_contradiction() -> None:
    with pytest.raises(SiteError, match="contradicts"):
        choose_site("0", "9.83")


@pytest.mark.parametrize("text", ["here", "", "1,2,3", "nan", "inf,0", "45;100", "45,"])
def test_what_is_no_latitude_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UsageError, match=r"48\.1,520"):
        choose_site(text, None)


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
