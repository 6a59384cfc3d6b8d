"""What the figures draw: decimation, poses, residuals before the calibration."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from tumble.attitude.rotations import twenty_six_directions
from tumble.calibration.evidence import Turns
from tumble.report.evidence.residuals import nominal_hold_norms, nominal_turn_angles, turns
from tumble.report.figures.on_page import packed
from tumble.report.figures.parameters import missing_directions, poses
from tumble.report.figures.record import Bars, plain
from tumble.report.figures.timeline import envelope, timeline
from tumble.report.page import Figures, Sentences
from tumble.report.subject import Subject, pose_words
from tumble.segmentation.matching import MatchedSpin, Matching


def drawn(blocks: Sequence[object]) -> Figures:
    """The figures among the blocks of a section."""
    (figures,) = [block for block in blocks if isinstance(block, Figures)]
    return figures


def test_a_spike_of_one_sample_survives_decimation() -> None:
    time = np.arange(50_000) / 100.0
    signal = np.zeros((50_000, 3))
    signal[23_456, 1] = 7.0
    signal[34_567, 2] = -3.0
    drawn = envelope(time, signal, bins=1000)
    assert drawn.values.shape == (2000, 3)
    assert np.array_equal(np.nanmax(drawn.values, axis=0), [0.0, 7.0, 0.0])
    assert np.array_equal(np.nanmin(drawn.values, axis=0), [0.0, 0.0, -3.0])
    at = drawn.start + drawn.step * int(np.argmax(drawn.values[:, 1]))
    # A bin is half a second long here.
    assert at == pytest.approx(234.56, abs=0.5)


def test_a_gap_is_drawn_as_a_gap() -> None:
    time = np.concatenate([np.arange(100), np.arange(900, 1000)]) / 10.0
    drawn = envelope(time, np.ones((200, 3)), bins=10)
    empty = np.isnan(drawn.values[:, 0])
    # Ten bins of 9.99 s: the middle eight hold no sample, but that the second holds sample 100 at 9.99 s.
    assert empty.tolist() == [False] * 2 + [True] * 16 + [False] * 2


@pytest.mark.parametrize("samples", [1, 2, 3, 7])
def test_a_few_samples_are_drawn_too(samples: int) -> None:
    signal = np.arange(3.0 * samples).reshape(samples, 3)
    drawn = envelope(np.arange(samples) / 10.0, signal)
    assert np.nanmin(drawn.values) == 0.0
    assert np.nanmax(drawn.values) == 3.0 * samples - 1.0


def test_packed_numbers_are_little_endian_float32() -> None:
    assert packed(np.array([1.5, -2.0])) == {
        "dtype": "f4",
        "bdata": base64.b64encode(b"\x00\x00\xc0\x3f\x00\x00\x00\xc0").decode(),
    }


def test_what_is_not_finite_becomes_null() -> None:
    assert plain([1.23456789, float("nan"), float("inf")], 4) == [1.235, None, None]


def test_poses_that_no_hold_is_nearest_to_are_missing() -> None:
    standard = twenty_six_directions()
    tilted = standard[[0, 5, 20]] + [0.1, -0.05, 0.02]
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    missing = missing_directions(tilted)
    assert np.array_equal(missing, np.delete(standard, [0, 5, 20], axis=0))


def test_missing_poses_are_named_in_words() -> None:
    notes = poses(np.delete(twenty_six_directions(), 2, axis=0) * 9.81, set())[-1]
    assert isinstance(notes, Sentences)
    assert notes.sentences[-1] == f"Missing: {pose_words(twenty_six_directions()[2])}."
    assert "−" in pose_words(np.array([-1.0, 0.0, 0.0]))


def test_holds_of_one_pose_share_a_label() -> None:
    up = np.array([[0.0, 0.0, 9.8], [0.0, 9.8, 0.0], [0.1, 0.0, 9.8]])
    holds: Any = drawn(poses(up, {1})).figures[0].marks[-1]
    assert holds.labels == ["1, 3", "2", ""]
    assert len(set(holds.colour)) == 2  # the one left out is marked


def test_every_stretch_of_the_timeline_can_be_pointed_at(hand_held: dict[str, Any]) -> None:
    found = hand_held["timeline"]
    figure = drawn(timeline(Subject(**hand_held))).figures[0]
    bars = {mark.name: mark for mark in figure.marks if isinstance(mark, Bars)}
    assert len(bars["holds"].words) == len(found.holds)
    assert len(bars["turns"].words) == len(found.turns)
    # The legend has a name for every colour of the strip, and the caption's words.
    legend = legend_of(figure)
    assert {c for bar in bars.values() for c in bar.colour} == set(legend.values())
    assert "rejected, swaying or not used" in legend
    for rejection, text in zip(found.rejections, bars["rejected"].words, strict=True):
        assert rejection.reason.split("<")[0] in text


def legend_of(figure: Any) -> dict[str, str]:
    return {mark.name: mark.colour for mark in figure.marks if getattr(mark, "symbol", "") == "square"}


def test_nominal_norms_of_si_values_are_their_norms(hand_held: dict[str, Any]) -> None:
    means = hand_held["means"]
    before = nominal_hold_norms(hand_held["recording"], means, 9.81)
    assert before is not None
    expected = np.sqrt((means.specific_force**2).sum(axis=1)) - 9.81
    np.testing.assert_allclose(before.residuals, expected, atol=1e-12)  # arithmetic


def test_counts_are_compared_with_rough_values(in_counts: dict[str, Any], hand_held: dict[str, Any]) -> None:
    """Rough values of bias and scale leave less than the raw values of the same holds, but more than nothing."""
    rough = nominal_hold_norms(in_counts["recording"], in_counts["means"], 9.81)
    raw = nominal_hold_norms(hand_held["recording"], hand_held["means"], 9.81)
    assert rough is not None
    assert raw is not None
    assert 0.0 < np.std(rough.residuals) < np.std(raw.residuals)
    assert "counts" in rough.words


def test_turns_are_worse_before_than_after(hand_held: dict[str, Any]) -> None:
    """The unit's gyro has 14 mrad of non-orthogonality: 0.8° on a turn, against 0.1° after."""
    estimate = hand_held["estimate"]
    before = nominal_turn_angles(
        hand_held["recording"], hand_held["timeline"], hand_held["means"], estimate.model
    )
    assert before is not None
    assert np.array_equal(np.isnan(before.residuals), np.isnan(estimate.turns.angles))
    rms_before = np.sqrt(np.nanmean(before.residuals**2))
    rms_after = np.sqrt(np.nanmean(estimate.turns.angles**2))
    assert rms_after < rms_before < np.radians(3.0)


def test_without_turns_there_is_no_figure_of_turns(in_counts: dict[str, Any]) -> None:
    assert turns(Turns(), Subject(**in_counts)) == []


def test_spins_have_a_colour_and_a_legend_of_their_own(hand_held: dict[str, Any]) -> None:
    first, _, third, *_ = hand_held["timeline"].turns
    spun = tuple(MatchedSpin(step, turn.start, turn.stop) for step, turn in ((1, first), (5, third)))
    shown = drawn(timeline(Subject(**hand_held, matching=Matching((), spun, (), ()))))
    bars = {mark.name: mark for mark in shown.figures[0].marks if isinstance(mark, Bars)}
    assert len(bars["spins"].words) == 2
    assert bars["spins"].words[0].startswith("spin 1")
    (colour,) = set(bars["spins"].colour)
    assert legend_of(shown.figures[0])["spins"] == colour
    assert colour not in {c for name in ("holds", "turns") for c in bars[name].colour}
    assert "teal a spin" in shown.caption
    assert "spin" not in drawn(timeline(Subject(**hand_held))).caption
