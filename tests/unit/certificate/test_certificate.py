"""Certificates say what the document says, in every language, twice the same, whole."""

import base64
import hashlib
import io
import json
import re
from pathlib import Path

import numpy as np
import pypdf
import pytest
from lxml import etree
from msgspec import structs
from tests.unit.written import parameters, written

from tumble.certificate import Profile, certificate_content, certificate_pdf, read_profile
from tumble.certificate.content import LANGUAGES, PHRASES
from tumble.certificate.dcc import dcc_text, entries_in_si
from tumble.document import Calibration, plain, read_part
from tumble.errors import UsageError
from tumble.limits import read_limits, with_limits

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = ROOT / "tests" / "reference" / "dcc" / "dcc" / "dcc.xsd"
NUMBER, DATE = "L-2026/0042", "2026-11-22"
NAMES = [f"accelerometer.matrix[{i},{j}]" for i in range(3) for j in range(3)]
NAMES += [f"accelerometer.bias[{i}]" for i in range(3)]


def document(unit="g"):
    """Accelerometers in `unit` with a covariance that is not symmetric by accident of its numbers."""
    rng = np.random.default_rng(4)
    root = np.tril(rng.normal(size=(12, 12))) * 1e-4
    rows = parameters(
        ("accelerometer bias x", 0.011, 0.00031, unit),
        ("accelerometer bias y", -0.022, 0.00042, unit),
        ("accelerometer scale factor error z", 0.00321, 0.00012, "1"),
        ("accelerometer non-orthogonality yz", -0.0012, 0.0001, "rad"),
    )
    rows[2]["coverage_factor"] = 2.26
    site = {"gravity": 9.80788, "gravity_standard_uncertainty": 2e-5, "gravity_source": "survey"}
    return written(
        {"coverage_factor": 2.09},
        created="2026-11-20T10:00:00+00:00",
        imu={"model": "M-1", "serial_number": "0042 <&>"},
        recordings=[{"name": "a.csv", "sha256": "0f" * 32}],
        site={**site, "earth_rate": 7.3e-05},
        temperature_celsius=23.4,
        raw_units={"specific_force": unit, "angular_rate": "rad/s"},
        accelerometer={
            "matrix": [[0.1021, 0.0002, -0.0001], [0.0003, 0.1018, 0.0004], [-0.0005, 0.0006, 0.1023]],
            "bias": [0.011, -0.022, 0.033],
        },
        parameters=rows,
        covariance_parameters=NAMES,
        covariance=(root @ root.T).tolist(),
    )


PROFILE = read_part(
    Profile,
    {
        "laboratory": {"name": "Prüfstelle <Nord>", "address": "Weg 1 & 2", "contact": "a@example.org"},
        "customer": {"name": "Robots Ltd"},
        "traceability": "gravity by survey 17",
        "authorised_by": "A. Person",
        "conditions": {"Humidity": "45 %"},
    },
)

BARE = read_part(Profile, {"laboratory": {"name": "–"}})


def content_of(told, language="en", profile=PROFILE):
    return certificate_content(told, profile, NUMBER, DATE, language)


def text_of(content):
    pages = pypdf.PdfReader(io.BytesIO(certificate_pdf(content))).pages
    return "\n".join(page.extract_text() for page in pages)


def judged(told, folder):
    """With the decision on a limit that a bias breaks."""
    (folder / "limits.yaml").write_text(
        "name: incoming\nlimits: {accelerometer bias: 20 mg}\n", encoding="utf-8"
    )
    return with_limits(told, read_limits(folder / "limits.yaml"))


@pytest.mark.parametrize("language", [language for language in LANGUAGES if language != "zh"])
def test_it_says_what_the_standard_asks_for(language):
    text = text_of(content_of(document(), language))
    words = ("Prüfstelle <Nord>", "Robots Ltd", "0042 <&>", "2026-11-20", "survey 17", "A. Person", "45 %")
    for word in (NUMBER, *words):
        assert word in text, word
    assert PHRASES["only_item"][language][:40] in text.replace("\n", " ")
    assert "accredit" not in text.lower()
    assert hashlib.sha256(document().to_json().encode()).hexdigest() in "".join(text.split())


def test_numbers_are_rounded_by_their_expanded_uncertainty():
    # 2.26 x 0.012 % = 0.027 %; 2.09 x 0.42 mg = 0.88 mg
    text = text_of(content_of(document()))
    assert re.search(r"0\.321\s+0\.027\s+2\.26\s+%", text)
    assert re.search(r"−22\.00\s+0\.88\s+2\.09\s+mg", text)
    assert re.search(r"0,321\s+0,027\s+2,26\s+%", text_of(content_of(document(), "de")))
    # The number stands on each page, with their count.
    big = structs.replace(document(), parameters=document().parameters * 15)
    pages = pypdf.PdfReader(io.BytesIO(certificate_pdf(content_of(big)))).pages
    assert len(pages) > 1
    for number, page in enumerate(pages, 1):
        assert NUMBER in page.extract_text()
        assert f"Page {number} of {len(pages)}" in page.extract_text()


def test_the_same_day_makes_the_same_bytes_and_it_is_pdf_a():
    first, second = (certificate_pdf(content_of(document())) for _ in range(2))
    assert first == second
    reader = pypdf.PdfReader(io.BytesIO(first))
    metadata = reader.metadata
    assert metadata.creation_date.strftime("%Y-%m-%d") == DATE
    xmp = str(reader.trailer["/Root"]["/Metadata"].get_data().decode())  # pyright: ignore[reportIndexIssue]
    assert re.search(r"pdfaid:part>3<", xmp)
    assert re.search(r"pdfaid:conformance>A<", xmp)
    assert reader.trailer["/Root"]["/OutputIntents"]  # pyright: ignore[reportIndexIssue]
    (attached,) = reader.attachments["calibration.json"]
    assert attached.decode() == document().to_json()


def test_the_decision_on_conformity_and_its_rule_are_on_the_pages(tmp_path):
    content = content_of(judged(document(), tmp_path))
    text = text_of(content)
    assert content.conformity["decision"] == "failed"
    assert re.search(r"incoming\s+–\s+failed", text)
    assert content.conformity["rule"] in " ".join(text.split())
    assert re.search(r"bias y\s+−20\s+…\s+20\s+mg\s+failed", text)


def test_chinese_says_what_it_needs(monkeypatch):
    """With a font of Chinese characters it is set; without one a sentence says which to install."""
    from tumble.certificate import pdf

    monkeypatch.setattr(pdf, "CJK", ("No Such Font",))
    with pytest.raises(UsageError, match="Noto Serif CJK"):
        certificate_pdf(content_of(document(), "zh"))
    monkeypatch.undo()
    import typst

    if set(pdf.CJK) & set(typst.Fonts().families()):
        assert PHRASES["title"]["zh"] in text_of(content_of(document(), "zh"))


def test_every_phrase_is_there_in_every_language():
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
def test_what_is_wrong_with_a_profile_is_one_sentence(tmp_path, text, said):
    path = tmp_path / "lab.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=r"^[^\n]+\.$") as caught:
        read_profile(path)
    assert said in str(caught.value)


def root_of(text):
    """The certificate, which is valid against the published schemas."""
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    root = etree.fromstring(text.encode())
    assert schema.validate(root), schema.error_log
    return root


def numbers_of(root, kind, name):
    """All lists of numbers of one name in a result of one kind."""
    found = root.findall(f".//{{https://ptb.de/dcc}}result[@refType='{kind}']//{{https://ptb.de/si}}{name}")
    return [[float(word) for word in one.text.split()] for one in found]


@pytest.mark.parametrize("unit", ["g", "m/s^2", "counts"])
def test_the_dcc_is_valid_and_reads_back(unit):
    root = root_of(dcc_text(document(unit), PROFILE, NUMBER, DATE, "de"))
    assert root.findtext(".//{*}uniqueIdentifier") == NUMBER
    assert base64.b64decode(root.findtext(".//{*}dataBase64")).decode() == document(unit).to_json()
    assert root.findtext(".//{*}item/{*}identifications//{*}value") == "0042 <&>"
    _, _, values, covariance = entries_in_si(document(unit))
    entries, *columns = numbers_of(root, "tumble_model", "valueXMLList")
    assert np.array_equal(entries, values)
    assert np.array_equal(np.transpose(columns), covariance)
    (told,) = numbers_of(root, "tumble_parameters", "valueExpandedMUXMLList")
    assert told[2] == 2.26 * 0.00012
    with pytest.raises(AssertionError):
        root_of(dcc_text(document(), PROFILE, NUMBER, DATE, "en").replace("uniqueIdentifier", "identifier"))


@pytest.mark.parametrize("profile", [PROFILE, BARE])
def test_the_dcc_has_the_decision_and_what_the_profile_says(tmp_path, profile):
    bare = structs.replace(document(), covariance_parameters=[], covariance=[], temperature_celsius=None)
    root = root_of(dcc_text(judged(bare, tmp_path), profile, NUMBER, DATE, "fr"))
    assert root.findtext(".//{*}conformity") == "fail"
    assert root.find(".//{*}result[@refType='tumble_model']") is None
    customer = "–" if profile.customer is None else "Robots Ltd"
    assert root.findtext(".//{*}customer/{*}name/{*}content") == customer
    assert len(root.findall(".//{*}influenceCondition")) == 1 + len(profile.conditions)
    wrong = structs.replace(profile, laboratory=structs.replace(profile.laboratory, country="de"))
    with pytest.raises(UsageError, match="no code of two capitals"):
        dcc_text(document(), wrong, NUMBER, DATE, "fr")


def test_the_dcc_is_in_si():
    names, units, values, covariance = entries_in_si(document("g"))
    at = names.index("accelerometer.bias[1]")
    assert values[at] == pytest.approx(-0.022 * 9.80665)
    assert units[at] == r"\metre\second\tothe{-2}"
    k = NAMES.index("accelerometer.matrix[2,1]")
    assert values[k] == pytest.approx(0.0006 * 9.80665)
    assert units[k] == r"\one"
    assert covariance[k, at] == pytest.approx(document().covariance[k][10] * 9.80665**2)


def with_magnetometer(raw, unit):
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
        "parameters": parameters(*named),
        "verdict": {"use": "fit", "reasons": []},
    }
    return read_part(Calibration, {**plain(document()), "magnetometer": block})


@pytest.mark.parametrize(
    ("raw", "unit", "scale"),
    [
        ("uT", "T", r"0\.987\s+0\.010\s+2\.09\s+1\s"),
        ("counts", "T", r"0\.987\s+0\.010\s+2\.09\s+counts/µT"),
        ("uT", "local field", r"987407\s+10318\s+2\.09\s+µT/local\s+field"),
    ],
)
def test_a_magnetometer_s_results_are_on_both_certificates(raw, unit, scale):
    both = with_magnetometer(raw, unit)
    text = text_of(content_of(both))
    assert re.search(r"−27\.4978\s+0\.0084\s+2\.09\s+(µT|counts)", text)
    assert re.search(scale, text)
    root = root_of(dcc_text(both, PROFILE, NUMBER, DATE, "en"))
    # In tesla, or as a share of it; counts stay counts.
    values = numbers_of(root, "tumble_parameters", "valueXMLList")[0][4:6]
    tesla = 1e-6 if raw == "uT" else 1.0
    assert values == pytest.approx([-27.4978 * tesla, 987407.0 * tesla])


def test_a_magnetometer_that_is_not_fit_has_no_results_and_a_reason():
    told = plain(with_magnetometer("uT", "T"))
    told["magnetometer"] |= {"verdict": {"use": "not fit", "reasons": ["Iron is near."]}}
    content = content_of(read_part(Calibration, told))
    assert sum(len(rows) for _, rows in content.groups) == 4
    assert content.not_determined == ["The magnetometer is not fit for use. Iron is near."]


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_was_noted_with_the_calibration_stands_in_the_certificate(language):
    notes = {"operator": "A. Smith", "place": "hall 2", "end": "early", "instrument": "table 7"}
    noted = structs.replace(document(), notes=notes)
    facts = dict(content_of(noted, language).facts)
    assert facts[PHRASES["operator"][language]] == "A. Smith"
    assert facts[PHRASES["instrument"][language]] == "table 7"
    assert facts[PHRASES["place"][language]] == "hall 2"
    assert facts["End"] == "early"  # a name of somebody's own is no phrase of the certificate
    elsewhere = structs.replace(PROFILE, place="at the customer's")
    facts = dict(content_of(noted, language, elsewhere).facts)
    assert facts[PHRASES["place"][language]] == "at the customer's"


def test_the_formula_has_the_terms_that_the_results_have():
    told = document()
    plain = content_of(told).model
    assert plain[0] == "raw = M · true + b."
    names = ("gyro asymmetry x", "g-sensitivity of gyro x to force y")
    named = [structs.replace(told.parameters[0], name=name) for name in names]
    more = structs.replace(told, parameters=[*told.parameters, *named])
    model = content_of(more, "fr").model
    assert model[0] == "brut = u + a · |u| + G · f (Gyromètre) + b, u = M · vrai."
    for words in ("a : asymétrie", "G : sensibilité"):
        assert any(one.startswith(words) for one in model)
