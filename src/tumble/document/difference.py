"""What changed between two calibrations of one unit, in sigmas, and what that does to corrected numbers.

Both take the unit's own clock, or the norm of the field, to be what a data sheet or somebody says. By whatever that is
wrong, both are wrong alike: in a difference it cancels. With V the covariance of one of them and
g = d(parameters)/d(share), that part of V is at most 1/(gᵀ V⁻¹ g). Where the recording has determined the clock
itself, as a table does, that is less than what was assumed, and nothing is common.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.attitude import twenty_six_directions
from tumble.calibration import NAMES, nearest_axes
from tumble.document.entries import (
    PLACES,
    SIZE,
    model_of_vector,
    named_parameters,
    stacked,
    term_of,
    turned_to,
)
from tumble.document.magnetometer_block import FieldBlock, MagnetometerBlock
from tumble.document.result import Calibration, ParameterBlock
from tumble.errors import UsageError
from tumble.parameters import ACCELEROMETER, BETWEEN, GYRO, Family, family_of, parameter_of
from tumble.records import dataclass
from tumble.sensor import FRAMES, ImuModel, inverse, jacobian
from tumble.units import STANDARD_GRAVITY, magnetic_field_factor

Complex = npt.NDArray[Any]

# Farther apart in temperature two calibrations are of different states of the unit.
_FAR = 5.0


# Of a parameter's natural size: what a change of frame and back makes of zero.
_ROUNDING = 1e-12
_NATURAL = 1e-9  # of a parameter's natural size, below which an uncertainty is rounding too
_OPTIONAL = ("asymmetry", "quadratic", "g_sensitivity")
# Of biases, scale factors and angles: optional terms have rows of their own.
_PLAIN = (ACCELEROMETER, GYRO, BETWEEN)


@dataclass(frozen=True)
class ParameterChange:
    """A parameter in both calibrations; `sigmas` is the change over its standard uncertainty, NaN without one.

    A change that is mere rounding is none: `second` is then `first`.
    """

    name: str
    first: float
    second: float
    standard_uncertainty: float
    sigmas: float
    unit: str


@dataclass(frozen=True)
class GroupChange:
    """Several parameters together: chi-square of their change with its probability by chance.

    Where a number changed that both calibrations state as certain, chi-square is infinite.
    """

    name: str
    chi_square: float
    degrees_of_freedom: int
    probability: float


@dataclass(frozen=True)
class Effect:
    """How far apart corrected numbers of one raw sample are, SI, at the worst place, with its standard uncertainty."""

    name: str
    value: float
    standard_uncertainty: float


@dataclass(frozen=True)
class Difference:
    """Two calibrations compared.

    Attributes
    ----------
    parameters, groups : what changed, in the frame `frame`, one by one and together.
    force : m/s², largest change of a corrected specific force of 1 g.
    rest_rate : rad/s, change of the corrected rate at rest, worst pose.
    rate_scale : change of a corrected rate over the rate, largest.
    remarks : sentences.
    """

    frame: str
    parameters: list[ParameterChange]
    groups: list[GroupChange]
    force: Effect | None
    rest_rate: Effect | None
    rate_scale: Effect | None
    remarks: list[str]

    @property
    def significant(self) -> bool:
        """Whether any group changed by more than chance, at 5 % over all groups."""
        return any(group.probability < 0.05 / len(self.groups) for group in self.groups)


def compare_calibrations(first: Calibration, second: Calibration) -> Difference:
    """Return what changed from `first` to `second`.

    Both are brought into the first one's frame and raw units. Their errors are taken as independent; what they
    share (the same gravity, fixture or noise model) makes true differences look smaller in sigmas than they are.

    Raises
    ------
    UsageError
        If a frame or the units cannot be matched, or they have no triad in common.
    CalibrationFileError
        If one has no matrix of either triad.
    """
    remarks: list[str] = []
    first, second = _same_frame(first, second, remarks)
    scale = _unit_factors(first, second)
    one, spread_one = stacked(first)
    two, spread_two = stacked(second)
    change = _scaling(scale)
    two, spread_two = change * two, spread_two * np.outer(change, change)
    models = (model_of_vector(one, first.model), model_of_vector(two, second.model))
    for kind in ("accelerometer", "gyroscope"):
        if (getattr(models[0], kind) is None) != (getattr(models[1], kind) is None):
            remarks.append(f"Only one of the two has a calibrated {kind}: it is left out.")
    has = [
        all(getattr(model, kind) is not None for model in models) for kind in ("accelerometer", "gyroscope")
    ]
    if not any(has):
        raise UsageError("The two calibrations have no triad in common.")
    _about_temperature(first, second, remarks)
    if not first.covariance_parameters or not second.covariance_parameters:
        remarks.append(
            "One of the two has no uncertainties: the sigmas are those of the other alone, or missing."
        )
    terms = [name for name in PLACES if name.endswith(_OPTIONAL) and has[name.startswith("gyroscope")]]
    terms = [name for name in terms if np.any(term_of(one, name)) or np.any(term_of(two, name))]
    table = _tables((first, second), models, (spread_one, spread_two), scale, remarks)
    table[0] |= _optional_rows(terms, one, spread_one, first)
    table[1] |= _optional_rows(terms, two, spread_two, first)
    natural = _natural_sizes(one)
    clock = _common_clock((first, second), (one, two), (spread_one, spread_two))
    if clock:
        remarks.append(
            "Both take the sample rate as the same nominal one. What its uncertainty does to both alike is taken out. "
            "A clock that has changed shows as gyro scale factors that all change alike."
        )
    changes = [
        _changed(table[0][name], table[1][name], _natural_size(parameter_of(name).family, natural), clock)
        for name in table[0]
        if name in table[1]
    ]
    remarks += _one_sided(terms, one, two)
    changes.sort(key=lambda change: parameter_of(change.name).family.triad != "accelerometer")
    of_field, groups_of_field = _field_changes(first.magnetometer, second.magnetometer, remarks)
    shared = clock * np.outer(_along_clock(one), _along_clock(two))
    joint = np.block([[spread_one, shared], [shared.T, spread_two]])
    both = np.concatenate([one, two])
    return Difference(
        frame=first.frame.name,
        parameters=changes + of_field,
        groups=_groups(one, two, spread_one + spread_two - shared - shared.T, has, terms, natural)
        + groups_of_field,
        force=_worst("specific force of 1 g", _force_change, both, joint) if has[0] else None,
        rest_rate=_worst("rate at rest", _rest_change(has[0]), both, joint) if has[1] else None,
        rate_scale=_worst("rate, relative", _rate_change, both, joint) if has[1] else None,
        remarks=remarks,
    )


def _tables(
    documents: tuple[Calibration, Calibration],
    models: tuple[ImuModel, ImuModel],
    spreads: tuple[Square, Square],
    scale: tuple[float, float],
    remarks: list[str],
) -> list[dict[str, ParameterBlock]]:
    """The parameters of both by name: as both say them, or derived anew where frame or units differ."""
    first, second = documents
    alike = first.frame.name == second.frame.name and scale == (1.0, 1.0)
    if alike and first.parameters and second.parameters:
        # What the frame sets to zero, or nothing has determined, is no row of either.
        table = [
            {p.name: p for p in one.parameters if parameter_of(p.name).family.group in _PLAIN}
            for one in documents
        ]
        remarks += _alone(table)
        return table
    return [
        {p.name: p for p in named_parameters(model, spread, first.raw_units)}
        for model, spread in zip(models, spreads, strict=True)
    ]


def _alone(tables: list[dict[str, ParameterBlock]]) -> list[str]:
    """Say which parameters only one of the two has determined."""
    said: list[str] = []
    for which, own, other in (("first", *tables), ("second", *reversed(tables))):
        missing = [name for name in own if name not in other]
        if missing:
            said.append(f"Determined by the {which} calibration alone: {', '.join(missing)}.")
    return said


def _same_frame(
    first: Calibration, second: Calibration, remarks: list[str]
) -> tuple[Calibration, Calibration]:
    if first.frame.name == second.frame.name:
        return first, second
    if first.frame.name in FRAMES:
        remarks.append(f"The second calibration was turned to the first one's frame, {first.frame.name}.")
        return first, turned_to(second, first.frame.name)
    if second.frame.name in FRAMES:
        remarks.append(f"The first calibration was turned to the second one's frame, {second.frame.name}.")
        return turned_to(first, second.frame.name), second
    frame = "accelerometer-x"
    remarks.append(
        f"The frames {first.frame.name} and {second.frame.name} are fixed from outside: both were turned to {frame}."
    )
    return turned_to(first, frame), turned_to(second, frame)


def _unit_factors(first: Calibration, second: Calibration) -> tuple[float, float]:
    """What the second one's raw numbers are multiplied by to be the first one's."""
    factors: list[float] = []
    both = zip(first.raw_units.factors, second.raw_units.factors, strict=True)
    for name, (ours, theirs) in zip(("specific_force", "angular_rate"), both, strict=True):
        units = getattr(first.raw_units, name), getattr(second.raw_units, name)
        if (ours is None) != (theirs is None):
            raise UsageError(
                f"One calibration takes {units[0]}, the other {units[1]}: they cannot be compared."
            )
        factors.append(1.0 if ours is None or theirs is None else theirs / ours)
    return factors[0], factors[1]


def _scaling(scale: tuple[float, float]) -> Series:
    change = np.ones(SIZE)
    change[:12] = scale[0]
    change[15:18] = 1.0 / scale[0]
    change[18:30] = scale[1]
    change[33:36] = 1.0 / scale[1]
    change[36:] = scale[1]
    return change


def _about_temperature(first: Calibration, second: Calibration, remarks: list[str]) -> None:
    celsius = (first.temperature_celsius, second.temperature_celsius)
    if first.thermal is not None or second.thermal is not None:
        remarks.append(
            "What changes with temperature is not compared: the numbers are those at the reference temperature."
        )
    if celsius[0] is not None and celsius[1] is not None and abs(celsius[0] - celsius[1]) > _FAR:
        remarks.append(
            f"They are of {celsius[0]:.1f} °C and {celsius[1]:.1f} °C: part of the change may be the temperature's."
        )


def _natural_sizes(values: Series) -> tuple[float, float]:
    """Raw units per SI unit of the two triads: what a bias of zero is compared with."""
    sizes = [
        float(np.linalg.norm(term_of(values, f"{kind}.matrix"))) for kind in ("accelerometer", "gyroscope")
    ]
    return sizes[0] or 1.0, sizes[1] or 1.0


def _natural_size(family: Family, natural: tuple[float, float]) -> float:
    """How large a number of that family would be if it were not small, in its own unit."""
    own = natural[family.triad != "accelerometer"]
    if family.kind == "quadratic":
        return 1.0 / own
    return own if family.kind in ("bias", "g-sensitivity", "scale factor") else 1.0


def _changed(one: Any, two: Any, size: float, clock: float = 0.0) -> ParameterChange:
    shared = 2.0 * clock * _scale_slope(one) * _scale_slope(two)
    sigma = float(np.sqrt(max(one.standard_uncertainty**2 + two.standard_uncertainty**2 - shared, 0.0)))
    moved = two.value - one.value
    largest = max(size, abs(one.value), abs(two.value))
    if sigma <= _NATURAL * largest:
        sigma = 0.0
    if abs(moved) <= _ROUNDING * largest:
        two, moved = one, 0.0
    sigmas = moved / sigma if sigma > 0.0 else float("nan")
    return ParameterChange(one.name, one.value, two.value, sigma, sigmas, one.unit)


def _optional_rows(
    terms: list[str], values: Series, spread: Table, first: Calibration
) -> dict[str, ParameterBlock]:
    """Rows of the terms that at least one calibration has, in the first one's units: zero where this one has none."""
    rows: dict[str, ParameterBlock] = {}
    for term in terms:
        family, place, units = family_of(term), PLACES[term][0], first.raw_units
        raw = units.specific_force if family.triad == "accelerometer" else units.angular_rate
        sigmas = np.sqrt(np.maximum(np.diag(spread)[place], 0.0)).tolist()
        for (name, unit), value, sigma in zip(
            family.labels(raw), values[place].tolist(), sigmas, strict=True
        ):
            rows[name] = ParameterBlock(name=name, value=value, standard_uncertainty=sigma, unit=unit)
    return rows


def _one_sided(terms: list[str], one: Series, two: Series) -> list[str]:
    """Say which terms only one of the two has."""
    said: list[str] = []
    for term in terms:
        if np.any(term_of(one, term)) != np.any(term_of(two, term)):
            which = "first" if np.any(term_of(one, term)) else "second"
            words = term.replace(".", " ").replace("g_s", "g-s")
            said.append(f"Only the {which} has {words}: in the other it is taken as zero.")
    return said


def _groups(
    one: Series, two: Series, spread: Table, has: list[bool], terms: list[str], natural: tuple[float, float]
) -> list[GroupChange]:
    """Biases, matrices and optional terms of each triad together."""
    found: list[GroupChange] = []
    for number, (short, kind) in enumerate((("accelerometers", "accelerometer"), ("gyros", "gyroscope"))):
        if not has[number]:
            continue
        own = [f"{kind}.bias", f"{kind}.matrix", *(t for t in terms if t.startswith(kind))]
        for term in own:
            # A matrix has entries of the size of a scale factor.
            what, place = term.partition(".")[2], PLACES[term][0]
            size = 1.0 if what == "matrix" else _natural_size(family_of(term), natural)
            size = max(size, float(np.max(np.abs(one[place]))))
            words = {"bias": "biases", "g_sensitivity": "g-sensitivity"}.get(what, what)
            group = _group(f"{short}: {words}", (two - one)[place], spread[place, place], size)
            found += [] if group is None else [group]
    return found


def _field_changes(
    first: MagnetometerBlock | None, second: MagnetometerBlock | None, remarks: list[str]
) -> tuple[list[ParameterChange], list[GroupChange]]:
    """What changed of the magnetometer; what keeps it from being compared becomes a remark."""
    if first is None and second is None:
        return [], []
    one, two = (None if block is None else block.triad for block in (first, second))
    if first is None or second is None or one is None or two is None:
        remarks.append("The magnetometer is not compared: not both have one that is fit for use.")
        return [], []
    factors = magnetic_field_factor(first.raw_unit), magnetic_field_factor(second.raw_unit)
    if first.unit != second.unit or (factors[0] is None) != (factors[1] is None):
        remarks.append("The magnetometer is not compared: the two state it in units of different kinds.")
        return [], []
    factor = 1.0 if factors[0] is None or factors[1] is None else factors[1] / factors[0]
    natural = float(np.linalg.norm(one.matrix))
    of_first, of_second = ({p.name: p for p in block.parameters} for block in (first, second))
    alike = first.frame == second.frame and np.array_equal(nearest_axes(one.matrix), nearest_axes(two.matrix))
    if not alike:
        remarks.append(
            "How the magnetometer's axes lie is not compared: the frames or the axes are other ones."
        )
    known = first.covariance_parameters if first.covariance_parameters == second.covariance_parameters else []
    at = [NAMES.index(name) for name in known]
    numbers = [
        np.concatenate([by * triad.matrix.ravel(), by * triad.bias])[at]
        for by, triad in ((1.0, one), (factor, two))
    ]
    spreads = np.array(first.covariance), factor**2 * np.array(second.covariance)
    of_matrix = np.array(at) < 9
    along = [np.where(of_matrix, own, 0.0) for own in numbers]
    norm = _common_norm((first.field, second.field), along, spreads) if known else 0.0
    if norm:
        remarks.append(
            "Both take the same norm of the magnetic field, or the mean scale of a data sheet. What its uncertainty "
            "does to both magnetometers alike is taken out."
        )
    changes: list[ParameterChange] = []
    for name in [name for name in of_first if name in of_second]:
        turned = parameter_of(name).family.kind == "rotation"
        if turned and not alike:
            continue
        by = 1.0 if turned else factor
        here, there = of_first[name], of_second[name]
        sigma = by * there.standard_uncertainty
        there = replace(there, value=by * there.value, standard_uncertainty=sigma, unit=here.unit)
        changes.append(_changed(here, there, 1.0 if turned else natural, norm))
    if not alike or not known:
        return changes, []
    shared = norm * np.outer(along[0], along[1])
    spread = spreads[0] + spreads[1] - shared - shared.T
    moved = numbers[1] - numbers[0]
    parts = (("biases", ~of_matrix), ("matrix", of_matrix))
    groups = [_group(f"magnetometer: {what}", moved[i], spread[np.ix_(i, i)], natural) for what, i in parts]
    return changes, [group for group in groups if group is not None]


def _group(name: str, moved: Series, spread: Table, size: float) -> GroupChange | None:
    """Chi-square of some numbers together, None where nothing is known of their uncertainty."""
    from scipy.stats import chi2

    values, vectors = np.linalg.eigh(spread)
    seen = values > max(1e-12 * max(float(values[-1]), 0.0), (_NATURAL * size) ** 2)
    if not seen.any():
        return None
    along = vectors.T @ moved
    count = int(seen.sum())
    if np.any(np.abs(along[~seen]) > 10.0 * _NATURAL * size):
        return GroupChange(name, float("inf"), count, 0.0)
    statistic = float(np.sum(along[seen] ** 2 / values[seen]))
    return GroupChange(name, statistic, count, float(chi2.sf(statistic, count)))


def _raw(x: Complex, kind: str, true: AnyArray) -> tuple[Complex, Complex]:
    """Return what a triad reads for a true vector, and its sensors' own inputs."""
    own = term_of(x, f"{kind}.matrix") @ true
    return own + term_of(x, f"{kind}.bias") + _bent(x, kind, own), own


def _bent(x: Complex, kind: str, own: Complex) -> Complex:
    return (
        term_of(x, f"{kind}.asymmetry") * own * np.sign(np.real(own))
        + term_of(x, f"{kind}.quadratic") * own**2
    )


def _corrected(x: Complex, kind: str, raw: Complex, near: Complex) -> Complex:
    """Return the true vector of a reading; what bends it is small, and taken at own inputs near by."""
    return inverse(term_of(x, f"{kind}.matrix")) @ (raw - term_of(x, f"{kind}.bias") - _bent(x, kind, near))


def _force_change(x: Complex, direction: AnyArray) -> Complex:
    raw, own = _raw(x[:SIZE], "accelerometer", STANDARD_GRAVITY * direction)
    return _corrected(x[SIZE:], "accelerometer", raw, own) - STANDARD_GRAVITY * direction


def _rest_change(has_force: bool) -> Any:
    def change(x: Complex, direction: AnyArray) -> Complex:
        one, two = x[:SIZE], x[SIZE:]
        force = STANDARD_GRAVITY * direction
        seen = _force_change(x, direction) + force if has_force else force
        raw = term_of(one, "gyroscope.bias") + term_of(one, "gyroscope.g_sensitivity") @ force
        rest = raw - term_of(two, "gyroscope.bias") - term_of(two, "gyroscope.g_sensitivity") @ seen
        return inverse(term_of(two, "gyroscope.matrix")) @ rest

    return change


def _rate_change(x: Complex, direction: AnyArray) -> Complex:
    """At 1 rad/s, biases apart."""
    raw, own = _raw(x[:SIZE], "gyroscope", direction)
    bias = term_of(x[:SIZE], "gyroscope.bias") - term_of(x[SIZE:], "gyroscope.bias")
    return _corrected(x[SIZE:], "gyroscope", raw - bias, own) - direction


def _worst(name: str, change: Any, both: Series, joint: Table) -> Effect:
    """The largest change over directions, with the uncertainty of its component along itself."""
    directions = twenty_six_directions()
    changes = [np.real(change(both.astype(complex), direction)) for direction in directions]
    sizes = [float(np.linalg.norm(vector)) for vector in changes]
    at = int(np.argmax(sizes))
    along = changes[at] / sizes[at] if sizes[at] > 0.0 else np.array([1.0, 0.0, 0.0])
    effect = jacobian(lambda x: np.array([along @ change(x, directions[at])]), both)
    return Effect(name, sizes[at], float(np.sqrt(max(float((effect @ joint @ effect.T)[0, 0]), 0.0))))


# --- what both share without seeing it

_UNDETERMINED = 0.9  # of the assumed variance that a recording leaves, where it did not determine the clock
# Of a rate: regular stamps of two recordings give one data sheet rate to the digits that they have.
_SAME = 1e-5
_MATRIX = PLACES["gyroscope.matrix"][0]


def _common_clock(
    calibrations: tuple[Calibration, Calibration], values: tuple[Series, Series], spreads: tuple[Table, Table]
) -> float:
    """Return the variance of what both clocks are off alike, as a share squared; zero where nothing is common.

    Parameters
    ----------
    calibrations : of one unit.
    values, spreads : (parameters,) and their covariances, as `entries.stacked` gives them.
    """
    assumed = [_assumed(calibration) for calibration in calibrations]
    one, other = assumed
    if one is None or other is None or one[1] != other[1] or abs(one[0] / other[0] - 1.0) > _SAME:
        return 0.0
    variance = one[1] ** 2
    left = [_largest_part(spread, _along_clock(own)) for own, spread in zip(values, spreads, strict=True)]
    return min(variance, *left) if min(left) >= _UNDETERMINED * variance else 0.0


def _common_norm(
    fields: tuple[FieldBlock | None, FieldBlock | None], along: list[Series], spreads: tuple[Table, Table]
) -> float:
    """Return the variance of what both norms of the field are off alike, as a share squared; zero where nothing is.

    Parameters
    ----------
    fields : in which the magnetometers were found.
    along, spreads : (n,) numbers of which each moves as its own size, the others zero; and their covariances.
    """
    one, other = fields
    if one is None or other is None or one.norm_given != other.norm_given:
        return 0.0
    # A norm that is not given is by the mean scale that data sheets promise: of one unit it is one and the same.
    if one.norm_given and (one.source, one.norm) != (other.source, other.norm):
        return 0.0
    assumed = min((field.norm_standard_uncertainty / field.norm) ** 2 for field in (one, other))
    return min(assumed, *(_largest_part(spread, own) for own, spread in zip(along, spreads, strict=True)))


def _along_clock(values: Series) -> Series:
    """Return by how much each number moves per share that a clock is off: the gyros' matrix does.

    Parameters
    ----------
    values : (parameters,) as `entries.stacked` gives them.
    """
    along = np.zeros_like(values)
    along[_MATRIX] = values[_MATRIX]
    return along


def _scale_slope(parameter: ParameterBlock) -> float:
    """Return by how much a parameter moves per share that a clock, or the norm of the magnetic field, is off.

    Parameters
    ----------
    parameter : of any kind.
    """
    family = parameter_of(parameter.name).family
    if family.triad == "accelerometer" or family.kind not in ("scale factor", "scale factor error"):
        return 0.0
    return parameter.value + (1.0 if family.kind == "scale factor error" else 0.0)


def _largest_part(spread: Table, along: Series) -> float:
    """The largest c for which ``V - c g gᵀ`` is a covariance."""
    known = np.flatnonzero(np.diag(spread) > 0.0)
    if not np.any(along[known]) or np.any(along[np.setdiff1d(np.arange(along.size), known)]):
        return 0.0
    scaled = np.sqrt(np.diag(spread)[known])
    unit = spread[np.ix_(known, known)] / np.outer(scaled, scaled)
    slope = along[known] / scaled
    return float(1.0 / (slope @ np.linalg.pinv(unit, hermitian=True) @ slope))


def _assumed(calibration: Calibration) -> tuple[float, float] | None:
    """The rate that is taken as nominal, in Hz, and its relative standard uncertainty."""
    for one in calibration.quality.unseen:
        if one.nominal_rate_hz is not None:
            return one.nominal_rate_hz, one.relative_standard_uncertainty
    return None
