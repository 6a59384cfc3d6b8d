"""The unknowns of both triads in named blocks, and the sensors' raw output with its derivatives by them.

The accelerometers' bias, scale and angles as Shin has them, the gyros' whole matrix and bias, and what may be besides:
optional terms, the unit's rotation in its fixture, and what may be wrong alike with all that they are compared with:
clock and table. The model runs forwards, from true to raw: noise is a sensor's own.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Vectors
from tumble.calibration.equations.triad_unknowns import QUADRATIC, unknowns_from_triad
from tumble.calibration.terms import TERMS
from tumble.calibration.terms.term import PAIRS_OF_AXES, curves_of
from tumble.estimation import Block, Layout, Prior, Unknowns
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad, change_frame, matrix_from_shin, shin_derivatives

# What a unit's name plate promises, one sigma: 30 mg and 1 °/s of bias, 3 % of scale, 3 % of an angle in rad.
NAME_PLATE_FORCE, NAME_PLATE_RATE, NAME_PLATE_SHARE = 0.3, 0.02, 0.03
MOUNTING = 0.2  # rad
# Where closed forms and the procedure by hand have these two, among the first 36.
_EARLY = ("quadratic", "g_sensitivity")


def _axes(name: str, label: str, remedy: str) -> Block:
    return Block(name, tuple(label.format(a) for a in "xyz"), tuple(remedy.format(a) for a in "xyz"))


def _gyro_label(a: str, b: str) -> str:
    return f"scale factor of gyro {a}" if a == b else f"what gyro {a} senses of a rate about {b}"


LAYOUT = Layout(
    (
        _axes("force.bias", "bias of accelerometer {}", "a hold with {0} up and one with {0} down"),
        _axes("force.scale", "scale factor of accelerometer {}", "a hold with {0} up and one with {0} down"),
        Block(
            "force.angle",
            tuple(f"non-orthogonality {angle} of the accelerometers" for angle in ("yz", "zx", "zy")),
            tuple(f"a hold with an edge between {a} and {b} up" for a, b in ("xy", "yz", "xz")),
        ),
        TERMS["quadratic"].block,
        Block(
            "gyro.matrix",
            tuple(_gyro_label(a, b) for a, b in PAIRS_OF_AXES),
            tuple(f"a turn about {b} while {b} lies level" for _, b in PAIRS_OF_AXES),
        ),
        _axes("gyro.bias", "bias of gyro {}", "a longer rest"),
        TERMS["g_sensitivity"].block,
        _axes(
            "fixture",
            "rotation of the unit in its fixture about {}",
            "believed poses with two different faces up in the same fixture",
        ),
        *(term.block for term in TERMS.values() if term.name not in _EARLY),
        Block(
            "clock", ("clock of the recording",), ("the sample rate with its uncertainty (--rate 100±0.1)",)
        ),
        Block("table_rate", ("rate of the table",), ("its uncertainty in the protocol (uncertainty_ppm)",)),
    )
)
"""All unknowns that there may be.

``fixture`` is the rotation vector (rad) of C_bf, from the fixture's axes to the sensors' frame b. Optional terms are as
`tumble.calibration.terms` has them. ``clock`` is the share by which true time runs faster than the stamps,
and ``table_rate`` that by which the table turns faster than the protocol says: nothing but what is believed of both
keeps gyro scale factors from following them.
"""
FORCE_ALONE = LAYOUT.indices("force.bias", "force.scale", "force.angle")
"""Accelerometers without a gyro."""
PLAIN = LAYOUT.indices("force.bias", "force.scale", "force.angle", "gyro.matrix", "gyro.bias")
"""Both triads without optional terms."""


def imu_unknowns(values: Series | None = None, free: np.ndarray = PLAIN) -> Unknowns:
    """Return unknowns of both triads.

    Parameters
    ----------
    values : the first of all, or all of them; what is not given is zero.
    free : indices of those that are adjusted.
    """
    made = np.zeros(LAYOUT.size)
    if values is not None:
        made[: values.size] = values
    return Unknowns(LAYOUT, made, free)


def unknowns_of(model: ImuModel) -> Series:
    """Return all unknowns of a model with both triads, in whatever frame it is.

    Raises
    ------
    ValueError
        If a triad is missing.
    """
    if model.accelerometer is None or model.gyroscope is None:
        raise ValueError("the joint estimator's unknowns are those of both triads")
    own = change_frame(model, "accelerometer-x")
    assert own.accelerometer is not None
    assert own.gyroscope is not None
    values = np.zeros(LAYOUT.size)
    values[: QUADRATIC.stop] = unknowns_from_triad(own.accelerometer)
    values[LAYOUT["gyro.matrix"]] = own.gyroscope.matrix.ravel()
    values[LAYOUT["gyro.bias"]] = own.gyroscope.bias
    if own.g_sensitivity is not None:
        values[LAYOUT["gyro.g_sensitivity"]] = own.g_sensitivity.ravel()
    return values


def name_plate(u: Unknowns) -> Series:
    """Return one sigma of each unknown as any unit's name plate promises it, in its own unit.

    Parameters
    ----------
    u : start values: raw units are the sensors' own.
    """
    scale, rows = np.abs(u["force.scale"]), np.linalg.norm(gyro_matrix(u), axis=1)
    made = u.at(np.ones(u.values.size))
    for name, size in (
        ("force.bias", NAME_PLATE_FORCE * scale),
        ("force.scale", NAME_PLATE_SHARE * scale),
        ("force.angle", NAME_PLATE_SHARE),
        ("gyro.matrix", np.repeat(NAME_PLATE_SHARE * rows, 3)),
        ("gyro.bias", NAME_PLATE_RATE * rows),
        ("fixture", MOUNTING),
        *((t.block.name, t.plate(scale if t.of == "accelerometer" else rows)) for t in TERMS.values()),
        ("clock", NAME_PLATE_SHARE),
        ("table_rate", NAME_PLATE_SHARE),
    ):
        made[name][:] = size
    return made.values


def force_matrix(u: Unknowns) -> Matrix:
    """Return the accelerometers' matrix, raw per m/s², in the frame ``accelerometer-x``."""
    made = np.real(matrix_from_shin(u["force.scale"], u["force.angle"]))
    return np.ascontiguousarray(made, dtype=np.float64)


def gyro_matrix(u: Unknowns) -> Matrix:
    """Return the gyros' matrix, raw per rad/s."""
    return np.ascontiguousarray(u["gyro.matrix"].reshape(3, 3))


def g_sensitivity(u: Unknowns) -> Matrix:
    """Return the gyros' g-sensitivity, raw per m/s²."""
    return np.ascontiguousarray(u["gyro.g_sensitivity"].reshape(3, 3))


@dataclass(frozen=True)
class RawOutput:
    """Raw output of a triad: (rows, 3), by the true force or rate (rows, 3, 3), by blocks (rows, 3, block)."""

    value: Vectors
    by_true: AnyArray
    by_blocks: dict[str, AnyArray]


def raw_force(u: Unknowns, true: Vectors, apart: AnyArray | None = None) -> RawOutput:
    """Return what the accelerometers show for a specific force in b, with derivatives.

    Parameters
    ----------
    u : where the unknowns are.
    true : (rows, 3) m/s².
    apart : (rows, 3, 3) m/s² that each accelerometer (second) feels beyond it where it sits; None for one place.
    """
    matrix = force_matrix(u)
    felt = true[:, None, :] if apart is None else true[:, None, :] + apart
    felt = np.broadcast_to(felt, (len(true), 3, 3))
    own = np.einsum("ab,nab->na", matrix, felt)
    bent, slope, by_curves = _bent(u, "accelerometer", own)
    scale = u.layout["force.scale"].start
    moves = shin_derivatives(u.values[scale : u.layout["force.angle"].stop])
    turned = slope[:, :, None] * np.einsum("abp,nab->nap", moves, felt)
    blocks = {
        "force.bias": np.broadcast_to(np.eye(3), (len(true), 3, 3)),
        "force.scale": turned[:, :, :3],
        "force.angle": turned[:, :, 3:],
        **by_curves,
    }
    return RawOutput(bent + u["force.bias"], slope[:, :, None] * matrix, blocks)


def raw_rate(u: Unknowns, true: Vectors, force: Vectors) -> RawOutput:
    """Return what the gyros show for an angular rate in b while a specific force acts.

    Parameters
    ----------
    u : where the unknowns are.
    true, force : (rows, 3) rad/s and m/s².
    """
    bent, slope, by_curves = _bent(u, "gyroscope", true @ gyro_matrix(u).T)
    blocks = {
        "gyro.matrix": _rows(slope[:, :, None] * true[:, None, :]),
        "gyro.bias": np.broadcast_to(np.eye(3), (len(true), 3, 3)),
        **by_curves,
    }
    if u.is_free("gyro.g_sensitivity"):
        blocks["gyro.g_sensitivity"] = _rows(np.broadcast_to(force[:, None, :], (len(true), 3, 3)))
    value = bent + force @ g_sensitivity(u).T + u["gyro.bias"]
    return RawOutput(value, slope[:, :, None] * gyro_matrix(u), blocks)


def _bent(u: Unknowns, kind: str, own: Vectors) -> tuple[Vectors, Vectors, dict[str, AnyArray]]:
    """The own input with all curves of a triad, what that rises by with it, and derivatives by their blocks."""
    value, slope, blocks = own, np.ones(own.shape), dict[str, AnyArray]()
    for name, curve in curves_of(TERMS, kind):
        shape = curve.of(own)
        value, slope = value + u[name] * shape, slope + u[name] * curve.slope(own)
        if u.is_free(name):
            blocks[name] = shape[:, :, None] * np.eye(3)
    return value, slope, blocks


def _rows(values: AnyArray) -> AnyArray:
    """(rows, 3, 9) by a matrix's entries, sensor by sensor, of each sensor's derivatives by its own row."""
    made = np.zeros((len(values), 3, 3, 3))
    made[:, range(3), range(3)] = values
    return made.reshape(-1, 3, 9)


def straightened(u: Unknowns, raw: Vectors) -> Vectors:
    """Return what the gyros would show if they were symmetric and linear, their own sign taken from the output.

    Parameters
    ----------
    u : where the unknowns are.
    raw : (samples, 3).
    """
    sizes = {t.curve: u[t.block.name] for t in TERMS.values() if t.curve and t.of == "gyroscope"}
    bent = {name: size for name, size in sizes.items() if np.any(size)}
    bias = u["gyro.bias"]
    return bias + Triad(gyro_matrix(u), bias, **bent).own_input(raw) if bent else raw


def term_unknowns(name: str) -> np.ndarray:
    """Return the indices of an optional term's unknowns that are adjusted."""
    term = TERMS[name]
    indices = LAYOUT.indices(term.block.name)
    return indices if term.columns is None else indices[term.columns]


def terms_prior(u: Unknowns) -> Prior | None:
    """Return what the name plate knows of the optional terms; None if none is free.

    What the motion does not tell of them stays small.

    Parameters
    ----------
    u : the unknowns.
    """
    held = [term for term in TERMS.values() if u.is_free(term.block.name)]
    if not held:
        return None
    precision, plate = np.zeros((u.values.size, u.values.size)), name_plate(u)
    for term in held:
        at = term_unknowns(term.name)
        precision[at, at] = 1.0 / plate[at] ** 2
    return Prior(np.zeros(u.values.size), precision)
