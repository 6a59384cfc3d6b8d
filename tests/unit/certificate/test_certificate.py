"""Certificates say what the document says, in every language, twice the same, and notice when they are changed."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest
from lxml import etree

from tumble.certificate import Profile, certificate_content, certificate_pdf, check_certificate, read_profile
from tumble.certificate.dcc import check_dcc, dcc_text, entries_in_si, read_dcc
from tumble.certificate.languages import LANGUAGES, PHRASES
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.limits import read_limits, with_limits

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = ROOT / "tests" / "reference" / "dcc" / "dcc" / "dcc.xsd"
NUMBER, DATE = "L-2026/0042", "2026-11-22"
NAMES = [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
NAMES += [f"accelerometer.bias[{i}]" for i in range(3)]


def document(unit: str = "g") -> Calibration:
    """Accelerometers in `unit` with a covariance that is not symmetric by accident of its numbers."""
    rng = np.random.default_rng(4)
    root = np.tril(rng.normal(size=(12, 12))) * 1e-4
    told: dict[str, Any] = {
        "created": "2026-11-20T10:00:00+00:00",
        "software": "tumble 0.1.0",
        "imu": {"model": "M-1", "serial_number": "0042 <&>"},
        "procedure": "six-position",
        "recordings": [{"name": "a.csv", "sha256": "0f" * 32}],
        "site": {
            "gravity": 9.80788,
            "gravity_standard_uncertainty": 2e-5,
            "gravity_source": "survey",
            "earth_rate": 7.3e-05,
        },
        "temperature_celsius": 23.4,
        "frame": {
            "name": "accelerometer-x",
            "description": "x along the sensing axis of the x accelerometer",
        },
        "not_determined": [],
        "raw_units": {"specific_force": unit, "angular_rate": "rad/s"},
        "accelerometer": {
            "matrix": [[0.1021, 0.0002, -0.0001], [0.0003, 0.1018, 0.0004], [-0.0005, 0.0006, 0.1023]],
            "bias": [0.011, -0.022, 0.033],
        },
        "parameters": [
            {"name": "accelerometer bias x", "value": 0.011, "standard_uncertainty": 0.00031, "unit": unit},
            {"name": "accelerometer bias y", "value": -0.022, "standard_uncertainty": 0.00042, "unit": unit},
            {
                "name": "accelerometer scale factor error z",
                "value": 0.00321,
                "standard_uncertainty": 0.00012,
                "unit": "1",
                "coverage_factor": 2.26,
            },
            {
                "name": "accelerometer non-orthogonality yz",
                "value": -0.0012,
                "standard_uncertainty": 0.0001,
                "unit": "rad",
            },
        ],
        "covariance_parameters": NAMES,
        "covariance": (root @ root.T).tolist(),
        "quality": {
            "sigma0": 1.0,
            "sigma0_with_variance_components": 1.0,
            "degrees_of_freedom": 20,
            "largest_normalised_residual": 2.0,
            "coverage_factor": 2.09,
            "rms_hold_norm": 0.001,
            "rms_turn_angle": None,
            "holds": 20,
            "turns": 0,
            "variance_components": {},
            "left_out": [],
            "optional_terms": [],
        },
        "verdict": {"fit": True, "reasons": []},
        "test_vectors": [],
    }
    return Calibration.model_validate(told)


PROFILE = Profile.model_validate(
    {
        "laboratory": {"name": "Prüfstelle <Nord>", "address": "Weg 1 & 2", "contact": "a@example.org"},
        "customer": {"name": "Robots Ltd"},
        "traceability": "gravity by survey 17",
        "authorised_by": "A. Person",
        "conditions": {"Humidity": "45 %"},
    }
)


def write(folder: Path, language: str = "en", *, short: bool = False) -> Path:
    path = folder / f"{language}-{short}.pdf"
    content = certificate_content(document(), PROFILE, NUMBER, DATE, language)
    path.write_bytes(certificate_pdf(content, short=short))
    return path


def plain(path: Path) -> str:
    return "\n".join(page.extract_text() for page in pypdf.PdfReader(path).pages)


@pytest.mark.parametrize("language", [language for language in LANGUAGES if language != "zh"])
@pytest.mark.parametrize("short", [False, True])
def test_it_says_what_the_standard_asks_for_and_holds(tmp_path: Path, language: str, *, short: bool) -> None:
    path = write(tmp_path, language, short=short)
    text = plain(path)
    for word in (
        NUMBER,
        "Prüfstelle <Nord>",
        "Robots Ltd",
        "0042 <&>",
        "2026-11-20",
        "survey 17",
        "A. Person",
        "45 %",
    ):
        assert word in text, word
    assert PHRASES["only_item"][language][:40] in text.replace("\n", " ")
    assert "accredit" not in text.lower()
    found = check_certificate(path)
    assert found.problems == []
    assert (found.language, found.rows) == (language, 4)
    assert len(pypdf.PdfReader(path).pages) == 1 or not short


def test_numbers_are_rounded_by_their_expanded_uncertainty(tmp_path: Path) -> None:
    # 2.26 x 0.012 % = 0.027 %; 2.09 x 0.00042 g = 0.00088 g
    text = plain(write(tmp_path))
    assert re.search(r"0\.321\s+0\.027\s+2\.26\s+%", text)
    assert re.search(r"−0\.02200\s+0\.00088\s+2\.09\s+g", text)
    assert re.search(r"0,321\s+0,027\s+2,26\s+%", plain(write(tmp_path, "de")))


def test_the_number_stands_on_each_page_with_the_count(tmp_path: Path) -> None:
    big = document().model_copy(update={"parameters": document().parameters * 15})
    content = certificate_content(big, PROFILE, NUMBER, DATE, "en")
    pages = pypdf.PdfReader(io.BytesIO(certificate_pdf(content))).pages
    assert len(pages) > 1
    for number, page in enumerate(pages, 1):
        assert NUMBER in page.extract_text()
        assert f"Page {number} of {len(pages)}" in page.extract_text()


def test_the_same_day_makes_the_same_bytes_and_it_is_pdf_a(tmp_path: Path) -> None:
    first, second = write(tmp_path).read_bytes(), write(tmp_path).read_bytes()
    assert first == second
    reader = pypdf.PdfReader(io.BytesIO(first))
    metadata = reader.metadata
    assert metadata is not None
    assert metadata.creation_date is not None
    assert metadata.creation_date.strftime("%Y-%m-%d") == DATE
    xmp = str(reader.trailer["/Root"]["/Metadata"].get_data().decode())  # pyright: ignore[reportIndexIssue]
    assert re.search(r"pdfaid:part>3<", xmp)
    assert re.search(r"pdfaid:conformance>A<", xmp)
    assert reader.trailer["/Root"]["/OutputIntents"]  # pyright: ignore[reportIndexIssue]
    (attached,) = reader.attachments["calibration.json"]
    assert attached.decode() == document().to_json()


def test_a_certificate_of_another_document_is_noticed(tmp_path: Path) -> None:
    path = write(tmp_path)
    own, other = tmp_path / "own.json", tmp_path / "other.json"
    document().write(own)
    document("m/s^2").write(other)
    assert check_certificate(path, own).problems == []
    assert "not of" in check_certificate(path, other).problems[0]


def test_a_changed_number_and_a_changed_document_are_noticed(tmp_path: Path) -> None:
    content = certificate_content(document(), PROFILE, NUMBER, DATE, "en")
    content.groups[0][1][0][1] = "0.01234"
    (tmp_path / "a.pdf").write_bytes(certificate_pdf(content))
    (problem,) = check_certificate(tmp_path / "a.pdf").problems
    assert "bias x" in problem
    changed = document().model_copy(update={"created": "2020-01-01T00:00:00+00:00"}).to_json()
    forged = certificate_content(document(), PROFILE, NUMBER, DATE, "en")
    forged = type(forged)(
        **{name: getattr(forged, name) for name in forged.__slots__} | {"document": changed}
    )
    (tmp_path / "b.pdf").write_bytes(certificate_pdf(forged))
    assert "hash" in check_certificate(tmp_path / "b.pdf").problems[0]


@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("short", [False, True])
def test_a_sign_in_front_and_a_changed_serial_number_are_noticed(
    tmp_path: Path, language: str, *, short: bool
) -> None:
    path = tmp_path / "a.pdf"
    content = certificate_content(document(), PROFILE, NUMBER, DATE, language)
    rows = content.groups[0][1]
    rows[0][1] = "−" + rows[0][1]
    rows[1][1] = rows[1][1].replace("−", "−1")
    content.facts[:] = [(name, said.replace("0042", "0043")) for name, said in content.facts]
    path.write_bytes(certificate_pdf(content, short=short))
    problems = check_certificate(path).problems
    assert len(problems) == 3
    assert "0042" in problems[2]


@pytest.mark.parametrize("short", [False, True])
def test_a_changed_decision_is_noticed(tmp_path: Path, *, short: bool) -> None:
    limits = tmp_path / "limits.yaml"
    limits.write_text("name: incoming\nlimits: {accelerometer bias: 20 mg}\n", encoding="utf-8")
    held = with_limits(document(), read_limits(limits))
    path, content = tmp_path / "a.pdf", certificate_content(held, PROFILE, NUMBER, DATE, "en")
    path.write_bytes(certificate_pdf(content, short=short))
    assert check_certificate(path).problems == []
    assert content.conformity is not None
    assert content.conformity["decision"] == "failed"
    path.write_bytes(
        certificate_pdf(replace(content, conformity=content.conformity | {"decision": "passed"}), short=short)
    )
    (problem,) = check_certificate(path).problems
    assert "conformity" in problem
    if not short:
        row = next(row for row in content.conformity["rows"] if row[2] == "failed")
        row[2] = "passed"
        path.write_bytes(certificate_pdf(content))
        (problem,) = check_certificate(path).problems
        assert row[0] in problem


def test_chinese_says_what_it_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a font of Chinese characters it is set; without one a sentence says which to install."""
    from tumble.certificate import pdf

    monkeypatch.setattr(pdf, "CJK", ("No Such Font",))
    with pytest.raises(UsageError, match="Noto Serif CJK"):
        write(tmp_path, "zh")
    monkeypatch.undo()
    import typst

    if set(pdf.CJK) & set(typst.Fonts().families()):
        assert check_certificate(write(tmp_path, "zh")).problems == []


def test_every_phrase_is_there_in_every_language() -> None:
    for key, words in PHRASES.items():
        assert set(words) == set(LANGUAGES)
        assert all(words.values()) or key == "page_end"
    assert "accredit" not in json.dumps(PHRASES)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[]", "needs `laboratory:`"),
        ("laboratory: {}", "laboratory.name"),
        ("laboratory: {name: A}\naccredited: yes", "accredited"),
        ("laboratory: {name: A}\nlogo: none.png", "There is no logo"),
        ("laboratory: {name: A}\nlogo: a.exe", "none of .svg"),
        ("laboratory: [", "it is no YAML"),
    ],
)
def test_what_is_wrong_with_a_profile_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=r"^[^\n]+\.$") as caught:
        read_profile(path)
    assert said in str(caught.value)


def test_what_is_no_certificate_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.pdf").write_bytes(b"%PDF-1.7 rubbish")
    (tmp_path / "b.pdf").write_bytes(b"text")
    for name in ("a.pdf", "b.pdf", "none.pdf"):
        with pytest.raises(UsageError):
            check_certificate(tmp_path / name)


# --- the digital calibration certificate


@pytest.mark.parametrize("unit", ["g", "m/s^2", "counts"])
def test_the_dcc_is_valid_and_reads_back(tmp_path: Path, unit: str) -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    text = dcc_text(document(unit), PROFILE, NUMBER, DATE, "de")
    assert schema.validate(etree.fromstring(text.encode())), schema.error_log
    path = tmp_path / "unit.xml"
    path.write_text(text, encoding="utf-8")
    number, attached, numbers = read_dcc(path)
    assert number == NUMBER
    assert attached.decode() == document(unit).to_json()
    _, _, values, covariance = entries_in_si(document(unit))
    assert np.array_equal(numbers["entries"], values)
    assert np.array_equal(numbers["covariance"], covariance)
    assert check_dcc(path).problems == []


def test_the_dcc_is_in_si() -> None:
    names, units, values, covariance = entries_in_si(document("g"))
    at = names.index("accelerometer.bias[1]")
    assert values[at] == pytest.approx(-0.022 * 9.80665)
    assert units[at] == r"\metre\second\tothe{-2}"
    k = NAMES.index("accelerometer.matrix[2,1]")
    assert values[k] == pytest.approx(0.0006 * 9.80665)
    assert units[k] == r"\one"
    assert covariance[k, at] == pytest.approx(document().covariance[k][10] * 9.80665**2)


def with_magnetometer(raw: str, unit: str) -> Calibration:
    """The document with a magnetometer whose numbers are those of microtesla."""
    per = f"{raw}/({unit})"
    named = [
        ("magnetometer bias y", -27.4978, 0.0040, raw),
        ("magnetometer scale factor x", 987407.0, 4937.0, per),
        ("magnetometer soft iron xz", -66195.0, 331.0, per),
        ("rotation of the magnetometer z", 0.03456, 0.00011, "rad"),
    ]
    block = {
        "raw_unit": raw,
        "unit": unit,
        "frame": "b",
        "method": "holds and turns",
        "matrix": [[9.9e5, 1e3, -2e3], [3e3, 1.01e6, 4e3], [-5e3, 6e3, 1.02e6]],
        "bias": [0.5, -27.5, -21.4],
        "parameters": [
            {"name": name, "value": value, "standard_uncertainty": sigma, "unit": one}
            for name, value, sigma, one in named
        ],
        "verdict": {"use": "fit", "reasons": []},
    }
    return Calibration.model_validate({**document().model_dump(mode="json"), "magnetometer": block})


LOGO = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 3"><rect width="9" height="3"/></svg>'


def replace_parameters(calibration: Calibration, count: int) -> Calibration:
    """As many as a unit by hand has with all optional terms: two triads of nine, and what takes the whole width."""
    first = calibration.parameters[0]
    names = [f"{triad} bias {k}" for triad in ("accelerometer", "gyro") for k in range(9)]
    names += [f"g-sensitivity of gyro x to force {k}" for k in range(count - 18)]
    return calibration.model_copy(
        update={"parameters": [first.model_copy(update={"name": name}) for name in names]}
    )


@pytest.mark.parametrize(
    ("raw", "unit", "scale"),
    [
        ("uT", "T", r"0\.987\s+0\.010\s+2\.09\s+1\s"),
        ("counts", "T", r"0\.987\s+0\.010\s+2\.09\s+counts/µT"),
        ("uT", "local field", r"987407\s+10318\s+2\.09\s+µT/local\s+field"),
    ],
)
def test_a_magnetometer_s_results_are_on_both_certificates(
    tmp_path: Path, raw: str, unit: str, scale: str
) -> None:
    both = with_magnetometer(raw, unit)
    pdf, xml = tmp_path / "a.pdf", tmp_path / "a.xml"
    pdf.write_bytes(certificate_pdf(certificate_content(both, PROFILE, NUMBER, DATE, "en")))
    found = check_certificate(pdf)
    assert (found.problems, found.rows) == ([], 8)
    text = plain(pdf)
    assert re.search(r"−27\.4978\s+0\.0084\s+2\.09\s+(µT|counts)", text)
    assert re.search(scale, text)
    xml.write_text(dcc_text(both, PROFILE, NUMBER, DATE, "en"), encoding="utf-8")
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    assert schema.validate(etree.parse(str(xml))), schema.error_log
    assert check_dcc(xml).problems == []
    whole = replace_parameters(both, 33)
    short = certificate_pdf(certificate_content(whole, PROFILE, NUMBER, DATE, "en"), short=True, logo=LOGO)
    assert len(pypdf.PdfReader(io.BytesIO(short)).pages) == 1
    # In tesla, or as a share of it; counts stay counts.
    values = read_dcc(xml)[2]["values"][4:6]
    tesla = 1e-6 if raw == "uT" else 1.0
    assert values == pytest.approx([-27.4978 * tesla, 987407.0 * tesla])


def test_a_magnetometer_that_is_not_fit_has_no_results_and_a_reason() -> None:
    told = with_magnetometer("uT", "T").model_dump(mode="json")
    told["magnetometer"] |= {"verdict": {"use": "not fit", "reasons": ["Iron is near."]}}
    content = certificate_content(Calibration.model_validate(told), PROFILE, NUMBER, DATE, "en")
    assert sum(len(rows) for _, rows in content.groups) == 4
    assert content.not_determined == ["The magnetometer is not fit for use. Iron is near."]


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (r"<si:unitXMLList>\metre", r"<si:unitXMLList>\metre\tothe{2}", "units"),
        ("accelerometer_bias_x accelerometer_bias_y", "accelerometer_bias_y accelerometer_bias_x", "names"),
        ("0042 &lt;&amp;&gt;", "0043", "identifications"),
        ("<dcc:beginPerformanceDate>2026", "<dcc:beginPerformanceDate>2027", "days"),
    ],
)
def test_a_dcc_with_other_words_is_noticed(tmp_path: Path, before: str, after: str, said: str) -> None:
    text, path = dcc_text(document(), PROFILE, NUMBER, DATE, "en"), tmp_path / "unit.xml"
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")
    (problem,) = check_dcc(path).problems
    assert said in problem


def test_a_dcc_with_a_changed_number_is_noticed(tmp_path: Path) -> None:
    text = dcc_text(document(), PROFILE, NUMBER, DATE, "en")
    path = tmp_path / "unit.xml"
    path.write_text(text.replace("<si:valueXMLList>0.1", "<si:valueXMLList>0.2", 1), encoding="utf-8")
    assert check_dcc(path).problems == [
        "The certificate's values are not those of the document that it carries."
    ]
    path.write_text("<a/>", encoding="utf-8")
    with pytest.raises(UsageError, match="no certificate"):
        check_dcc(path)


def test_a_schema_error_is_found_by_the_schema() -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    text = dcc_text(document(), PROFILE, NUMBER, DATE, "en").replace("uniqueIdentifier", "identifier")
    assert not schema.validate(etree.fromstring(text.encode()))


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_was_noted_with_the_calibration_stands_in_the_certificate(language: str) -> None:
    notes = {"operator": "A. Smith", "place": "hall 2", "end": "early", "instrument": "table 7"}
    noted = document().model_copy(update={"notes": notes})
    facts = dict(certificate_content(noted, PROFILE, NUMBER, DATE, language).facts)
    assert facts[PHRASES["operator"][language]] == "A. Smith"
    assert facts[PHRASES["instrument"][language]] == "table 7"
    assert facts[PHRASES["place"][language]] == "hall 2"
    assert facts["End"] == "early"  # a name of somebody's own is no phrase of the certificate
    elsewhere = PROFILE.model_copy(update={"place": "at the customer's"})
    facts = dict(certificate_content(noted, elsewhere, NUMBER, DATE, language).facts)
    assert facts[PHRASES["place"][language]] == "at the customer's"


def test_the_formula_has_the_terms_that_the_results_have() -> None:
    told = document()
    plain = certificate_content(told, PROFILE, NUMBER, DATE, "en").model
    assert plain[0] == "raw = M · true + b."
    named = [
        told.parameters[0].model_copy(update={"name": name})
        for name in ("gyro asymmetry x", "g-sensitivity of gyro x to force y")
    ]
    more = told.model_copy(update={"parameters": [*told.parameters, *named]})
    model = certificate_content(more, PROFILE, NUMBER, DATE, "fr").model
    assert model[0] == "brut = u + a · |u| + G · f (Gyromètre) + b, u = M · vrai."
    assert any(words.startswith("a : asymétrie") for words in model)
    assert any(words.startswith("G : sensibilité") for words in model)
