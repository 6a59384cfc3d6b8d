"""Section 9 of Savage (2018): what noise, the Earth rate and gyro biases do, by its formulas and by simulation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.counting import counted
from tumble.protocol.strapdown_rotation import start_down
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row, claim_row
from tumble.sensor.conventions.savage import GROUPS, NAMES, SavageErrors
from tumble.sensor.imu import ImuModel
from tumble.units import ARCSECOND, DEGREE_PER_HOUR, STANDARD_GRAVITY
from tumble_papers.published import savage
from tumble_papers.savage.formulas import BY_NAME, COMPONENTS, evaluated
from tumble_papers.savage.sequences import sequence_model, window_weights
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    DEGREE_PER_ROOT_HOUR,
    GRADES,
    START_NORM,
    UNITS_SI,
    Grade,
    Setting,
    Variant,
    measure_run,
    model_sequences,
    run_study,
    simulate_run,
)

SOURCE = "Savage 2018, section"
# The paper's groups of table 2: what a measurement of each says, and by how much of g.
KINDS = {
    "kappa_ppm": ("gyro scale factor", "ppm", 2.0 * np.pi, ("kappa",)),
    "upsilon_urad": ("gyro orthogonality", "µrad", 4.0, ("upsilon",)),
    "mu_urad": ("accelerometer misalignment", "µrad", 2.0, ("mu",)),
    "bias_ug": ("accelerometer bias", "µg", 2.0, ("lambda",)),
}
CHANCE = 0.001
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
        for kind in KINDS:
            found[kind].append(
                [
                    float(measured[sequence][component]) / recordings.gravity
                    for which, sequence, component in _designated()
                    if which == kind
                ]
            )
    return {kind: np.array(values) for kind, values in found.items()}


def expected_by_kind(setting: Setting, variant: Variant) -> dict[str, float]:
    """Return the root mean square of Δa in g for each kind, by the noise that each measurement is said to have.

    Parameters
    ----------
    setting, variant : of what.
    """
    models = model_sequences(setting, variant)
    names = [sequence.name for sequence in setting.sequences]
    return {
        kind: float(
            np.sqrt(
                np.mean(
                    [
                        models.covariances[names.index(sequence)][component, component]
                        for which, sequence, component in _designated()
                        if which == kind
                    ]
                )
            )
        )
        / STANDARD_GRAVITY
        for kind in KINDS
    }


def _root_mean_square(values: AnyArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _interval(values: AnyArray) -> tuple[float, float]:
    """Where 99.9 % of the root mean squares of normal numbers lie that have this one's scatter."""
    from scipy.special import chdtri

    count, size = values.size, _root_mean_square(values)
    low = float(np.sqrt(count / chdtri(count, 0.5 * CHANCE)))
    high = float(np.sqrt(count / chdtri(count, 1.0 - 0.5 * CHANCE)))
    return size * low, size * high


def to_digits(printed: float, value: float) -> bool:
    """Return whether a printed number is this one with as many digits as it has, rounded or cut off.

    Parameters
    ----------
    printed, value : positive numbers.
    """
    text = f"{printed:.10f}".rstrip("0")
    last = 10.0 ** -len(text.partition(".")[2])
    return abs(printed - value) <= last * 0.9 + 1e-12


def _table(
    item: str,
    title: str,
    printed: dict[str, Any],
    tilt: float,
    first: Row,
    simulated: dict[str, AnyArray],
    expected: dict[str, float] | None,
    bound: bool,
    why: str,
    runs: int,
    seed: int,
    notes: list[str],
) -> Outcome:
    """The table that sections 9.1 and 9.3 have in common: one tilt, divided by every H of table 2."""
    words = "no more than" if bound else "by noise"
    rows = [first]
    rows.append(_formula_row("change of acceleration Δa", "µg", printed["change_ug"], 1e6 * tilt))
    # The paper goes on with what it has rounded.
    change = float(printed["change_ug"])
    for kind, (name, unit_name, H, _) in KINDS.items():
        by_formula, values = change / H, 1e6 * simulated[kind] / H
        size = _root_mean_square(values)
        low, high = _interval(values)
        by_noise = None if expected is None else 1e6 * expected[kind] / H
        close = to_digits(printed[kind], by_formula)
        plausible = size <= by_formula * 1.1 if bound or by_noise is None else low <= by_noise <= high
        reason = f"{size / printed[kind]:.2f} of it: {why}"
        verdict = INSIDE if close and plausible else OUTSIDE
        cells = (printed[kind], by_formula, by_noise, size, low, high)
        rows.append(Row(name, unit_name, cells, UNJUDGED if runs < ENOUGH else verdict, reason))
    return Outcome(
        item,
        title,
        f"{SOURCE} {item.removeprefix('savage-')}",
        ("paper", "its formula", words, "simulated: rms", "lowest", "highest"),
        rows,
        "inside: the paper's number is what its formula gives, to its digits, and the simulation "
        + (
            "gives no more than a tenth above it"
            if bound
            else "is of the scatter that noise makes of these sequences (99.9 %, χ²)"
        ),
        notes=notes,
        repetitions=runs,
        seed=seed,
    )


def _formula_row(label: str, unit_name: str, printed: float, value: float) -> Row:
    close = to_digits(printed, value)
    return Row(
        label,
        unit_name,
        (printed, value, None, None, None, None),
        INSIDE if close else OUTSIDE,
        "" if close else f"the formula gives {value:.3g}",
    )


def reproduce_random_noise(repetitions: int, seed: int) -> Outcome:
    """Make section 9.1 anew: what the gyros' random walk and pulses do to each group of errors.

    Parameters
    ----------
    repetitions : runs of each.
    seed : of all random numbers.
    """
    rng = np.random.Generator(np.random.SFC64([seed, 91]))
    section = savage()["section_9"]
    walk, pulses = section["random_walk"], section["pulses"]
    density = walk["deg_rthour"] * DEGREE_PER_ROOT_HOUR
    tilt = density * np.sqrt(walk["seconds"])
    setting = Setting(unit(angle_random_walk=density), fixture=0.0, earth=False)
    outcome = _table(
        "savage-9.1",
        "Section 9.1: gyro random noise",
        walk,
        tilt,
        _formula_row("random walk: tilt", "µrad", walk["tilt_urad"], 1e6 * tilt),
        changes_by_kind(setting, AS_PRINTED, repetitions, rng),
        expected_by_kind(setting, AS_PRINTED),
        False,
        "averages of 10 s have a third of their time, and the rotations take 3 to 19 s",
        repetitions,
        seed,
        [_no_forty_seconds(density)],
    )
    pulse = pulses["arcsecond"] * ARCSECOND
    factor = float(np.sqrt(2.0 / 12.0))
    # The Earth moves the pulses along while the unit rests.
    setting = Setting(unit(angle_pulse=pulse), fixture=0.0)
    other = _table(
        "savage-9.1",
        "",
        pulses,
        factor * pulse,
        _formula_row("pulses: tilt", "µrad", pulses["tilt_urad"], 1e6 * factor * pulse),
        changes_by_kind(setting, AS_PRINTED, repetitions, rng),
        None,
        True,
        "an average over several pulses has less than one pulse's error",
        repetitions,
        seed,
        [],
    )
    outcome.rows.append(_formula_row("pulses: share of a pulse", "1", pulses["factor"], factor))
    outcome.rows += [
        replace(row, label=f"pulses: {row.label.removeprefix('pulses: ')}") for row in other.rows
    ]
    outcome.criterion += "; with pulses it gives no more than a tenth above it"
    return outcome


def _no_forty_seconds(density: float) -> str:
    seconds = 10.0 + 17.0
    return (
        f"The tilt at the end of a sequence of 27 s is {1e6 * density * np.sqrt(seconds):.1f} µrad. "
        "The paper takes 40 s, 20 of them at rest and 20 in rotation, which no sequence has. The "
        "simulation takes the sequences of table 1 at 1 rad/s with averages of 10 s."
    )


def reproduce_accelerometer_noise(repetitions: int, seed: int) -> Outcome:
    """Make section 9.2 anew: what accelerometer noise and pulses leave of averages of both kinds.

    Parameters
    ----------
    repetitions : runs of each.
    seed : of all random numbers.
    """
    grade = GRADES["nav"]
    noise = Setting(unit(velocity_random_walk=grade.velocity_random_walk), fixture=0.0, earth=False)
    # A fixture that is off lets gravity move the pulses of the level axes along.
    pulses = Setting(unit(velocity_pulse=1e-4), earth=False)
    values = _changes_of_force(noise, pulses, repetitions, seed)
    formula = np.sqrt(2.0 / noise.seconds) * grade.velocity_random_walk / STANDARD_GRAVITY * 1e6
    by_pulse = np.sqrt(2.0 * 2.0 / 12.0) * 1e-4 / pulses.seconds / STANDARD_GRAVITY * 1e6
    weights = window_weights(noise.window, "average-of-averages")
    loss = float(np.sqrt(np.sum(weights**2) * noise.window))
    plain, other = (_root_mean_square(values[f"noise {a}"]) for a in ("plain", "average-of-averages"))
    low, high = _interval(values["noise plain"])
    few = repetitions < ENOUGH
    rows = [
        Row(
            "3 µg/√Hz, averages of 10 s: Δa",
            "µg",
            (f"{formula:.3g}: as the root of the times", plain, low, high),
            UNJUDGED if few else INSIDE if low <= formula <= high else OUTSIDE,
            "" if low <= formula <= high else "outside of 99.9 %",
        ),
        _ratio_row(
            "random noise: average of averages over plain average",
            "1: unaffected",
            other / plain,
            other / plain < 1.05,
            f"a triangle of weights has {loss:.3f} times the noise of a plain average",
            few,
        ),
    ]
    plain, other = (_root_mean_square(values[f"pulses {a}"]) for a in ("plain", "average-of-averages"))
    low, high = _interval(values["pulses plain"])
    rows += [
        Row(
            "pulses of 0.1 mm/s, averages of 10 s: Δa",
            "µg",
            (f"{by_pulse:.3g}: 0.41 of a pulse over 10 s, twice", plain, low, high),
            UNJUDGED if few else INSIDE if 0.8 < plain / by_pulse < 1.2 else OUTSIDE,
            "" if 0.8 < plain / by_pulse < 1.2 else "another noise than that",
        ),
        _ratio_row(
            "pulses: average of averages over plain average",
            "below 1",
            other / plain,
            other < plain,
            f"{plain / other:.0f} times less",
            few,
        ),
    ]
    return Outcome(
        "savage-9.2",
        "Section 9.2: accelerometer noise",
        f"{SOURCE} 9.2",
        ("paper", "simulated: rms", "lowest", "highest"),
        rows,
        "inside: the simulation bears the sentence out (root mean squares: 99.9 %, χ²)",
        notes=["The section prints no number; 3 µg/√Hz and 0.1 mm/s are ours."],
        repetitions=repetitions,
        seed=seed,
    )


def _changes_of_force(noise: Setting, pulses: Setting, repetitions: int, seed: int) -> dict[str, AnyArray]:
    """µg, by what disturbs and how it is averaged."""
    triangle = replace(AS_PRINTED, averaging="average-of-averages")
    values: dict[str, AnyArray] = {}
    for name, setting in (("noise", noise), ("pulses", pulses)):
        for variant in (AS_PRINTED, triangle):
            # The same units for both averages.
            rng = np.random.Generator(np.random.SFC64([seed, 92]))
            changes = changes_by_kind(setting, variant, repetitions, rng)
            values[f"{name} {variant.averaging}"] = 1e6 * np.concatenate(list(changes.values()), axis=1)
    return values


def _ratio_row(label: str, said: str, found: float, agrees: bool, reason: str, few: bool) -> Row:
    return Row(
        label, "", (said, found, None, None), UNJUDGED if few else INSIDE if agrees else OUTSIDE, reason
    )


def reproduce_earth_rate(repetitions: int, seed: int) -> Outcome:
    """Make section 9.3 anew: what a heading that is off makes of the Earth rate, and what the errors make of it.

    Parameters
    ----------
    repetitions : runs of each.
    seed : of all random numbers.
    """
    section = savage()["section_9"]["earth"]
    tilt = section["angle_rad"] * section["rate_rad_s"] * section["seconds"]
    setting = Setting(unit(), fixture=0.0, heading=section["angle_rad"])
    rng = np.random.Generator(np.random.SFC64([seed, 93]))
    outcome = _table(
        "savage-9.3",
        "Section 9.3: Earth rate",
        section,
        tilt,
        _formula_row("heading off by 1 mrad: tilt", "µrad", section["tilt_urad"], 1e6 * tilt),
        changes_by_kind(setting, AS_PRINTED, repetitions, rng),
        None,
        True,
        "13 to 29 s between the averages instead of 40, and a part of the Earth rate is level",
        repetitions,
        seed,
        [_PRODUCTS],
    )
    outcome.rows += _products(max(repetitions // 4, 1), seed)
    return outcome


_PRODUCTS = (
    "Errors times Earth rate: the same units on an exact fixture, with the Earth rate less without it, root mean "
    "square."
)


def _products(runs: int, seed: int) -> list[Row]:
    """What errors of 1 mrad make of the Earth rate: with it less without it, the same units."""
    low, high = savage()["section_9"]["earth"]["products_urad"]
    grade = unit(scale=1e-3, asymmetry=1e-3, angle=1e-3, bias=1e-3 * STANDARD_GRAVITY)
    with_it, without = (
        run_study(
            Setting(grade, fixture=0.0, earth=earth),
            (AS_PRINTED,),
            runs,
            np.random.Generator(np.random.SFC64([seed, 94])),
            iterations=2,
        )[0]
        for earth in (True, False)
    )
    apart = (with_it - without) / UNITS_SI
    rows: list[Row] = []
    names = {"kappa_lin": "κ", "upsilon": "υ", "lambda_bias": "λ", "mu": "μ"}
    sizes: list[list[float]] = [
        [_root_mean_square(apart[:, k, GROUPS[group]]) for group in names] for k in range(2)
    ]
    words = ", ".join(f"{letter} {s:.2g}" for letter, s in zip(names.values(), sizes[0], strict=True))
    few = runs < 5
    for label, said, values, agrees in (
        (
            "errors of 1 mrad times Earth rate, first pass: largest group",
            f"{low} to {high}",
            max(sizes[0]),
            max(sizes[0]) <= 2.0 * high,
        ),
        ("the same after one iteration", "negligible", max(sizes[1]), max(sizes[1]) < 0.1 * low),
    ):
        verdict = UNJUDGED if few else INSIDE if agrees else OUTSIDE
        rows.append(Row(label, "ppm, µrad, µg", (said, None, None, values, None, None), verdict, words))
        words = "" if agrees else "larger"
    return rows


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
    terms = next(
        e
        for e in savage()["equation_12"]
        if (e["sequence"], e["component"]) == (entry["sequence"], entry["component"])
    )["terms"]
    first = next(iter(terms))
    by_error = evaluated(terms[first], 1.0)
    assert first in NAMES
    printed = np.array([_in_seconds(entry[axis], setting) for axis in "xyz"])
    by_model = model.bias_coefficients[component] / by_error
    return (
        printed,
        np.asarray(by_model, dtype=np.float64),
        _simulated_bias(row.name, component, setting) / by_error,
    )


def _in_seconds(expression: str, setting: Setting) -> float:
    """A coefficient of (22), such as "-1/rate - T/2π"."""
    total = 0.0
    sign = 1.0
    for word in expression.replace("-", " - ").replace("+", " + ").split():
        if word in "+-":
            sign = -1.0 if word == "-" else 1.0
            continue
        value = 1.0
        for number, factor in enumerate(word.split("/")):
            size = {"T": setting.seconds, "rate": setting.rate, "π": np.pi, "2π": 2.0 * np.pi}.get(factor)
            size = float(factor) if size is None else size
            value = value * size if number == 0 else value / size
        total += sign * value
        sign = 1.0
    return total


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


def reproduce_gyro_bias(repetitions: int, seed: int) -> Outcome:
    """Make section 9.4 anew: every coefficient of (22), its examples, and the way out of it.

    Parameters
    ----------
    repetitions : runs of the last rows; the others have no chance in them.
    seed : of all random numbers.
    """
    setting = Setting(unit(), fixture=0.0, earth=False)
    rows: list[Row] = []
    for entry in savage()["equation_22"]:
        printed, model, simulated = bias_errors(entry, setting)
        for axis in range(3):
            if max(abs(printed[axis]), abs(model[axis])) < 1e-9:
                continue
            agrees = abs(printed[axis] - simulated[axis]) < 0.01
            reason = "" if agrees else "the sign is the other"
            if entry["words"] == "similarly":
                reason = f"{reason}; printed as similar" if reason else "printed as similar"
            cells = (float(printed[axis]), float(model[axis]), float(simulated[axis]))
            label = f"{entry['of']} by κ {'xyz'[axis]}, sequence {entry['sequence']}"
            rows.append(Row(label, "s", cells, INSIDE if agrees else OUTSIDE, reason))
    rows += _examples(setting)
    shares = [_lag(kind) for kind in ("plain", "average-of-averages")]
    F = savage()["section_9"]["gyro_bias"]["F"]
    rows.append(
        Row(
            "F of a plain average; of an average of averages",
            "1",
            (F, shares[0], shares[1]),
            INSIDE if all(abs(share - F) < 1e-3 for share in shares) else OUTSIDE,
            "" if all(abs(share - F) < 1e-3 for share in shares) else "not a half",
        )
    )
    rows += _independence(repetitions, seed)
    return Outcome(
        "savage-9.4",
        "Section 9.4: gyro bias",
        f"{SOURCE} 9.4",
        ("paper", "by (20), (21)", "simulated"),
        rows,
        "inside: printed and simulated agree; a bias of 0.1 °/h about one axis at a time, no noise, 1 rad/s, 10 s",
        repetitions=repetitions,
        seed=seed,
    )


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
        agrees = to_digits(said, values[2])
        reason = "" if agrees else f"the printed formula gives {values[0]:+.3g}; the sign is the other"
        rows.append(
            Row(
                f"example: {name}",
                unit_name,
                (said, values[1], values[2]),
                INSIDE if agrees else OUTSIDE,
                reason,
            )
        )
    return rows


def _independence(repetitions: int, seed: int) -> list[Row]:
    """Whether the mean of the first window takes the bias away."""
    runs = max(repetitions // 4, 1)

    def study(rate: float) -> AnyArray:
        quality = Setting(replace(GRADES["nav"], gyro_bias=rate * DEGREE_PER_HOUR))
        rng = np.random.Generator(np.random.SFC64([seed, 95]))
        return run_study(quality, (START_NORM,), runs, rng, iterations=2)[0, :, 1]

    small, large = study(10.0) / UNITS_SI, study(1000.0) / UNITS_SI
    rows: list[Row] = []
    for words, where in (
        ("gyro scale factors", slice(0, 6)),
        ("υ", GROUPS["upsilon"]),
        ("accelerometer bias", GROUPS["lambda_bias"]),
    ):
        ratio = _root_mean_square(large[:, where]) / _root_mean_square(small[:, where])
        rows.append(
            claim_row(
                f"{words}, start bias: 1000 °/h over 10 °/h",
                "1",
                "independent",
                float(f"{ratio:.3g}"),
                0.8 < ratio < 1.25,
                "" if 0.8 < ratio < 1.25 else "the bias is not gone",
            )
        )
    return [replace(row, cells=(row.cells[0], None, row.cells[1])) for row in rows]
