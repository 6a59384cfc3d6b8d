"""calibration.json: read back as written, checked on reading, and usable by anyone with a few lines of numpy."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tumble.calibration import Estimate, Holds, NamedValue, Said, TermTest, Turns, canonical_names
from tumble.document import Calibration, calibration_from_estimate, read_calibration
from tumble.earth import Site
from tumble.errors import CalibrationFileError, ConvergenceError
from tumble.recording import Recording, Source
from tumble.sensor import ImuModel, Triad

REAL = st.floats(-0.05, 0.05, allow_nan=False)


def model_of(numbers, *, terms, scale, zero) -> ImuModel:
    """A unit near the ideal one: 30 numbers are its errors, `scale` and `zero` those of its converter."""
    x = np.array(numbers)
    accelerometer = Triad(
        scale[0] * (np.eye(3) + np.tril(x[:9].reshape(3, 3))),
        zero[0] + scale[0] * x[9:12],
        None,
        x[12:15] / scale[0] / 100.0 if "quadratic" in terms else None,
    )
    gyroscope = Triad(scale[1] * (np.eye(3) + x[15:24].reshape(3, 3)), zero[1] + scale[1] * x[24:27])
    sensitivity = None
    if "g_sensitivity" in terms:
        sensitivity = scale[1] * 1e-2 * np.outer(x[27:30] + 0.01, [1.0, -2.0, 3.0])
    return ImuModel(accelerometer, gyroscope, sensitivity)


def document_of(numbers, *, terms=frozenset({"g_sensitivity", "quadratic"}), counts=False, **changed):
    return calibration_from_estimate(
        replace(estimate_of(numbers, terms=terms, counts=counts), **changed),
        Recording(
            np.arange(4.0), np.ones((4, 3)), np.ones((4, 3)),
            "counts" if counts else "m/s^2", "counts" if counts else "rad/s", 1.0,
            sources=(Source("tumbled.csv", "0" * 64),),
        ),
        Site.from_latitude(0.8, 100.0),
        created=datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC),
        imu=("model", "serial"),
    )  # fmt: skip


def estimate_of(numbers: list[float], *, terms: frozenset[str], counts: bool) -> Estimate:
    model = model_of(
        numbers,
        terms=terms,
        scale=(400.0, 4000.0) if counts else (1.0, 1.0),
        zero=(32768.0, 2048.0) if counts else (0.0, 0.0),
    )
    names = canonical_names(terms, "full")
    root = np.random.default_rng(7).standard_normal((len(names), len(names)))
    return Estimate(
        procedure="hand-held",
        model=model,
        names=names,
        covariance=1e-9 * root @ root.T,
        parameters=[NamedValue("accelerometer bias x", 0.1, 0.001, "m/s^2")],
        correlations=np.eye(1),
        sigma0=1.2,
        sigma0_final=float("nan"),
        degrees_of_freedom=17,
        coverage_factor=2.11,
        largest_normalised=2.5,
        evidence=[
            Holds(np.array([1e-3, -2e-3]), np.array([1e-3, 1e-3])),
            Turns(np.array([1e-3, np.nan]), np.array([1e-3, np.nan]), np.array([1.0, 0.0])),
        ],
        terms=[TermTest("g_sensitivity", True, 9.0, 9, 1e-9, 0.01, "+9 sigma")],
        said=[Said("not determined", "nothing")],
    )


EXAMPLE = [0.03 * np.sin(2.3 * k + 1.0) for k in range(30)]


@pytest.fixture(params=[False, True], ids=["SI", "counts"])
def example(request: pytest.FixtureRequest) -> Calibration:
    return document_of(EXAMPLE, counts=request.param)


@given(st.lists(REAL, min_size=30, max_size=30))
@settings(max_examples=20)
def test_every_number_is_read_back_bit_for_bit(tmp_path_factory, numbers) -> None:
    document = document_of(numbers)
    path = tmp_path_factory.mktemp("document") / "calibration.json"
    document.write(path)
    assert read_calibration(path) == document
    assert read_calibration(path.parent) == document


def by_the_formula(document, force, rate) -> tuple[np.ndarray, np.ndarray]:
    """Raw from true, nothing but the file's own formula: raw = u + q u^2 + G f + bias, u = matrix true."""
    a, g = document["accelerometer"], document["gyroscope"]
    u = np.array(a["matrix"]) @ force
    raw_force = u + np.array(a["quadratic"] or [0, 0, 0]) * u**2 + a["bias"]
    raw_rate = np.array(g["matrix"]) @ rate + g["bias"]
    if g["g_sensitivity"]:
        raw_rate = raw_rate + np.array(g["g_sensitivity"]) @ force
    return raw_force, raw_rate


@given(
    st.lists(REAL, min_size=30, max_size=30),
    st.booleans(),
    st.sampled_from([(), ("g_sensitivity",), ("quadratic",)]),
)
@settings(max_examples=30)
def test_test_vectors_follow_from_the_file_s_own_formula(numbers, counts, terms) -> None:
    """The corrected numbers, distorted by the formula in the file, are the raw ones: to 1e-12 of the largest."""
    document = json.loads(document_of(numbers, counts=counts, terms=frozenset(terms)).to_json())
    assert len(document["test_vectors"]) >= 3
    for vector in document["test_vectors"]:
        force, rate = by_the_formula(document, vector["specific_force"], vector["angular_rate"])
        np.testing.assert_allclose(force, vector["raw_specific_force"], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(rate, vector["raw_angular_rate"], rtol=1e-12, atol=1e-12)


def test_the_test_vectors_are_not_trivial(example: Calibration) -> None:
    """They have negative values, off-axis values, and sizes at which a wrong sign of any term shows."""
    truth = json.loads(example.to_json())
    for block in ("accelerometer", "gyroscope"):
        for key in ("matrix", "quadratic", "g_sensitivity"):
            if truth[block].get(key) is None:
                continue
            changed = json.loads(example.to_json())
            changed[block][key] = (np.array(changed[block][key]) * 1.01).tolist()
            off = 0.0
            for vector in truth["test_vectors"]:
                force, rate = by_the_formula(changed, vector["specific_force"], vector["angular_rate"])
                off = max(off, float(np.max(np.abs(force - vector["raw_specific_force"]))))
                off = max(off, float(np.max(np.abs(rate - vector["raw_angular_rate"]))))
            assert off > 1e-7, (block, key)


def test_covariance_parameters_name_entries_of_the_file_in_the_covariance_s_order(example) -> None:
    document = json.loads(example.to_json())
    names = document["covariance_parameters"]
    covariance = np.array(document["covariance"])
    assert covariance.shape == (len(names), len(names))
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-20)
    for name in names:
        block, key, indices = re.fullmatch(r"(\w+)\.(\w+)\[([\d,]+)\]", name).groups()  # type: ignore[union-attr]
        value: Any = document[block][key]
        for index in indices.split(","):
            value = value[int(index)]
        assert isinstance(value, float)
    # Row by row, triad by triad.
    assert names[:4] == [f"accelerometer.matrix[{i}]" for i in ("0,0", "0,1", "0,2", "1,0")]
    assert names[9] == "accelerometer.bias[0]"
    assert names.index("gyroscope.matrix[2,2]") < names.index("gyroscope.bias[0]")


@pytest.fixture
def file(example: Calibration, tmp_path: Path) -> Path:
    example.write(tmp_path / "calibration.json")
    return tmp_path / "calibration.json"


def changed(file: Path, change: Callable[[Any], Any]) -> Path:
    document = json.loads(file.read_text(encoding="utf-8"))
    change(document)
    file.write_text(json.dumps(document), encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda d: d.update(version=2), "version 2 and this tumble reads up to 1: update tumble"),
        *((lambda d, v=v: d.update(version=v), "version") for v in ("1", None, 0, -3, 1.5, True)),
        (lambda d: d["accelerometer"].pop("bias"), "accelerometer.bias"),
        (lambda d: d["accelerometer"].update(bias=[1.0, 2.0]), "accelerometer.bias"),
        (lambda d: d["gyroscope"].update(matrix=[[1, 0, 0], [0, 1, 0], [0, 0, "x"]]), "gyroscope.matrix"),
        (lambda d: d.pop("covariance"), "covariance"),
        (lambda d: d["covariance"].pop(), "covariance"),
        (lambda d: d["covariance"][3].pop(), "covariance"),
        (lambda d: d.update(verdict="fit"), "verdict"),
        (lambda d: d["accelerometer"].update(matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 0]]), "accelerometer.matrix"),
        (lambda d: d["raw_units"].update(specific_force="furlong"), "raw_units"),
        # Python's json reads NaN, which JSON does not know.
        (lambda d: d["accelerometer"].update(bias=[1.0, float("nan"), 2.0]), "number NaN"),
        (lambda d: d.update(composed_with=dict(d)), "no longer read. Apply the two files"),
        *(
            (lambda d, name=name: d["imu"].update(model=name), "imu.model: it holds a line break or another control")
            for name in ("x\nimport os\n#", "a\u2028b", "g\x00h", "\u202egnihton")
        ),
    ],
)  # fmt: skip
def test_a_damaged_document_is_refused_with_the_place_of_the_damage(file, change, where) -> None:
    with pytest.raises(CalibrationFileError, match=re.escape(where)) as caught:
        read_calibration(changed(file, change))
    assert "\n" not in str(caught.value)
    assert file.name in str(caught.value)


@pytest.mark.parametrize(
    ("triad", "key", "at", "factor"),
    [
        ("accelerometer", "matrix", (1, 0), 1e6),
        ("accelerometer", "matrix", (0, 0), 1.001),
        ("accelerometer", "bias", (2,), 1.01),
        ("gyroscope", "bias", (0,), -1.0),
        ("gyroscope", "g_sensitivity", (0, 1), 1e3),
        ("gyroscope", "matrix", (2, 2), 1e300),
    ],
)
def test_a_number_that_was_changed_contradicts_the_test_vectors(file, triad, key, at, factor) -> None:
    def change(document: Any) -> None:
        place = document[triad][key]
        for index in at[:-1]:
            place = place[index]
        place[at[-1]] *= factor

    with pytest.raises(CalibrationFileError, match=rf"contradicts the {triad}'s|cannot be inverted"):
        read_calibration(changed(file, change))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "cannot be read as a calibration"),
        (b"not json", "cannot be read as a calibration"),
        (b'{"format": "tumble calibration", "version": 1', "cannot be read as a calibration"),
        (b"\xff\xfe\x00binary\x80", "cannot be read as a calibration"),
        (b"[" * 50_000, "cannot be read as a calibration: it "),
        (b'{"format": "\\ud800"}', "cannot be read as a calibration: it "),
        (b'{"version": ' + b"1" * 5000 + b"}", "cannot be read as a calibration: it "),
        (b"[1, 2, 3]", "is not a calibration of tumble"),
        (b'{"format": "another"}', "is not a calibration of tumble"),
        (b'{"format": "tumble calibration"}', "version"),
        (None, "There is no calibration"),
    ],
    ids=range(11),
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / "calibration.json").write_bytes(content)
    for path in (tmp_path / "calibration.json", tmp_path):
        with pytest.raises(CalibrationFileError, match=message) as caught:
            read_calibration(path)
        assert "\n" not in str(caught.value)


def test_unknown_keys_of_the_same_version_are_let_through(file: Path, example: Calibration) -> None:
    assert read_calibration(changed(file, lambda d: d.update(later="kept out"))) == example


def test_numbers_that_overflow_are_refused_and_a_raw_number_that_is_none_stays_none(example) -> None:
    small = document_of([-0.05] * 30, terms=frozenset())  # its scale factors are 0.95
    with pytest.raises(CalibrationFileError, match="specific force of sample 2 is not finite"):
        small.correct(np.array([[1.0, 2.0, 3.0], [1.75e308, 1.75e308, 1.75e308]]), None)
    force, _ = example.correct(np.array([[1.0, np.nan, 3.0], [1.0, 2.0, 3.0]]), None)
    assert np.isfinite(force).all(axis=1).tolist() == [False, True]


TERMS = frozenset({"g_sensitivity", "quadratic"})


@pytest.mark.parametrize("part", ["covariance", "names", "model", "parameters"])
def test_an_estimate_that_can_be_none_becomes_no_document(part: str) -> None:
    """What is no covariance, `tests/unit/document` tries one by one."""
    sound = estimate_of(EXAMPLE, terms=TERMS, counts=False)
    covariance, model = sound.covariance.copy(), sound.model
    covariance[2, 2] = -covariance[2, 2]
    wrong: dict[str, Any] = {
        "covariance": covariance,
        "names": sound.names[:-1],
        "model": replace(model, accelerometer=replace(model.accelerometer, bias=np.array([0, np.inf, 0]))),
        "parameters": [NamedValue("accelerometer bias x", 0.1, float("inf"), "m/s^2")],
    }
    with pytest.raises(
        ConvergenceError, match=r"came to no usable numbers: .* record more poses and longer holds"
    ):
        document_of(EXAMPLE, terms=TERMS, **{part: wrong[part]})
