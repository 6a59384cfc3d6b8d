"""Section 3.2 of Zhang et al. (2010): where a norm tells most, and what sets of poses are worth."""

from __future__ import annotations

from functools import cache

import numpy as np

from tumble.arrays import Series, Table, Vector, Vectors
from tumble.attitude.directions import twenty_six_directions
from tumble.calibration.poses import describe_direction
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row
from tumble.sensor.conventions.zhang import matrix_from_zhang
from tumble.units import ARCSECOND
from tumble_papers.published import zhang
from tumble_papers.zhang.closed_forms import ellipsoid_from_norms
from tumble_papers.zhang.pose_sets import (
    GROUPS,
    OTHER_EDGE_NUMBERS,
    approximate_norm_sensitivity,
    chatfield_orientations,
    explain_pose_set,
    find_best_on_sphere,
    find_best_subset,
    most_sensitive_directions,
    norm_sensitivity,
    paper_nine,
    predict_sigma,
)

GRAVITY = 9.8  # what the paper's µg and counts are of
PRINTED_RUNS = 500
# Of a standard deviation from 500 runs 99.9 % lie within.
CHANCE = 0.001
# What the sensors' unit vectors are told from, in words: (33) and (35) on faces, (34) on edges.
PAIRS = ("xy", "xz", "yz")
SYMBOLS = {
    "accelerometer": (("k_x", "k_y", "k_z"), ("α_yz", "α_zy", "α_zx"), ("b_x", "b_y", "b_z")),
    "gyro": (("k_x", "k_y", "k_z"), ("γ_yz", "γ_zy", "γ_zx")),
}
WORDS = (("scale factor", "ppm", 1e-6), ("misalignment", "″", ARCSECOND), ("bias", "µg", 1e-6 * GRAVITY))
# Starts of the search for sets: the ends of more were no better.
STARTS = 12

_SENSITIVITY_NOTES = (
    (
        "Misalignments and scale factors as the paper's table 2 sets them. 'off by': how far the "
        "farthest greatest sensitivity is from the face or edge. 'Neglected': the largest difference "
        "of (33) to (35), (37) and (38) from the exact derivatives over the sphere, in percent of "
        "the greatest sensitivity."
    ),
    "A set of poses is worth more or less than the sum of its sensitivities: see zhang-designs.",
)
_DESIGN_NOTES = (
    (
        "Root mean squares over the three axes. Predicted: the inverse of the information in the norms of the dwells. "
        "Simulated: the closed form (12) to (14) on noisy means of dwells."
    ),
    (
        "average: the sum of the nine variances is least (relative scale, radians, bias over gravity). minimax: the "
        "largest ratio of a standard deviation to that of the paper's nine is least."
    ),
    (
        "Of nine out of the 26 directions the search in the sense of minimax finds the paper's own: none is better in "
        "everything. Better in everything are nine poses that are neither faces nor edges, or more poses. Better in "
        "misalignment is nearly any set with fewer faces, at the price of the scale factors."
    ),
)


def reproduce_sensitivity(repetitions: int, seed: int) -> Outcome:
    """Find the directions in which a squared norm determines most of each parameter, beside the paper's.

    Parameters
    ----------
    repetitions, seed : not used: nothing is simulated.
    """
    accelerometer, gyro = (_angles(f"{triad} misalignment") for triad in ("accelerometer", "gyro"))
    rows = [
        *_sensitivity_rows("accelerometer", 100.0, accelerometer),
        *_sensitivity_rows("gyro", 1e6, gyro),
        _slip_row(accelerometer),
    ]
    return Outcome(
        "zhang-sensitivity",
        "Where a squared norm is most sensitive to each parameter",
        "Zhang et al. 2010, (29) to (35), (37), (38)",
        ("paper", "found", "off by, ″", "neglected, %"),
        rows,
        "inside: the greatest sensitivity is where the paper says, to the sum of the misalignments, which it neglects",
        notes=list(_SENSITIVITY_NOTES),
        seed=seed,
        simulated=False,
    )


def reproduce_designs(repetitions: int, seed: int) -> Outcome:
    """Predict and simulate what sets of poses tell of the accelerometers: the paper's three and better ones.

    Parameters
    ----------
    repetitions : runs of each set.
    seed : of all random numbers.
    """
    density = zhang()["tables"]["5"]["accelerometer_noise_ug_rtHz"] * 1e-6 * GRAVITY
    sigma = density / float(np.sqrt(zhang()["simulation"]["dwell_s"]))
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    for name, directions in pose_sets().items():
        rows += _design_rows(name, directions, sigma, repetitions, rng)
    low, high = _range()
    return Outcome(
        "zhang-designs",
        "What sets of poses determine of the accelerometers, at table 5's noise",
        "Zhang et al. 2010, table 5 and section 3.2",
        ("paper", "predicted", "simulated"),
        rows,
        f"inside: the paper's three standard deviations are within {low:.2f} to {high:.2f} of the "
        f"predicted ones, as {100 * (1 - CHANCE):g} % of those from {PRINTED_RUNS} runs are. Of the "
        "singular set: it is refused, and the paper's errors are far beyond any set's. Sets that the "
        "paper does not have are not judged",
        notes=list(_DESIGN_NOTES),
        repetitions=repetitions,
        seed=seed,
    )


@cache
def pose_sets() -> dict[str, Vectors]:
    """Return the sets that are compared, by name."""
    eighteen = chatfield_orientations()
    rng = np.random.default_rng(0)
    return {
        "1-7, 9, 11": paper_nine(),
        "8, 10, 12-18": eighteen[[number - 1 for number in OTHER_EDGE_NUMBERS]],
        "1-18": eighteen,
        "minimax nine on the sphere": find_best_on_sphere(9, rng, criterion="minimax", starts=STARTS),
        "average nine of the 26": find_best_subset(9, rng, starts=STARTS),
        "average nine on the sphere": find_best_on_sphere(9, rng, starts=STARTS),
        "twelve edges": twenty_six_directions()[6:18],
        "minimax twelve on the sphere": find_best_on_sphere(12, rng, criterion="minimax", starts=STARTS),
        "average 18 on the sphere": find_best_on_sphere(18, rng, starts=STARTS),
    }


def _angles(group: str) -> Vector:
    (row,) = [row for row in zhang()["tables"]["2"]["rows"] if row["group"] == group]
    return ARCSECOND * np.array(row["set"], dtype=float)


def _stated(group: str, index: int) -> Vectors:
    """The directions that the paper names: both ways along an axis, or the four edges of a plane."""
    directions = twenty_six_directions()
    if group == "misalignment":
        i, j = ("xyz".index(letter) for letter in PAIRS[index])
        return directions[6:18][np.all(np.abs(directions[6:18][:, [i, j]]) > 0.1, axis=1)]
    return directions[:6][np.abs(directions[:6, index]) > 0.5]


def _sensitivity_rows(triad: str, counts: float, angles: Vector) -> list[Row]:
    scale = np.full(3, counts)
    sphere = _sphere(20000)
    rows: list[Row] = []
    for group, symbols in zip(GROUPS, SYMBOLS[triad], strict=False):
        exact, rough = (
            getattr(sensitivity(sphere, scale, angles), group)
            for sensitivity in (norm_sensitivity, approximate_norm_sensitivity)
        )
        for index, symbol in enumerate(symbols):
            stated, found = (
                _stated(group, index),
                most_sensitive_directions(scale, angles, group, index),
            )
            nearest = np.max(found @ stated.T, axis=1)
            off = float(np.max(np.arccos(np.minimum(nearest, 1.0))))
            right = len(found) == len(stated) and off <= float(np.sum(np.abs(angles)))
            missed = np.max(np.abs(exact - rough)[:, index]) / np.max(np.abs(exact[:, index]))
            where = "axis " if triad == "gyro" else ""
            cells = (where + _words(stated), where + _words(found), off / ARCSECOND, 100.0 * float(missed))
            rows.append(Row(f"{triad} {symbol}", "", cells, INSIDE if right else OUTSIDE))
    return rows


def _words(directions: Vectors) -> str:
    """Faces or edges, a short word each."""
    names = sorted(describe_direction(up).removesuffix(" up") for up in directions)
    short = [name.replace("edge between ", "").replace(" and ", "") for name in names]
    return ", ".join(short)


def _sphere(count: int) -> Vectors:
    """Points spread evenly over the sphere, on a spiral."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])


def _slip_row(angles: Vector) -> Row:
    """(30) as it is printed, with s_x^a for s_y^a, where the y accelerometer points up."""
    up = np.array([[0.0, 1.0, 0.0]])
    right = float(norm_sensitivity(up, np.ones(3), angles).scale[0, 1])
    seen = up @ matrix_from_zhang(np.ones(3), angles, "small-angle").T
    printed = float(-2.0 * seen[0, 0] * up[0, 1])
    return Row(
        "(30) as printed, k_y with +y up, of g²/k_y",
        "",
        (round(printed, 6) + 0.0, round(right, 6), None, None),
        OUTSIDE,
        "a slip: its first term has s_x^a where s_y^a belongs; (33) has it right",
    )


def _design_rows(
    name: str, directions: Vectors, sigma: float, repetitions: int, rng: np.random.Generator
) -> list[Row]:
    printed = [row["sigma"].get(name) for row in zhang()["tables"]["5"]["rows"]]
    refusal = explain_pose_set(directions)
    if refusal:
        return [_refused_row(name, np.array(printed, dtype=float), refusal)]
    predicted = predict_sigma(directions, sigma, GRAVITY)
    scatter = _simulated(directions, sigma, repetitions, rng)
    rows: list[Row] = []
    low, high = _range()
    for index, ((word, unit, factor), group) in enumerate(zip(WORDS, GROUPS, strict=True)):
        promised: Series = getattr(predicted, group) / factor
        verdict, paper, reason = UNJUDGED, None, ""
        if printed[index] is not None:
            ratio = np.array(printed[index]) / promised
            verdict = INSIDE if np.all((low <= ratio) & (ratio <= high)) else OUTSIDE
            reason = (
                "" if verdict == INSIDE else f"{ratio.min():.2f} to {ratio.max():.2f} times the predicted"
            )
            paper = _mean_square(np.array(printed[index]))
        cells = (paper, _mean_square(promised), _mean_square(scatter[index] / factor))
        rows.append(Row(f"{name}: {word}", unit, cells, verdict, reason))
    return rows


def _refused_row(name: str, printed: Table, refusal: str) -> Row:
    least = float(printed[0].min())
    cells = (_mean_square(printed[0]), "refused", "refused")
    reason = f"{refusal} What the paper prints is round-off."
    # No set that determines all has a scale factor worse than a tenth; the paper's are half of one.
    return Row(f"{name}: scale factor", "ppm", cells, INSIDE if least > 1e5 else OUTSIDE, reason)


def _simulated(directions: Vectors, sigma: float, repetitions: int, rng: np.random.Generator) -> Table:
    """The scatter (3, 3) of scale, misalignment and bias, in relative numbers, rad and m/s²."""
    counts, angles = 100.0, _angles("accelerometer misalignment")
    matrix = matrix_from_zhang(np.full(3, counts), angles)
    (row,) = [row for row in zhang()["tables"]["2"]["rows"] if row["group"] == "accelerometer bias"]
    bias = counts * GRAVITY * 1e-6 * np.array(row["set"], dtype=float)
    true = GRAVITY * directions + sigma * rng.standard_normal((repetitions, *directions.shape))
    matrices, biases = ellipsoid_from_norms(true @ matrix.T + bias, GRAVITY)
    scales = np.linalg.norm(matrices, axis=-1)
    cosines = matrices[:, [1, 2, 2], [0, 0, 1]] / scales[:, [1, 2, 2]]
    errors = np.stack(
        [
            scales / counts - 1.0,
            np.arcsin(cosines * np.array([1.0, -1.0, 1.0])) - angles,
            (biases - bias) / counts,
        ],
        axis=1,
    )
    if repetitions == 1:
        return np.abs(errors[0])
    return np.asarray(np.std(errors, axis=0, ddof=1), dtype=np.float64)


def _mean_square(values: Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _range() -> tuple[float, float]:
    """Between which multiples of the true one a standard deviation of 500 runs lies."""
    from scipy.special import chdtri

    freedom = PRINTED_RUNS - 1
    # chdtri takes the probability of more.
    low, high = (float(np.sqrt(chdtri(freedom, tail) / freedom)) for tail in (1 - CHANCE / 2, CHANCE / 2))
    return low, high
