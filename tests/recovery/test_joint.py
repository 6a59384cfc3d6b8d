"""The joint estimator finds what made the data, by hand and on a table, and names what does not belong.

The named protocols, the table's with shorter holds and one revolution of 60°/s each: five minutes at 50 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from recovery.played import MODEL, in_frame, jointly, normalised, short, vector
from tumble.calibration import Estimate, Session
from tumble.earth import Site
from tumble.protocol import Protocol, SpinStep, named_protocol
from tumble.recording.recording import Recording
from tumble.segmentation import find_timeline
from tumble.sensor import change_frame
from tumble.simulation import TableErrors, find_grade, simulate_protocol
from tumble.simulation.recordings import Truth

SITE = replace(Site.from_latitude(np.radians(48.0), 300.0), gravity_sigma=0.0)
# A thousand |z| beyond this are by chance one in 150.
LARGEST_Z = 4.5


def on_the_table(recording: Recording, protocol: Protocol, *, optional_terms: bool = True) -> Estimate:
    return jointly(Session(recording, protocol, SITE), "turntable", optional_terms=optional_terms)


def by_hand(recording: Recording, *, optional_terms: bool = True, broken: int | None = None) -> Estimate:
    """With the turn after hold `broken` as one that cannot be integrated."""
    timeline = find_timeline(recording)
    turns = [replace(t, usable=False, reason="a gap") if t.before == broken else t for t in timeline.turns]
    timeline = replace(timeline, turns=tuple(turns))
    return jointly(Session(recording, None, SITE), timeline=timeline, optional_terms=optional_terms)


@dataclass(frozen=True)
class Played:
    """A recording and what was true."""

    recording: Recording
    truth: Truth


@cache
def tumbled(*, noise: bool = True, grade: str = "consumer-mems") -> Played:
    made = simulate_protocol(
        named_protocol("hand-held"),
        50.0,
        np.random.default_rng(11),
        site=SITE,
        grade=find_grade(grade) if noise else None,
        model=MODEL,
        placement=noise,
    )
    return Played(*made)


@cache
def turned(*, noise: bool = True, grade: str = "tactical", shake: float = 0.0) -> Played:
    made = simulate_protocol(
        short("turntable-9", SITE),
        50.0,
        np.random.default_rng(12),
        site=SITE,
        grade=find_grade(grade) if noise else None,
        model=MODEL,
        placement=noise,
        table=TableErrors(shake=shake),
        lever_arm_b=np.array([0.05, -0.03, 0.02]),
    )
    return Played(*made)


def kept(estimate: Estimate) -> set[str]:
    return {term.name for term in estimate.terms if term.kept}


# Nothing but the model -----------------------------------------------------------------------------


def test_by_hand_without_noise_the_truth_comes_back() -> None:
    """To what the gyros' samples leave of a turn: two axes at once are seen at 50 Hz, the rest is coning."""
    played = tumbled(noise=False)
    estimate = by_hand(played.recording, optional_terms=False)
    assert estimate.procedure == "joint"
    np.testing.assert_allclose(
        vector(estimate.model), vector(in_frame(played.truth.model, estimate.frame)), rtol=0, atol=1e-6
    )
    assert not kept(estimate)
    assert not estimate.left_out


def test_on_a_table_without_noise_the_truth_comes_back() -> None:
    played = turned(noise=False)
    estimate = on_the_table(played.recording, short("turntable-9", SITE), optional_terms=False)
    np.testing.assert_allclose(
        vector(estimate.model), vector(in_frame(played.truth.model, estimate.frame)), rtol=0, atol=1e-6
    )
    assert not kept(estimate)
    assert not estimate.left_out


# Noise ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("grade", ["consumer-mems", "tactical"])
def test_by_hand_with_noise_the_truth_is_within_the_uncertainty(grade: str) -> None:
    played = tumbled(grade=grade)
    estimate = by_hand(played.recording)
    assert np.max(np.abs(normalised(estimate, played.truth))) < LARGEST_Z
    assert not kept(estimate)


def test_on_a_table_with_noise_the_truth_is_within_the_uncertainty() -> None:
    estimate = on_the_table(turned().recording, short("turntable-9", SITE))
    assert np.max(np.abs(normalised(estimate, turned().truth))) < LARGEST_Z
    assert not kept(estimate)


# What does not belong ------------------------------------------------------------------------------


def test_a_misread_table_angle_is_left_out_and_named_also_on_a_table_that_shakes() -> None:
    """A tenth of a degree; the reading is good to arc seconds.

    Windows scatter by 20 mm/s² a sample while it turns, thirty times a tactical accelerometer's noise, which is
    told and makes them count for less.
    """
    played = turned(shake=0.02)
    protocol = short("turntable-9", SITE)
    at = [k for k, step in enumerate(protocol.steps) if isinstance(step, SpinStep)][4]
    wrong = protocol.steps[at]
    assert isinstance(wrong, SpinStep)
    assert wrong.angle is not None
    misread = replace(wrong, angle=wrong.angle + np.radians(0.1))
    steps = (*protocol.steps[:at], misread, *protocol.steps[at + 1 :])
    estimate = on_the_table(played.recording, replace(protocol, steps=steps), optional_terms=False)
    named = [left for left in estimate.left_out if left.kind == "spin"]
    assert len(named) == 1
    assert "angle" in named[0].reason
    assert "misread?" in named[0].reason
    assert any("the table shakes" in remark for remark in estimate.remarks)
    assert np.max(np.abs(normalised(estimate, played.truth))) < LARGEST_Z


def test_a_hold_that_was_leant_on_is_left_out_and_named() -> None:
    """A steady 0.15 m/s² in one hold, some 50 sigmas: no noise, and no bias that wanders."""
    played = tumbled()
    force = played.recording.specific_force
    assert force is not None
    pushed = force.copy()
    edges = played.truth.hold_edges[7]
    time = played.recording.time
    pushed[(time >= edges[0]) & (time <= edges[1])] += np.array([0.1, -0.1, 0.05])
    estimate = by_hand(replace(played.recording, specific_force=pushed))
    assert any(left.kind == "hold" and left.index == 7 for left in estimate.left_out)
    assert np.max(np.abs(normalised(estimate, played.truth))) < LARGEST_Z


def test_a_recording_with_a_gap_in_a_turn_is_two_parts_of_one_adjustment() -> None:
    played = tumbled()
    estimate = by_hand(played.recording, broken=12)
    assert any("falls into 2 parts" in remark for remark in estimate.remarks)
    assert np.max(np.abs(normalised(estimate, played.truth))) < LARGEST_Z


def test_a_unit_whose_gyros_sense_the_specific_force_has_the_term_switched_on() -> None:
    G = 1e-4 * np.array([[11.0, -23.0, 5.0], [31.0, -13.0, 19.0], [-27.0, 16.0, -7.0]])
    recording, truth = simulate_protocol(
        named_protocol("hand-held"),
        50.0,
        np.random.default_rng(13),
        site=SITE,
        grade=find_grade("consumer-mems"),
        model=replace(MODEL, g_sensitivity=G),
    )
    estimate = by_hand(recording)
    assert kept(estimate) == {"g_sensitivity"}
    assert estimate.model.g_sensitivity is not None
    assert truth.model is not None
    true = change_frame(truth.model, "accelerometer-x").g_sensitivity
    assert true is not None
    at = [estimate.names.index(f"gyroscope.g_sensitivity[{i},{j}]") for i in range(3) for j in range(3)]
    sigma = np.sqrt(np.diag(estimate.covariance))[at].reshape(3, 3)
    assert np.max(np.abs((estimate.model.g_sensitivity - true) / sigma)) < LARGEST_Z
    assert np.max(np.abs(normalised(estimate, truth))) < LARGEST_Z
