"""`tumble plan strapdown-rotation` as a user meets it: a protocol like any other."""

from __future__ import annotations

import json
from typing import Any

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


def test_wrong_input_is_refused_in_one_sentence(tumble: Any) -> None:
    for arguments, words in (
        (("turntable",), ("strapdown-rotation", "multi-position")),
        (("strapdown-rotation", "--imu", "ringlaser"), ("ring-laser",)),
        (("strapdown-rotation", "--poses", 9), ("--poses", "a protocol as it is")),
    ):
        tumble("plan", *arguments).is_told(2, *words)
