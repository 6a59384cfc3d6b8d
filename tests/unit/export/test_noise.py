"""noise.json as the targets take it: the worst axis, limits for what is not seen, inflation, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tumble.errors import UsageError
from tumble.export.noise import read_noise


def channel(white: float, walk: float | None, limit: float | None, unit: str = "m/s^2") -> dict[str, Any]:
    terms = {"N": {"value": white}} | ({} if walk is None else {"K": {"value": walk}})
    return {
        "unit": unit,
        "terms": terms,
        "upper_limits_of_unseen": {} if limit is None else {"K": {"value": limit}},
    }


def written(folder: Path, **update: Any) -> Path:
    channels = {
        "ax": channel(1e-3, 2e-5, None),
        "ay": channel(3e-3, 4e-5, None),
        "az": channel(2e-3, None, 9e-5),
        "gx": channel(1e-4, None, 2e-6, "rad/s"),
        "gy": channel(2e-4, None, 5e-6, "rad/s"),
        "gz": channel(1e-4, None, 3e-6, "rad/s"),
    }
    document = {"format": "tumble noise", "version": 1, "rate_hz": 100.0, "channels": channels} | update
    (folder / "noise.json").write_text(json.dumps(document))
    return folder


def test_the_worst_axis_counts_and_a_limit_only_where_no_axis_shows_it(tmp_path: Path) -> None:
    noise = read_noise(written(tmp_path))
    assert (noise.accelerometer.density, noise.accelerometer.walk) == (3e-3, 4e-5)
    assert not noise.accelerometer.walk_is_limit
    assert (noise.gyroscope.density, noise.gyroscope.walk) == (2e-4, 5e-6)
    assert noise.gyroscope.walk_is_limit
    assert any("upper limit" in remark for remark in noise.remarks)


def test_a_letter_whose_curve_misses_the_measured_one_is_not_passed_on_silently(tmp_path: Path) -> None:
    whole = json.loads((written(tmp_path) / "noise.json").read_text())
    whole["channels"]["ay"]["terms"]["K"]["curve_missed_by"] = 4.2
    whole["channels"]["ax"]["terms"]["K"]["curve_missed_by"] = 1.2
    said = [r for r in read_noise(written(tmp_path, channels=whole["channels"])).remarks if "misses" in r]
    assert len(said) == 1
    assert said[0].startswith("K of ay is known no better than to a factor of 4.2")


def test_another_rate_is_taken(tmp_path: Path) -> None:
    assert read_noise(written(tmp_path), rate=200.0).rate == 200.0


@pytest.mark.parametrize(
    ("update", "said"),
    [
        ({"format": "other"}, "no noise.json"),
        ({"channels": {"ax": channel(1e-3, 2e-5, None)}}, "1 channels"),
        ({"channels": {f"a{i}": channel(1.0, 1.0, None, "counts") for i in "xyz"}}, "counts"),
        ({"channels": {f"a{i}": channel(1.0, None, None) for i in "xyz"}}, "no random walk"),
        ({"channels": {f"a{i}": {"unit": "m/s^2"} for i in "xyz"}}, "damaged"),
        ({"channels": 3}, "damaged"),
    ],
)
def test_what_cannot_be_used_is_refused_in_a_sentence(
    tmp_path: Path, update: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError, match=said) as told:
        read_noise(written(tmp_path, **update))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("recorded", "shown"), [(200.0000000127157, 200.0), (199.98764, 199.988), (0.5, 0.5)]
)
def test_the_rate_has_the_digits_that_a_clock_is_good_for(
    tmp_path: Path, recorded: float, shown: float
) -> None:
    assert read_noise(written(tmp_path, rate_hz=recorded)).rate == shown
