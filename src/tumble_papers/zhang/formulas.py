"""The formulas of Zhang et al. (2010) tried on a unit without noise: which are as printed, and which slipped."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.calibration.closed_forms.inter_triad import rotation_from_two_axes
from tumble.calibration.closed_forms.rotation_planes import axis_from_scatter
from tumble.calibration.closed_forms.separate_norms import bias_from_static_pairs, ellipsoid_from_norms
from tumble.errors import ObservabilityError
from tumble.reproduction.outcome import Outcome, Row, claim_row
from tumble.sensor.conventions.zhang import (
    FORMS,
    inter_triad_angles,
    inter_triad_rotation,
    zhang_from_matrix,
)
from tumble.units import ARCSECOND, DEGREE_PER_HOUR
from tumble_papers.published import zhang
from tumble_papers.zhang.tables import refusal
from tumble_papers.zhang.turntable_simulation import (
    AXES,
    GRAVITY,
    NINE,
    ORIENTATIONS,
    Setting,
    simulate,
    table_setting,
    table_unit,
)

# Singular values smaller than this share of the largest are none.
NONE = 1e-12


def reproduce_formulas(repetitions: int, seed: int) -> Outcome:
    """Try every formula of the paper that tumble uses.

    Parameters
    ----------
    repetitions : not used: what needs runs makes its own number of them.
    seed : of all random numbers.
    """
    rng = np.random.Generator(np.random.SFC64([seed, 10])).spawn(1)[0]
    return Outcome(
        "zhang-formulas",
        "The formulas of the paper, tried on a unit without noise",
        "Zhang et al. 2010",
        ("said", "found"),
        _formula_rows(rng),
        "inside: the check bears the paper out",
        notes=[_UNCHECKED],
        repetitions=1,
        seed=seed,
    )


_UNCHECKED = (
    "Without a check: in (10) the gyros' sum runs to J_r; in (11) the gyros' vector lacks γ zy. The "
    "second line of (23) has ω_io for ω_ig. Before (39) the axes are known in p and in p, and (39) "
    "has R_n^o for R_p^o."
)


def _formula_rows(rng: np.random.Generator) -> list[Row]:
    return [
        *_closed_form(),
        _pairs(),
        _derivatives(),
        _linear(),
        *_readings(),
        _gravity(),
        _null_vector(rng),
        _two_axes(rng),
        _raw_rows(rng),
        *_how_many(),
        _singular_sets(),
    ]


def _exact_setting(orientations: tuple[int, ...] = NINE) -> Setting:
    """Return table 2's setting without any noise or error of placement."""
    exact = replace(table_setting("2", orientations), force_noise=0.0, rate_noise=0.0)
    return replace(exact, angle_error=0.0, placement=0.0, perturbation=0.0)


def _readings_of(setting: Setting) -> tuple[Vectors, Vectors]:
    still = simulate(setting, 1, np.random.default_rng(0), sampled=False)
    return still.force[0], still.rate[0]


def printed_design(raw: Vectors) -> Table:
    """Return (n, 10) the rows of (13) as printed.

    Parameters
    ----------
    raw : (n, 3) readings.
    """
    x, y, z = raw.T
    ones = np.ones(len(raw))
    return np.column_stack(
        [x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, -2 * x, -2 * y, -2 * z, ones]
    )


def smallest_share(design: Table) -> float:
    """Return the smallest over the largest singular value, columns scaled alike.

    Parameters
    ----------
    design : (n, unknowns), n at least as many.
    """
    values = np.linalg.svd(design / np.linalg.norm(design, axis=0), compute_uv=False)
    return float(values[-1] / values[0])


def _closed_form() -> list[Row]:
    force, _ = _readings_of(_exact_setting(tuple(range(1, 19))))
    unit = table_unit()
    matrix, bias = ellipsoid_from_norms(force, GRAVITY)
    # The trivial solution: m44 = |g|², all else zero.
    only = np.zeros(10)
    only[9] = GRAVITY**2
    design = printed_design(force)
    misses = float(np.max(np.abs(design @ only - GRAVITY**2))) / GRAVITY**2
    # What rounding leaves of a singular value is no number to print.
    rank = int(np.linalg.matrix_rank(design / np.linalg.norm(design, axis=0), tol=1e-9))
    found = max(
        float(
            np.max(np.abs(matrix / np.max(unit.force_matrix) - unit.force_matrix / np.max(unit.force_matrix)))
        ),
        float(np.max(np.abs(bias - unit.force_bias))) / np.max(unit.force_matrix),
    )
    words = (
        f"m44 = |g|² with all else zero misses the rows by {misses:g}: it fits whatever the attitudes, as the truth "
        "does, and all between the two"
    )
    return [
        claim_row("(13): its ten unknowns, and the rank of 18 attitudes", "1", 10, rank, rank == 10, words),
        claim_row(
            "(12) to (14), divided by |g|² - m44: off from the truth by less than 1e-12",
            "1",
            "yes",
            "yes" if found < NONE else f"{found:.1e}",
            found < NONE,
            "nine unknowns, then b = N⁻¹ m4 and c = |g|² / (1 + bᵀ N b)",
        ),
    ]


def pair_bias(matrix: AnyArray, rate: Vectors, *, printed: bool) -> Series:
    """Return the gyros' biases (raw) by (25) over all pairs, with the factor j1 that is printed last, or with j2.

    Parameters
    ----------
    matrix : (3, 3) K T.
    rate : (n, 3) raw means at rest.
    printed : take the last factor as printed.
    """
    x = np.linalg.solve(matrix, rate.T).T
    one, two = np.triu_indices(len(x), 1)
    last = x[one] if printed else x[two]
    right = np.sum(x[one] * x[one], axis=1) - np.sum(x[two] * last, axis=1)
    found: Series = np.asarray(np.linalg.lstsq(2.0 * (x[one] - x[two]), right)[0], dtype=np.float64)
    return matrix @ found


def _pairs() -> Row:
    unit = table_unit()
    _, rate = _readings_of(_exact_setting())
    scale = np.linalg.norm(unit.rate_matrix, axis=1) * DEGREE_PER_HOUR
    off = {
        printed: float(
            np.max(np.abs(pair_bias(unit.rate_matrix, rate, printed=printed) - unit.rate_bias) / scale)
        )
        for printed in (True, False)
    }
    closed = float(np.max(np.abs(bias_from_static_pairs(unit.rate_matrix, rate) - unit.rate_bias) / scale))
    return claim_row(
        "(25) with j1 as the last factor: gyro biases off by, without noise",
        "°/h",
        0.0,
        off[True],
        off[True] < 1e-6,
        f"with j2 they are off by less than {_above(max(off[False], closed))} °/h",
    )


def _above(value: float) -> str:
    """Return a power of ten above a number that only rounding makes."""
    return f"1e{int(np.ceil(np.log10(max(value, 1e-18))))}"


def squared_norm(parameters: npt.NDArray[np.complex128], raw: Series) -> np.complex128:
    """Return the squared norm of s of (27), T as printed; analytic, so that complex steps differentiate it.

    Parameters
    ----------
    parameters : (9,) complex.
    raw : (3,) reading.
    """
    s = (raw - parameters[6:]) / parameters[:3]
    yz, zy, zx = parameters[3:6]
    true = np.array([s[0], s[1] - yz * s[0], (zy + yz * zx) * s[0] - zx * s[1] + s[2]])
    return np.complex128(np.sum(true * true))


def printed_derivatives(parameters: Series, raw: Series) -> Series:
    """Return (9,) the derivatives (29) to (32) as printed.

    Parameters
    ----------
    parameters, raw : as for `squared_norm`.
    """
    k, (yz, zy, zx) = parameters[:3], parameters[3:6]
    sa = (raw - parameters[6:]) / k
    sp = np.array([sa[0], sa[1] - yz * sa[0], (zy + yz * zx) * sa[0] - zx * sa[1] + sa[2]])
    by_x = sp[0] - yz * sp[1] + (zy + yz * zx) * sp[2]
    by_y, by_z = sp[1] - zx * sp[2], sp[2]
    return np.array(
        [
            -2.0 / k[0] * sa[0] * by_x,
            -2.0 / k[1] * sa[0] * by_y,  # (30): s_x, where s_y belongs
            -2.0 / k[2] * sa[2] * by_z,
            -2.0 * sa[0] * by_y,
            2.0 * sa[0] * sp[2],
            -2.0 * sp[2] * (sa[1] - yz * sa[0]),
            *(-2.0 / k * np.array([by_x, by_y, by_z])),
        ]
    )


def stepped_derivatives(parameters: Series, raw: Series) -> Series:
    """Return (9,) the derivatives by complex steps.

    Parameters
    ----------
    parameters, raw : as for `squared_norm`.
    """
    step = 1e-30
    moved = [parameters + 1j * step * unit for unit in np.eye(9)]
    return np.array([squared_norm(one, raw).imag / step for one in moved])


def _derivatives() -> Row:
    # Angles of a tenth of a radian, at which each term counts.
    parameters = np.array([90.0, 110.0, 100.0, 0.1, -0.07, 0.13, 0.5, -2.0, 1.0])
    raw = np.array([300.0, 500.0, -800.0])
    printed, right = printed_derivatives(parameters, raw), stepped_derivatives(parameters, raw)
    good = np.isclose(printed, right, rtol=1e-12, atol=0.0)
    names = ("k x", "k y", "k z", "α yz", "α zy", "α zx", "b x", "b y", "b z")
    wrong = ", ".join(
        f"{name} ({p / r:.3g} of it)"
        for name, p, r, g in zip(names, printed, right, good, strict=True)
        if not g
    )
    words = f"not that by {wrong}: in (30) s_y belongs for s_x" if not np.all(good) else ""
    return claim_row(
        "(29) to (32): derivatives that complex steps bear out",
        "",
        9,
        int(np.count_nonzero(good)),
        bool(np.all(good)),
        words,
    )


def _linear() -> Row:
    """(11) prints A θ = Y with A the derivatives of |s|² and Y = |g|²: not so at the truth."""
    unit = table_unit()
    force, _ = _readings_of(_exact_setting())
    scale, angles = zhang_from_matrix(unit.force_matrix, "small-angle")
    parameters = np.concatenate([np.real(scale), np.real(angles), unit.force_bias])
    told = np.array([stepped_derivatives(parameters, raw) @ parameters for raw in force]) / GRAVITY**2
    return claim_row(
        "(11): A θ over Y = |g|² at the truth",
        "1",
        1.0,
        round(float(np.mean(told)), 2),
        bool(np.allclose(told, 1.0, atol=1e-3)),
        "|s|² is not linear in the parameters: A is for a step, and Y is to be what |s|² misses",
    )


def _readings() -> list[Row]:
    """Return what it makes that T and R are read as small angles, beside table 4's scatter."""
    unit, tables = table_unit(), zhang()["tables"]
    rows: list[Row] = []
    for words, matrix, group in (
        ("accelerometers", unit.force_matrix, 0),
        ("gyros", unit.rate_matrix, 3),
    ):
        exact, small = (np.real(zhang_from_matrix(matrix, form)[0]) for form in ("exact", "small-angle"))
        low = float(np.max(1e6 * (1.0 - small / exact)))
        scatter = min(tables["4"]["rows"][group]["sigma"])
        rows.append(
            claim_row(
                f"T by (3), (5): scale factors of the {words} as read from the diagonal, below table 4's scatter",
                "ppm",
                scatter,
                round(low, 2),
                low < scatter,
                "the length of a row is the scale factor",
            )
        )
    true = ARCSECOND * np.array(tables["2"]["rows"][6]["set"])
    rotation = inter_triad_rotation(true)
    forms = [np.asarray(inter_triad_angles(rotation, form)) for form in FORMS]
    apart = max(float(np.max(np.abs(a - b))) for a in forms for b in forms) / ARCSECOND
    scatter = min(tables["4"]["rows"][6]["sigma"])
    rows.append(
        claim_row(
            "(6): rotation vector, small and Euler angles of R apart, below table 4's scatter",
            "″",
            scatter,
            round(apart, 2),
            apart < scatter,
            "the paper speaks of Euler angles and prints small ones",
        )
    )
    return rows


def _gravity() -> Row:
    """The constant of (42), about an axis thirty degrees from the vertical."""
    axis = np.array([0.5, 0.0, np.sqrt(0.75)])
    up = np.array([0.0, 0.0, 1.0])
    turned = [axis * (axis @ up) + (up - axis * (axis @ up)) * np.cos(a) for a in (0.0, 1.0, 2.0)]
    kappa = GRAVITY * float(np.mean([one @ axis for one in turned]))
    gravity = -GRAVITY * up
    return claim_row(
        "(42): κ with gravity as −g, axis 30° from the vertical",
        "m/s²",
        round(float(-gravity @ axis), 4),
        round(kappa, 4),
        bool(abs(kappa + float(gravity @ axis)) < 1e-9),
        "a specific force at rest points up; the scan prints q for g",
    )


def _null_vector(rng: np.random.Generator) -> Row:
    setting = table_setting("3")
    count = round(setting.duration * setting.sampling)
    axis = np.array([0.6, 0.0, 0.8])
    across = np.array([0.0, 1.0, 0.0])
    phase = setting.rate * (np.arange(count) + 0.5) / setting.sampling
    true = GRAVITY * (np.outer(np.cos(phase), across) + np.outer(np.sin(phase), np.cross(axis, across)))
    force = true + setting.force_noise * np.sqrt(setting.sampling) * rng.standard_normal((count, 3))
    design = np.column_stack([force, -np.ones(count)])
    null = np.linalg.svd(design, full_matrices=False)[2][3, :3]
    null /= np.linalg.norm(null)
    centred = axis_from_scatter(np.asarray(np.cov(force.T, bias=True), dtype=np.float64))
    apart = float(np.linalg.norm(np.cross(null, centred))) / ARCSECOND
    off = float(np.linalg.norm(np.cross(null, axis))) / ARCSECOND
    return claim_row(
        '(46): "the eigenvector of A", which takes a square A',
        "",
        "square",
        f"{design.shape[0]} × {design.shape[1]}",
        design.shape[0] == design.shape[1],
        f"its right null vector is what is wanted: {off:.1f}″ off with table 3's noise, and "
        f"{'less than 1e-6' if apart < 1e-6 else f'{apart:.2g}'}″ from that of the scatter about the mean",
    )


def _two_axes(rng: np.random.Generator) -> Row:
    """(40) on axes that enclose not quite the same angle in p and o."""
    sigma = ARCSECOND * zhang()["tables"]["3"]["rows"][1]["sigma"][2]
    axes_o = np.eye(3)[[2, 1]]
    # An error of zx tips the accelerometers' z axis towards y.
    error = sigma * rng.standard_normal(1000)
    axes_p = np.tile(axes_o, (1000, 1, 1))
    axes_p[:, 0, 1] += error
    axes_p /= np.linalg.norm(axes_p, axis=-1, keepdims=True)
    found = rotation_from_two_axes(axes_o, axes_p)
    off: AnyArray = np.asarray(np.swapaxes(found, -1, -2) @ found, dtype=np.float64) - np.eye(3)
    worst: Series = np.max(np.abs(off), axis=(1, 2))
    largest = float(np.sqrt(worst @ worst / worst.size)) / ARCSECOND
    return claim_row(
        "(40): R as printed, largest element of RᵀR − I, with table 3's misalignment",
        "″",
        0.0,
        round(largest, 1),
        largest < 1e-3,
        "it is a rotation only if the two axes enclose the same angle in both frames; TRIAD always gives one",
    )


def _raw_rows(rng: np.random.Generator) -> Row:
    setting = table_setting("3")
    force, _ = _readings_of(_exact_setting())
    count = round(setting.dwell * setting.sampling)
    samples = force[:, None] + setting.sigma[:3] * rng.standard_normal((len(force), count, 3))
    by_rows, by_means = (
        np.asarray(np.linalg.norm(ellipsoid_from_norms(raw, GRAVITY)[0], axis=1), dtype=np.float64)
        for raw in (samples.reshape(-1, 3), np.asarray(samples.mean(axis=1), dtype=np.float64))
    )
    shift = 1e6 * float(np.mean(by_rows / by_means - 1.0))
    square = 1e6 * (setting.force_noise / GRAVITY) ** 2 / setting.dwell
    return claim_row(
        "(13) on raw samples instead of means of a dwell: scale factors larger by",
        "ppm",
        0.0,
        round(shift, 1),
        abs(shift) < 1.0,
        f"noise squared is no noise; of a dwell's mean its square is {square:.2g} ppm",
    )


def _how_many() -> list[Row]:
    said = zhang()["claims"]["different_attitudes_and_rotations"]
    force = GRAVITY * ORIENTATIONS
    nine = smallest_share(_nine_columns(force[np.array(NINE) - 1]))
    six = smallest_share(printed_design(AXES)[:, :6])
    return [
        claim_row(
            "different attitudes that the accelerometers need",
            "",
            said,
            9 if nine > 1e-3 else "more",
            nine > 1e-3,
            f"nine unknowns; with the paper's nine the smallest singular value is {nine:.2f} of the largest",
        ),
        claim_row(
            "different rotations that the gyros need",
            "",
            said,
            6 if six > 1e-3 else "more",
            six < 1e-3,
            "the difference of both directions has neither bias nor Earth rate: six unknowns; with six axes the "
            f"smallest singular value is {six:.2f} of the largest",
        ),
    ]


def _nine_columns(force: Vectors) -> Table:
    return printed_design(force)[:, :9]


def _singular_sets() -> Row:
    """Which nine edges are singular, by the signs of the three that they leave out, one in each plane."""
    edges = ORIENTATIONS[np.max(np.abs(ORIENTATIONS), axis=1) < 0.9]
    singular: list[int] = []
    for signs in product((1, -1), repeat=3):
        out = [
            next(k for k, e in enumerate(edges) if e[i] > 0.0 and e[j] * sign > 0.0)
            for (i, j), sign in zip(((0, 1), (0, 2), (1, 2)), signs, strict=True)
        ]
        kept = np.delete(edges, out, axis=0)
        try:
            ellipsoid_from_norms(GRAVITY * kept, GRAVITY)
        except ObservabilityError:
            singular.append(int(np.prod(signs)))
    refused = bool(refusal(table_setting("5", (8, 10, 12, 13, 14, 15, 16, 17, 18))))
    return claim_row(
        "no. 8, 10 and 12 to 18 are singular",
        "",
        "singular",
        "singular" if refused else "not singular",
        refused,
        f"nine edges are so for {len(singular)} of 8 choices of the three left out, each with a product of signs of "
        f"{'+1' if set(singular) == {1} else singular}",
    )
