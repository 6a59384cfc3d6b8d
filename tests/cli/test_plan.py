"""`tumble plan strapdown-rotation` as a user meets it: a protocol like any other, and what left of its budget."""

from __future__ import annotations

import json
from typing import Any

import pytest

COMMAND = ("plan", "strapdown-rotation", "--imu", "ring-laser", "--site", "48.1")


def test_the_sequences_are_played_and_both_triads_foretold(tumble: Any) -> None:
    answer = tumble(*COMMAND, "--rate", "100±0", "--json")
    assert answer.status == 0, answer
    document = json.loads(answer.out)
    found = {one["name"]: one for one in document["parameters"]}
    scale = [found[f"gyro scale factor error {axis}"] for axis in "xyz"]
    # A ring-laser gyro's scale factors are told to about a ppm, which the page of the procedure has from calibrations.
    assert all(one["told"] and 0.2e-6 < one["standard_uncertainty"] < 2e-6 for one in scale)
    assert document["protocol"] == "strapdown-rotation"


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--fixture-mrad", "1.75"), ("--fixture-mrad has left", "uncertainty_deg")),
        (("--heading-mrad", "90"), ("--heading-mrad has left",)),
        (("--set", "gyro-pulse-arcsec=0.5"), ("--gyro-pulse-arcsec has left", "--noise")),
        (("--monte-carlo", "50"), ("--monte-carlo has left", "tumble simulate")),
        (("--formulas",), ("--formulas has left", "reproduce savage-9.1")),
    ],
)
def test_an_option_of_the_budget_says_what_to_do_instead(
    tumble: Any, option: tuple[str, ...], words: tuple[str, ...]
) -> None:
    answer = tumble(*COMMAND, *option)
    assert answer.status == 2, answer
    assert len(answer.err.splitlines()) == 1, answer.err
    for word in words:
        assert word in answer.err


def test_wrong_input_is_refused_in_one_sentence(tumble: Any) -> None:
    for arguments, words in (
        (("turntable",), ("strapdown-rotation", "multi-position")),
        (("strapdown-rotation", "--imu", "ringlaser"), ("ring-laser",)),
        (("strapdown-rotation", "--poses", 9), ("--poses", "a protocol as it is")),
    ):
        answer = tumble("plan", *arguments)
        assert answer.status == 2, answer
        assert len(answer.err.splitlines()) == 1, answer.err
        assert all(word in answer.err for word in words), answer.err
