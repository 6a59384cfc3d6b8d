"""What is stated is what the second simulator's units do, where little of a recording shows it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from second_simulator import GRADES
from second_simulator.calibrating import calibrated, played
from second_simulator.sensors import flicker
from tumble.document import Calibration

GRAVITY = 9.8


@cache
def on_a_table(grade: str, seed: int, speeds: tuple[float, ...]) -> tuple[Calibration, float]:
    """A calibration by a table, and how long it was, s."""
    made = played("rate-table", grade, seed, rates=speeds, rate=25.0)
    return calibrated(made, rate="25±0.001"), float(made.time[-1] - made.time[0])


@pytest.mark.slow
def test_six_faces_show_a_g_sensitivity_no_better_than_a_bias_keeps_from_face_to_face() -> None:
    """The rests of a face are near in time: half the difference of two faces is off by what the bias wanders between.

    Drawn anew, a sixth of the recording for each face, opposite faces half of it apart.
    """
    found, seconds = on_a_table("consumer", 7, (20.0, 80.0))
    stated = [p.standard_uncertainty for p in found.parameters if p.name.startswith("g-sensitivity")]
    assert len(stated) == 9
    rng = np.random.default_rng(1)
    halves: list[np.ndarray] = []
    for _ in range(300):
        drawn = flicker(6 * int(seconds / 6), 1.0, GRADES["consumer"].gyroscope.flicker, rng)
        faces = drawn.reshape(6, -1, 3).mean(axis=1)
        halves.append(0.5 * (faces[:3] - faces[3:]))
    # The unit of the file is °/s.
    wandered = np.degrees(np.sqrt(np.mean(np.square(halves)))) / GRAVITY
    assert 0.8 * wandered < np.sqrt(np.mean(np.square(stated))) < 2.0 * wandered


def test_six_holds_state_a_bias_no_better_than_it_keeps_from_face_to_face() -> None:
    """Half the sum of two faces, against the mean over the recording; six holds for six unknowns show no scatter."""
    sheet = GRADES["hobby"].accelerometer
    made = played("six-faces", "hobby", 5, rate=50.0)
    found = calibrated(made, rate="50±0.001")
    stated = [p.standard_uncertainty for p in found.parameters if p.name.startswith("accelerometer bias")]
    faces = [(int(10 * step.start), int(10 * step.stop)) for step in made.path.steps if step.kind == "hold"]
    assert (len(stated), len(faces)) == (3, 6)
    rng, off = np.random.default_rng(1), list[np.ndarray]()
    for _ in range(200):
        drawn = flicker(int(10 * made.path.seconds), 10.0, sheet.flicker, rng)
        means = np.array([drawn[a:b].mean(axis=0) for a, b in faces]) - drawn.mean(axis=0)
        off.append(0.5 * (means[:3] + means[3:]))
    # The unit of the file is g.
    wandered = np.sqrt(np.mean(np.square(off))) / 9.80665
    assert 0.85 * wandered < np.sqrt(np.mean(np.square(stated))) < 2.0 * wandered


@pytest.mark.slow
def test_a_table_without_turns_between_its_faces_shows_no_axes_but_where_it_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the accelerometers show while it turns goes round the axis that the gyros show, and not another."""
    from tumble.calibration.equations.adjustment import JointAdjustment

    begin = JointAdjustment.__post_init__

    def without_turns(task: JointAdjustment) -> None:
        begin(task)
        task.taking_part["turn"][:] = False

    monkeypatch.setattr(JointAdjustment, "__post_init__", without_turns)
    found, _ = on_a_table("consumer", 1002, (20.0, 80.0))
    assert not any("While the table turns" in reason for reason in found.verdict.reasons)


def test_accelerometers_that_wander_on_a_table_are_found_by_every_rest_and_not_by_six_poses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 30 rests six are placed, to 0.2°: these alone left what data sheets give, a quarter of it."""
    from tumble.calibration.outcome import budget as influences

    densities: list[np.ndarray] = []
    between = influences._between  # pyright: ignore[reportPrivateUsage]

    def noted(task: object) -> dict[str, np.ndarray]:
        made = between(task)  # pyright: ignore[reportArgumentType]
        densities.append(made[influences.causes.FORCE_WANDER])
        return made

    monkeypatch.setattr(influences, "_between", noted)
    on_a_table("hobby", 1003, (20.0, 80.0))
    # B² / pi per unit of ln f; the unit of the file is g.
    true = (GRADES["hobby"].accelerometer.flicker / 9.80665) ** 2 / np.pi
    assert 0.5 < float(np.mean(densities[-1])) / true < 2.0
