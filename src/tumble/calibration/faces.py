"""The six positions recognised in a recording without a protocol: which face is up in each hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.attitude.directions import twenty_six_directions
from tumble.earth import Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, named_protocol

if TYPE_CHECKING:
    from tumble.segmentation import HoldMeans
    from tumble.segmentation.matching import Matching

# Farther than this from every face, a hold is none of the six positions.
FACE_ANGLE = np.radians(20.0)


def match_faces(means: HoldMeans, site: Site) -> tuple[Protocol, Matching]:
    """Return a six-position protocol in the order of the recording, and each hold's step in it.

    Parameters
    ----------
    means : of the holds that were found.
    site : gravity, for the rough scale.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer to tell the faces.
    """
    from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
    from tumble.calibration.start_values import rough_triad
    from tumble.segmentation.matching import MatchedHold, Matching

    if means.specific_force is None:
        raise ObservabilityError("The recording has no accelerometer: nothing shows which face is up.")
    named = named_protocol("six-position")
    sigma = next(step.pose.sigma for step in named.steps if isinstance(step, HoldStep) and step.pose)
    rough = triad_from_unknowns(rough_triad(means.specific_force, site.gravity))
    up_b = rough.correct(means.specific_force)
    up_b = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    faces = twenty_six_directions()[:6]
    nearest = np.argmax(up_b @ faces.T, axis=1)
    angle = np.arccos(np.clip(np.max(up_b @ faces.T, axis=1), -1.0, 1.0))
    is_face = angle < FACE_ANGLE
    steps = tuple(
        HoldStep(float(means.duration[k]), Pose(faces[nearest[k]], None, sigma), _name(faces[nearest[k]]))
        for k in np.flatnonzero(is_face)
    )
    holds = tuple(MatchedHold(step, int(hold)) for step, hold in enumerate(np.flatnonzero(is_face)))
    extra = tuple(int(hold) for hold in np.flatnonzero(~is_face))
    assumed = (
        f"No protocol was given: {len(steps)} holds were taken for the face that is nearest to up. "
        f"They are believed level within {np.degrees(sigma):.2g}° (one standard deviation). A "
        "protocol file can state how level they were."
    )
    remarks = [assumed]
    if extra:
        listed = ", ".join(str(hold + 1) for hold in extra[:10])
        remarks.append(
            f"Holds more than {np.degrees(FACE_ANGLE):.0f}° from every face were left out: {listed}."
        )
    protocol = Protocol("six-position", "six-position", steps, site, description=named.description)
    return protocol, Matching(holds=holds, spins=(), missing=(), extra=extra, remarks=remarks)


def _name(up_b: np.ndarray) -> str:
    axis = int(np.argmax(np.abs(up_b)))
    return f"{'xyz'[axis]} {'up' if up_b[axis] > 0 else 'down'}"
