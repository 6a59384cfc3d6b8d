"""What a user's recording may have wrong with it: a clear sentence each, and what is still possible is done."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

RATE = 100.0
N_G = 1e-4
HEADER = "t,gx,gy,gz"
# 20,000 samples know N to 0.5 %, of which this is five; pieces left out cost less than a third of them.
WHITE = 0.03


@pytest.fixture(scope="module")
def still() -> np.ndarray:
    rng = np.random.default_rng(21)
    count = 20_000
    turn = N_G * np.sqrt(RATE) * rng.standard_normal((count, 3)) + [0.001, 0.002, -0.003]
    return np.column_stack([np.arange(count) / RATE, turn])


def moved(rows: np.ndarray) -> np.ndarray:
    rows[5000:6000, 1:] += 0.9 * np.sin(np.outer(rows[:1000, 0], [2.0, 3.0, 5.0]))
    return rows


def dead(rows: np.ndarray) -> np.ndarray:
    rows[:, 2] = 0.25
    return rows


def doubled(rows: np.ndarray) -> np.ndarray:
    """Every sample twice, with stamps of its own: a driver that is asked faster than the sensor gives."""
    rows = np.repeat(rows[:10_000], 2, axis=0)
    rows[:, 0] = np.arange(len(rows)) / RATE
    return rows


def stamped_twice(rows: np.ndarray) -> np.ndarray:
    return np.insert(rows, 700, rows[700], axis=0)


def reset(rows: np.ndarray) -> np.ndarray:
    rows[12_000:, 0] -= 120.0
    return rows


def switched_on(rows: np.ndarray) -> np.ndarray:
    rows[9000:, 3] += 0.01
    return rows


def holed(rows: np.ndarray) -> np.ndarray:
    rows[4000:4900, 1] = np.nan
    return rows


@pytest.mark.parametrize(
    ("spoil", "said", "channels"),
    [
        (moved, "not at rest all the time (first at t = ", 3),
        (dead, "gy never changes (0.25 throughout)", 2),
        (doubled, "50 % of the rows repeat the row before", 3),
        (stamped_twice, "repeated stamp left out", 3),
        (reset, "the clock steps back at line 12002", 3),
        (switched_on, "gz steps by 0.01", 3),
        (holed, "900 row(s) without a finite number left out (first: line 4002, column 'gx')", 3),
    ],
)
def test_it_is_said_and_the_rest_is_analysed(
    tumble: Any,
    written: Any,
    still: np.ndarray,
    tmp_path: Path,
    how: str,
    spoil: Callable[[np.ndarray], np.ndarray],
    said: str,
    channels: int,
) -> None:
    path = written(tmp_path / "spoiled.csv", spoil(still.copy()), HEADER)
    answer = tumble("noise", path, "-o", tmp_path / "out")
    assert (answer.status, answer.err) == (0, "")
    assert said in answer.out
    document = json.loads((tmp_path / "out" / "noise.json").read_text(encoding="utf-8"))
    assert document["read"] == how
    assert len(document["channels"]) == channels
    for name, block in document["channels"].items():
        # The doubled file has its values at half of the rate.
        rate = np.sqrt(2.0) if spoil is doubled else 1.0
        assert block["terms"]["N"]["value"] == pytest.approx(rate * N_G, rel=WHITE), name
    if spoil is reset:
        assert document["pieces"] == [[0, 12_000], [12_000, 20_000]]
    assert document["recorded_rate_hz"] == (pytest.approx(RATE) if spoil is doubled else None)


@pytest.mark.usefixtures("how")
def test_three_seconds_give_white_noise_and_say_what_they_do_not(
    tumble: Any, written: Any, still: np.ndarray, tmp_path: Path
) -> None:
    answer = tumble("noise", written(tmp_path / "short.csv", still[:300], HEADER))
    assert (answer.status, answer.err) == (0, "")
    assert "very short (3 s at rest)" in answer.out
    assert "for N to 2 % record 50 s" in answer.out
    assert "for K" not in answer.out  # of what is far from being seen, no length is advised


def never_still(rows: np.ndarray) -> np.ndarray:
    moving = rows[:6000].copy()
    moving[:, 1:] += 0.9 * np.sin(np.outer(moving[:, 0], [2.0, 3.0, 5.0]))
    return moving


@pytest.mark.usefixtures("how")
@pytest.mark.parametrize(
    ("rows", "options", "said"),
    [
        (lambda rows: rows[:12], [], "No stretch at rest of 16 samples"),
        (lambda rows: rows[:100] * [1, 0, 0, 0], [], "all zeros"),
        (lambda rows: rows[:1000] * [1, 0, 0, 0] + [0, 0.1, 0.2, 0.3], [], "No channel ever changes (gx 0.1"),
        (never_still, [], "never rests"),
        (lambda rows: rows[:2000], ["--skip", "1e9"], "leaves nothing"),
    ],
    ids=["twelve samples", "zeros", "dead", "never still", "all skipped"],
)
def test_nothing_is_left_and_nothing_is_written(
    tumble: Any,
    written: Any,
    still: np.ndarray,
    tmp_path: Path,
    rows: Callable[[np.ndarray], np.ndarray],
    options: list[str],
    said: str,
) -> None:
    path = written(tmp_path / "bad.csv", rows(still), HEADER)
    tumble("noise", path, "-o", tmp_path / "out", *options).is_told(2, said)
    assert not (tmp_path / "out").exists()
