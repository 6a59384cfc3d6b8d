"""Section 9 of Savage (2018): what noise, the Earth rate and gyro biases do, by its formulas and by simulation.

How accurate the strapdown rotation test is: grades, ways to evaluate it, play-backs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.counting import counted
from tumble.protocol import start_down
from tumble.reproduction import INSIDE, OUTSIDE, UNJUDGED, Row, Value
from tumble.sensor import GROUPS, ImuModel, SavageErrors
from tumble.units import ARCSECOND, DEGREE_PER_HOUR, STANDARD_GRAVITY
from tumble_papers.savage.formulas import BY_NAME, COMPONENTS, evaluated
from tumble_papers.savage.sequences import AVERAGING, sequence_model, window_weights
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    DEGREE_PER_ROOT_HOUR,
    GRADES,
    START_NORM,
    UNITS_SI,
    VARIANTS,
    Grade,
    Setting,
    Variant,
    group_rms,
    measure_run,
    model_sequences,
    run_study,
    simulate_run,
)
from tumble_papers.study import Found, Study, generator, judge, savage, scatter_range

# The paper's groups of table 2: what a measurement of each says, and by how much of g.
KINDS = {
    "kappa_ppm": ("gyro scale factor", "ppm", 2.0 * np.pi, ("kappa",)),
    "upsilon_urad": ("gyro orthogonality", "µrad", 4.0, ("upsilon",)),
    "mu_urad": ("accelerometer misalignment", "µrad", 2.0, ("mu",)),
    "bias_ug": ("accelerometer bias", "µg", 2.0, ("lambda",)),
}
ENOUGH = 20


def unit(**changes: float) -> Grade:
    """Return a unit without any error, but for what is given.

    Parameters
    ----------
    changes : fields of `Grade`.
    """
    nothing = Grade("one error", 0.0, 0.0, scale=0.0, asymmetry=0.0, angle=0.0, bias=0.0)
    return replace(nothing, **changes)


def _designated() -> list[tuple[str, str, int]]:
    """Return (kind, sequence, component) of each horizontal measurement of (12)."""
    found: list[tuple[str, str, int]] = []
    for entry in savage()["equation_12"]:
        if entry["component"].startswith("down"):
            continue
        first = next(iter(entry["terms"]))
        kind = next(k for k, (_, _, _, names) in KINDS.items() if first.startswith(names))
        found.append((kind, entry["sequence"], COMPONENTS.index(entry["component"])))
    return found


def changes_by_kind(
    setting: Setting, variant: Variant, runs: int, rng: np.random.Generator
) -> dict[str, AnyArray]:
    """Simulate units and return (runs, measurements) of Δa in g for each kind of error.

    Parameters
    ----------
    setting, variant : what to simulate, and how to measure.
    runs : how many units.
    rng : source of all numbers.
    """
    found: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    for stream in counted(rng.spawn(runs), runs):
        recordings = simulate_run(setting, stream)
        measured = measure_run(recordings, ImuModel.ideal(), variant)
        for values in found.values():
            values.append([])
        for kind, sequence, component in _designated():
            found[kind][-1].append(float(measured[sequence][component]) / recordings.gravity)
    return {kind: np.array(values) for kind, values in found.items()}


def expected_by_kind(setting: Setting, variant: Variant) -> dict[str, float]:
    """Return the root mean square of Δa in g for each kind, by the noise that each measurement is said to have.

    Parameters
    ----------
    setting, variant : of what.
    """
    _, covariances = model_sequences(setting, variant)
    by_name = {s.name: covariance for s, covariance in zip(setting.sequences, covariances, strict=True)}
    variances: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for kind, sequence, component in _designated():
        variances[kind].append(by_name[sequence][component, component])
    return {kind: float(np.sqrt(np.mean(of))) / STANDARD_GRAVITY for kind, of in variances.items()}


def _root_mean_square(values: AnyArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _interval(values: AnyArray) -> tuple[float, float]:
    """Where 99.9 % of the root mean squares of normal numbers lie that have this one's scatter."""
    size, (low, high) = _root_mean_square(values), scatter_range(values.size)
    return size / high, size / low


def to_digits(printed: float, value: float) -> bool:
    """Return whether a printed number is this one with as many digits as it has, rounded or cut off.

    Parameters
    ----------
    printed, value : positive numbers.
    """
    text = f"{printed:.10f}".rstrip("0")
    last = 10.0 ** -len(text.partition(".")[2])
    return abs(printed - value) <= last * 0.9 + 1e-12


def _tilt_rows(
    what: str,
    printed: dict[str, Any],
    tilt: float,
    simulated: dict[str, AnyArray],
    expected: dict[str, float] | None,
    why: str,
) -> list[Row]:
    """What sections 9.1 and 9.3 have in common: one tilt, divided by every H of table 2.

    Where no noise is expected, the formula is a bound.
    """
    rows = [
        _formula_row(f"{what}: tilt", "µrad", printed["tilt_urad"], 1e6 * tilt),
        _formula_row("change of acceleration Δa", "µg", printed["change_ug"], 1e6 * tilt),
    ]
    # The paper goes on with what it has rounded.
    change = float(printed["change_ug"])
    for kind, (name, unit_name, H, _) in KINDS.items():
        by_formula, values = change / H, 1e6 * simulated[kind] / H
        size, (low, high) = _root_mean_square(values), _interval(values)
        by_noise = None if expected is None else 1e6 * expected[kind] / H
        plausible = size <= by_formula * 1.1 if by_noise is None else low <= by_noise <= high
        fits = to_digits(printed[kind], by_formula) and plausible
        verdict = UNJUDGED if len(values) < ENOUGH else INSIDE if fits else OUTSIDE
        cells = (printed[kind], by_formula, by_noise, size, low, high)
        rows.append(Row(name, unit_name, cells, verdict, f"{size / printed[kind]:.2f} of it: {why}"))
    return rows


def _formula_row(label: str, unit_name: str, printed: float, value: float) -> Row:
    verdict = judge(to_digits(printed, value), f"the formula gives {value:.3g}")
    return Row(label, unit_name, (printed, value, None, None, None, None), *verdict)


def _random_noise(repetitions: int, seed: int) -> Found:
    """Make section 9.1 anew: what the gyros' random walk and pulses do to each group of errors."""
    rng = generator(seed, 91)
    walk, pulses = (savage()["section_9"][of] for of in ("random_walk", "pulses"))
    density = walk["deg_rthour"] * DEGREE_PER_ROOT_HOUR
    setting = Setting(unit(angle_random_walk=density), fixture=0.0, earth=False)
    rows = _tilt_rows(
        "random walk",
        walk,
        density * np.sqrt(walk["seconds"]),
        changes_by_kind(setting, AS_PRINTED, repetitions, rng),
        expected_by_kind(setting, AS_PRINTED),
        "averages of 10 s have a third of their time, and the rotations take 3 to 19 s",
    )
    pulse, factor = pulses["arcsecond"] * ARCSECOND, float(np.sqrt(2.0 / 12.0))
    # The Earth moves the pulses along while the unit rests.
    setting = Setting(unit(angle_pulse=pulse), fixture=0.0)
    other = _tilt_rows(
        "pulses",
        pulses,
        factor * pulse,
        changes_by_kind(setting, AS_PRINTED, repetitions, rng),
        None,
        "an average over several pulses has less than one pulse's error",
    )
    rows.append(_formula_row("pulses: share of a pulse", "1", pulses["factor"], factor))
    rows += [replace(row, label=f"pulses: {row.label.removeprefix('pulses: ')}") for row in other]
    # The shortest sequences: a rotation of 17 s, and an average.
    return Found(rows, said={"tilt": 1e6 * density * float(np.sqrt(10.0 + 17.0))})


def _accelerometer_noise(repetitions: int, seed: int) -> Found:
    """Make section 9.2 anew: what accelerometer noise and pulses leave of averages of both kinds."""
    grade = GRADES["nav"]
    noise = Setting(unit(velocity_random_walk=grade.velocity_random_walk), fixture=0.0, earth=False)
    # A fixture that is off lets gravity move the pulses of the level axes along.
    pulses = Setting(unit(velocity_pulse=1e-4), earth=False)
    values = _changes_of_force(noise, pulses, repetitions, seed)
    formula = np.sqrt(2.0 / noise.seconds) * grade.velocity_random_walk / STANDARD_GRAVITY * 1e6
    by_pulse = np.sqrt(2.0 * 2.0 / 12.0) * 1e-4 / pulses.seconds / STANDARD_GRAVITY * 1e6
    weights = window_weights(noise.window, "average-of-averages")
    loss = float(np.sqrt(np.sum(weights**2) * noise.window))
    rows: list[Row] = []

    def add(label: str, unit_name: str, cells: tuple[Value, ...], fits: bool, no: str, yes: str = "") -> None:
        verdict = UNJUDGED if repetitions < ENOUGH else INSIDE if fits else OUTSIDE
        rows.append(Row(label, unit_name, cells, verdict, yes if fits else no))

    average = "average of averages over plain average"
    plain, other = (_root_mean_square(values[f"noise {a}"]) for a in AVERAGING)
    low, high = _interval(values["noise plain"])
    cells = (f"{formula:.3g}: as the root of the times", plain, low, high)
    add("3 µg/√Hz, averages of 10 s: Δa", "µg", cells, low <= formula <= high, "outside of 99.9 %")
    words = f"a triangle of weights has {loss:.3f} times the noise of a plain average"
    cells = ("1: unaffected", other / plain, None, None)
    add(f"random noise: {average}", "", cells, other / plain < 1.05, words, words)
    plain, other = (_root_mean_square(values[f"pulses {a}"]) for a in AVERAGING)
    cells = (f"{by_pulse:.3g}: 0.41 of a pulse over 10 s, twice", plain, *_interval(values["pulses plain"]))
    fits = 0.8 < plain / by_pulse < 1.2
    add("pulses of 0.1 mm/s, averages of 10 s: Δa", "µg", cells, fits, "another noise than that")
    words = f"{plain / other:.0f} times less"
    add(f"pulses: {average}", "", ("below 1", other / plain, None, None), other < plain, words, words)
    return Found(rows)


def _changes_of_force(noise: Setting, pulses: Setting, repetitions: int, seed: int) -> dict[str, AnyArray]:
    """µg, by what disturbs and how it is averaged."""
    triangle = replace(AS_PRINTED, averaging="average-of-averages")
    values: dict[str, AnyArray] = {}
    for name, setting in (("noise", noise), ("pulses", pulses)):
        for variant in (AS_PRINTED, triangle):
            # The same units for both averages.
            changes = changes_by_kind(setting, variant, repetitions, generator(seed, 92))
            values[f"{name} {variant.averaging}"] = 1e6 * np.concatenate(list(changes.values()), axis=1)
    return values


def _earth_rate(repetitions: int, seed: int) -> Found:
    """Make section 9.3 anew: what a heading that is off makes of the Earth rate, and what the errors make of it."""
    section = savage()["section_9"]["earth"]
    setting = Setting(unit(), fixture=0.0, heading=section["angle_rad"])
    rows = _tilt_rows(
        "heading off by 1 mrad",
        section,
        section["angle_rad"] * section["rate_rad_s"] * section["seconds"],
        changes_by_kind(setting, AS_PRINTED, repetitions, generator(seed, 93)),
        None,
        "13 to 29 s between the averages instead of 40, and a part of the Earth rate is level",
    )
    rows += _products(max(repetitions // 4, 1), seed)
    return Found(rows)


def _products(runs: int, seed: int) -> list[Row]:
    """What errors of 1 mrad make of the Earth rate: with it less without it, the same units."""
    low, high = savage()["section_9"]["earth"]["products_urad"]
    grade = unit(scale=1e-3, asymmetry=1e-3, angle=1e-3, bias=1e-3 * STANDARD_GRAVITY)
    with_it, without = (
        run_study(
            Setting(grade, fixture=0.0, earth=earth), (AS_PRINTED,), runs, generator(seed, 94), iterations=2
        )[0]
        for earth in (True, False)
    )
    apart = (with_it - without) / UNITS_SI
    names = {"kappa_lin": "κ", "upsilon": "υ", "lambda_bias": "λ", "mu": "μ"}
    sizes = [[_root_mean_square(apart[:, k, GROUPS[group]]) for group in names] for k in range(2)]
    words = ", ".join(f"{letter} {s:.2g}" for letter, s in zip(names.values(), sizes[0], strict=True))
    first, second = (max(of) for of in sizes)
    few = "" if runs < 5 else None
    label = "errors of 1 mrad times Earth rate, first pass: largest group"
    cells = (
        (f"{low} to {high}", None, None, first, None, None),
        ("negligible", None, None, second, None, None),
    )
    (verdict, _), later = judge(first <= 2.0 * high, "", few), judge(second < 0.1 * low, "larger", few)
    return [
        Row(label, "ppm, µrad, µg", cells[0], verdict, words),
        Row("the same after one iteration", "ppm, µrad, µg", cells[1], *later),
    ]


def bias_errors(entry: dict[str, Any], setting: Setting) -> tuple[Series, Series, Series]:
    """Return (3,) of an error by a gyro bias about x, y and z, in s: as printed, by (20) and (21), simulated.

    Parameters
    ----------
    entry : of (22).
    setting : times and rates.
    """
    row = BY_NAME[entry["sequence"]]
    component = COMPONENTS.index(entry["component"])
    model = sequence_model(
        list(row.rotations), start_down(row), 1.0, rate=setting.rate, seconds=setting.seconds
    )
    # what the error itself does to the measurement: of a bias over g, or a number
    key = entry["sequence"], entry["component"]
    (terms,) = [e["terms"] for e in savage()["equation_12"] if (e["sequence"], e["component"]) == key]
    by_error = evaluated(next(iter(terms.values())), 1.0)
    printed = np.array([evaluated(entry[axis], T=setting.seconds, rate=setting.rate) for axis in "xyz"])
    by_model = np.asarray(model.bias_coefficients[component] / by_error, dtype=np.float64)
    return printed, by_model, _simulated_bias(row.name, component, setting) / by_error


def _simulated_bias(name: str, component: int, setting: Setting) -> Series:
    rate = 0.1 * DEGREE_PER_HOUR
    one = replace(setting, sequences=(BY_NAME[name],))
    found = np.empty(3)
    for axis in range(3):
        truth = SavageErrors.from_vector(np.zeros(24), gyro_bias=rate * np.eye(3)[axis])
        recordings = simulate_run(one, np.random.default_rng(0), truth=truth)
        measured = measure_run(recordings, ImuModel.ideal(), AS_PRINTED)[name]
        found[axis] = measured[component] / recordings.gravity / rate
    return found


def _gyro_bias(repetitions: int, seed: int) -> Found:
    """Make section 9.4 anew: every coefficient of (22), its examples, and the way out of it, which alone has runs."""
    setting = Setting(unit(), fixture=0.0, earth=False)
    rows: list[Row] = []
    for entry in savage()["equation_22"]:
        printed, model, simulated = bias_errors(entry, setting)
        for axis in range(3):
            if max(abs(printed[axis]), abs(model[axis])) < 1e-9:
                continue
            agrees = abs(printed[axis] - simulated[axis]) < 0.01
            similar = "printed as similar" if entry["words"] == "similarly" else ""
            reason = "; ".join(
                words for words in ("" if agrees else "the sign is the other", similar) if words
            )
            cells = tuple(float(of[axis]) for of in (printed, model, simulated))
            label = f"{entry['of']} by κ {'xyz'[axis]}, sequence {entry['sequence']}"
            rows.append(Row(label, "s", cells, INSIDE if agrees else OUTSIDE, reason))
    rows += _examples(setting)
    shares = [_lag(kind) for kind in AVERAGING]
    F = savage()["section_9"]["gyro_bias"]["F"]
    verdict = judge(all(abs(share - F) < 1e-3 for share in shares), "not a half")
    rows.append(Row("F of a plain average; of an average of averages", "1", (F, *shares), *verdict))
    rows += _independence(repetitions, seed)
    return Found(rows)


def _lag(kind: str) -> float:
    """By what share of the window's time a steady rate turns the frame between a window's average and its end."""
    weights = window_weights(1000, kind)
    return float(np.sum(weights * (np.arange(1000)[::-1] + 0.5)) / 1000)


def _examples(setting: Setting) -> list[Row]:
    """The three numbers that the section works out."""
    section = savage()["section_9"]["gyro_bias"]
    small = section["rate_rad_s"]
    entries = {entry["of"]: entry for entry in savage()["equation_22"]}
    rows: list[Row] = []
    for name, bias, said, unit_name in (
        ("υ xy", np.array([0.5, 0.5, -1.0]), section["upsilon_xy_urad"], "µrad"),
        ("μ xy + υ xy/2", np.array([0.0, 1.0, 0.0]), section["mu_xy_urad"], "µrad"),
        ("λ y/g + υ yz", np.array([1.0, -0.5, -0.5]), section["lambda_y_ug"], "µg"),
    ):
        printed, model, simulated = bias_errors(entries[name], setting)
        values = [1e6 * small * float(bias @ c) for c in (printed, model, simulated)]
        why = f"the printed formula gives {values[0]:+.3g}; the sign is the other"
        verdict = judge(to_digits(said, values[2]), why)
        rows.append(Row(f"example: {name}", unit_name, (said, *values[1:]), *verdict))
    return rows


def _independence(repetitions: int, seed: int) -> list[Row]:
    """Whether the mean of the first window takes the bias away."""
    runs = max(repetitions // 4, 1)

    def study(rate: float) -> AnyArray:
        quality = Setting(replace(GRADES["nav"], gyro_bias=rate * DEGREE_PER_HOUR))
        return run_study(quality, (START_NORM,), runs, generator(seed, 95), iterations=2)[0, :, 1]

    small, large = study(10.0) / UNITS_SI, study(1000.0) / UNITS_SI
    rows: list[Row] = []
    for words, where in (
        ("gyro scale factors", slice(0, 6)),
        ("υ", GROUPS["upsilon"]),
        ("accelerometer bias", GROUPS["lambda_bias"]),
    ):
        ratio = _root_mean_square(large[:, where]) / _root_mean_square(small[:, where])
        label = f"{words}, start bias: 1000 °/h over 10 °/h"
        cells = ("independent", None, float(f"{ratio:.3g}"))
        rows.append(Row(label, "1", cells, *judge(0.8 < ratio < 1.25, "the bias is not gone")))
    return rows


LABELS = {
    "kappa_lin": ("κ lin", "ppm"), "kappa_asym": ("κ asym", "ppm"), "upsilon": ("υ", "µrad"),
    "lambda_bias": ("λ bias", "µg"), "mu": ("μ", "µrad"), "lambda_lin": ("λ lin", "ppm"),
    "lambda_asym": ("λ asym", "ppm"),
}  # fmt: skip
ITERATIONS = 3
# A 99 % quantile of 200 runs moves by so much by sampling alone: that of the other implementation.
THEIR_SAMPLING = 0.12
RESAMPLED = 400
ENOUGH_UNITS = 50
# What a second play-back may still change of the first's.
SETTLED = 0.01
# Fewer ways for the other grades: the formulas' slips are the same for all.
LESS_WAYS = ("as printed, signs corrected", "start bias and norm", "start bias and norm, all components")

# The others' third pass is their second.
THREE_PASSES = ("as printed, signs corrected", "as printed, its signs too", "start bias and norm")


def _ways(grade: str) -> tuple[Variant, ...]:
    if grade == "nav":
        return VARIANTS
    return tuple(v for v in VARIANTS if v.name in LESS_WAYS or v.name.startswith("common bias and norm, all"))


def resampled(
    values: Series, statistic: Callable[[AnyArray], AnyArray], rng: np.random.Generator
) -> tuple[float, float]:
    """Return between which values a statistic of the runs lies in 95 % of bootstrap samples.

    Parameters
    ----------
    values : (runs,).
    statistic : of (samples, runs) along the last axis.
    rng : source of the samples.
    """
    drawn = statistic(values[rng.integers(0, len(values), (RESAMPLED, len(values)))])
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _quantile(share: float) -> Callable[[AnyArray], AnyArray]:
    return lambda values: np.asarray(np.quantile(values, share, axis=-1), dtype=np.float64)


def _rms(values: AnyArray) -> AnyArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)), dtype=np.float64)


def _accuracy(repetitions: int, seed: int) -> Found:
    """Simulate the test for three grades in many ways: rms and quantiles of each group of errors, each play-back."""
    sampling = generator(seed, 99)
    rows: list[Row] = []
    notes: list[str] = []
    for number, grade in counted(enumerate(GRADES), len(GRADES)):
        ways, rng = _ways(grade), generator(seed, 98, number)
        errors = run_study(Setting(GRADES[grade]), ways, repetitions, rng, iterations=ITERATIONS)
        groups = group_rms(errors)
        for which, way in enumerate(ways):
            for iteration in range(ITERATIONS if way.name in THREE_PASSES else 2):
                values = {name: groups[name][which, :, iteration] for name in LABELS}
                rows += _rows(grade, way, iteration, values, sampling)
        notes += _notes(grade, ways, groups, errors)
    return Found(rows, notes=notes, said={"theirs": 100 * THEIR_SAMPLING})


def _rows(
    grade: str, way: Variant, iteration: int, values: Mapping[str, Series], rng: np.random.Generator
) -> list[Row]:
    rows: list[Row] = []
    for name, (label, unit) in LABELS.items():
        each = values[name]
        if not np.any(each):
            continue
        said = _said(grade, way, iteration, name)
        # Each statistic with its interval, in the order of the columns.
        statistics = (_quantile(0.99), _rms, _quantile(0.95))
        told = [(float(of(each)), *resampled(each, of, rng)) for of in statistics]
        verdict = UNJUDGED, ""
        if said is not None and len(each) >= ENOUGH_UNITS:
            ours, low, high = told[0]
            fits = low * (1.0 - THEIR_SAMPLING) <= said <= high * (1.0 + THEIR_SAMPLING)
            verdict = judge(fits, f"ours is {ours / said:.2f} of it")
        cells = (iteration, said, *(value for of in told for value in of))
        rows.append(Row(f"{grade}, {way.name}: {label}", unit, cells, *verdict))
    return rows


def _said(grade: str, way: Variant, iteration: int, group: str) -> float | None:
    for row in savage()["another_implementation"]["rows"]:
        if row["grade"] == grade and row["variant"] == way.name and iteration in row["iterations"]:
            return row["values"][group]
    return None


def _notes(
    grade: str, ways: tuple[Variant, ...], groups: Mapping[str, AnyArray], errors: AnyArray
) -> list[str]:
    """What the play-backs change, what all components gain, what the printed signs do."""
    names = [way.name for way in ways]
    plain = names.index("start bias and norm")
    rms = {name: np.sqrt(np.mean(values**2, axis=1)) for name, values in groups.items()}
    change = max(float(abs(values[plain, 2] / values[plain, 1] - 1.0)) for values in rms.values())
    notes = [f"{grade}: a second iteration changes the rms of no group by more than {100 * change:.1g} %."]
    if change > SETTLED:
        notes[-1] += " That is more than 1 %."
    gains = [float(values[names.index(LESS_WAYS[2]), 1] / values[plain, 1]) for values in rms.values()]
    best = names[-1]
    ours = [float(values[-1, 1] / values[plain, 1]) for values in rms.values()]
    notes.append(
        f"{grade}: all components have {min(gains):.2f} to {max(gains):.2f} of (13)'s rms, {best} "
        f"{min(ours):.2f} to {max(ours):.2f}."
    )
    if "as printed, its signs too" in names:
        at = names.index("as printed, its signs too")
        wrong, right = (float(rms["lambda_asym"][k, 0]) for k in (at, names.index(LESS_WAYS[0])))
        later = float(rms["lambda_asym"][at, 2])
        notes.append(
            f"{grade}: with the printed sign of (13) λ asym is wrong by {wrong:.0f} ppm (rms) in the "
            f"first pass, {right:.0f} with the right one. Iterating hides it: {later:.2g} ppm after "
            "the third pass."
        )
    bias = np.mean(errors[plain, :, 1] / UNITS_SI, axis=0)
    sigma = np.std(errors[plain, :, 1] / UNITS_SI, axis=0) / np.sqrt(errors.shape[1])
    if errors.shape[1] >= ENOUGH_UNITS:
        off = float(np.max(np.abs(bias) / sigma))
        notes.append(
            f"{grade}: the mean of no error is more than {off:.1f} of its standard deviations off zero."
        )
    return notes


SECTION_9 = (
    Study("savage-9.1", _random_noise),
    Study("savage-9.2", _accelerometer_noise),
    Study("savage-9.3", _earth_rate),
    Study("savage-9.4", _gyro_bias),
    Study("savage-accuracy", _accuracy),
)
"""Section 9, and how accurate the test is."""
