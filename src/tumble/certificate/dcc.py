"""PTB's digital calibration certificate (DCC 3.3.0) with numbers as D-SI 2.2.1, for machines.

The parameters stand in it with expanded uncertainties, matrices and biases with their covariance
(`measurementUncertaintyMultivariateXMLList`), and the ``calibration.json`` as bytes. There is no profile of DCCs for
inertial sensors yet: the types of results named ``tumble_…`` here are our own.
"""

from __future__ import annotations

import base64
import hashlib
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tumble.certificate.check import ATTACHED, LARGEST, CertificateCheck, carried_document
from tumble.certificate.content import PROBABILITY
from tumble.certificate.languages import phrases
from tumble.certificate.profile import Profile
from tumble.document.entries import entry_names, vector_of_model
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.files import opened, reading, shown
from tumble.units import angular_rate_factor, magnetic_field_factor, specific_force_factor

VERSION = "3.3.0"
DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
_FORCE, _RATE = r"\metre\second\tothe{-2}", r"\radian\second\tothe{-1}"
_UNITS = {
    "1": r"\one",
    "rad": r"\radian",
    "s": r"\second",
    "m": r"\metre",
    "counts": r"\one",
    "counts/(m/s²)": r"\metre\tothe{-1}\second\tothe{2}",
    "counts/(rad/s)": r"\radian\tothe{-1}\second",
    "rad/s/(m/s^2)": r"\radian\second\metre\tothe{-1}",
    "rad/s/(m/s²)": r"\radian\second\metre\tothe{-1}",
}


def dcc_text(
    calibration: Calibration, profile: Profile, number: str, date: str, language: str, text: str | None = None
) -> str:
    """Return a digital calibration certificate as XML.

    Parameters
    ----------
    calibration, profile : the document, and what the laboratory says.
    number : unique to the certificate.
    date : of issue, YYYY-MM-DD.
    language : of its texts.
    text : of the document's file; None writes it anew.
    """
    ET.register_namespace("dcc", DCC)
    ET.register_namespace("si", SI)
    document = calibration.to_json() if text is None else text
    root = ET.Element(f"{{{DCC}}}digitalCalibrationCertificate", {"schemaVersion": VERSION})
    _administrative(_add(root, "administrativeData"), calibration, profile, number, date, language)
    results = _add(root, "measurementResults")
    one = _add(results, "measurementResult")
    _text(one, "name", phrases(language)["item_kind"], language)
    method = _add(_add(one, "usedMethods"), "usedMethod")
    _text(method, "name", ", ".join(filter(None, (profile.method, calibration.procedure))), language)
    _rich(method, "description", calibration.formula, "en")
    _conditions(one, calibration, profile, language)
    found = _add(one, "results")
    _parameters(found, calibration, language)
    _entries(found, calibration, language)
    attached = _result(found, "tumble_document", "calibration.json", language)
    _bytes(attached, document)
    _conformity(one, calibration)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _add(
    parent: ET.Element, name: str, text: str | None = None, space: str = DCC, **attributes: str
) -> ET.Element:
    made = ET.SubElement(parent, f"{{{space}}}{name}", attributes)
    if text is not None:
        # No character that XML cannot hold, and no white space at the ends, which the schema forbids.
        made.text = " ".join(shown(text).split()) or "–"
    return made


def _text(parent: ET.Element, name: str, words: str, language: str) -> None:
    _add(_add(parent, name), "content", words, lang=language)


def _rich(parent: ET.Element, name: str, words: str, language: str) -> None:
    _add(_add(parent, name), "content", words, lang=language)


def _administrative(
    data: ET.Element, calibration: Calibration, profile: Profile, number: str, date: str, language: str
) -> None:
    software = _add(_add(data, "dccSoftware"), "software")
    name, _, release = calibration.software.partition(" ")
    _text(software, "name", name, "en")
    _add(software, "release", release or "–")
    core = _add(data, "coreData")
    _add(core, "countryCodeISO3166_1", _country(profile.laboratory.country))
    _add(core, "usedLangCodeISO639_1", language)
    _add(core, "mandatoryLangCodeISO639_1", language)
    _add(core, "uniqueIdentifier", number)
    day = calibration.created[:10]
    _add(core, "beginPerformanceDate", day)
    _add(core, "endPerformanceDate", day)
    _add(core, "performanceLocation", "other" if profile.place else "laboratory")
    _add(core, "issueDate", date)
    item = _add(_add(data, "items"), "item")
    _text(item, "name", phrases(language)["item_kind"], language)
    if profile.item.condition:
        _rich(item, "description", profile.item.condition, language)
    if profile.item.manufacturer:
        _text(_add(item, "manufacturer"), "name", profile.item.manufacturer, language)
    model = profile.item.model or calibration.imu.model
    if model:
        _add(item, "model", model)
    serial = _add(_add(item, "identifications"), "identification")
    _add(serial, "issuer", "manufacturer")
    _add(serial, "value", profile.item.serial_number or calibration.imu.serial_number or "–")
    laboratory = profile.laboratory
    _contact(
        _add(_add(data, "calibrationLaboratory"), "contact"),
        laboratory.name,
        laboratory.contact,
        laboratory.address,
    )
    person = _add(_add(data, "respPersons"), "respPerson")
    _text(_add(person, "person"), "name", profile.authorised_by or "–", language)
    customer = profile.customer
    told = ("–", "", "") if customer is None else (customer.name, customer.contact, customer.address)
    _contact(_add(data, "customer"), *told)
    _statements(data, profile, language)


def _country(code: str) -> str:
    if len(code) != 2 or not code.isascii() or not code.isupper():
        raise UsageError(f"laboratory: country: {shown(code)[:20]!r} is no code of two capitals, such as DE.")
    return code


def _contact(contact: ET.Element, name: str, mail: str, address: str) -> None:
    _text(contact, "name", name, "en")
    if mail:
        _add(contact, "eMail", mail)
    _rich(_add(contact, "location"), "further", address or "–", "en")


def _statements(data: ET.Element, profile: Profile, language: str) -> None:
    words = phrases(language)
    said = [(words["traceability"], profile.traceability), (words["adjustment"], profile.adjustment)]
    said += [("", profile.statement), ("", words["only_item"])]
    statements = _add(data, "statements")
    for name, declaration in said:
        if declaration:
            one = _add(statements, "statement")
            if name:
                _text(one, "name", name, language)
            _rich(one, "declaration", declaration, language)


def _conditions(one: ET.Element, calibration: Calibration, profile: Profile, language: str) -> None:
    words, site = phrases(language), calibration.site
    conditions = _add(one, "influenceConditions")
    gravity = _add(conditions, "influenceCondition")
    _text(gravity, "name", words["gravity"], language)
    quantity = _add(_add(gravity, "data"), "quantity")
    real = _add(quantity, "real", space=SI)
    _add(real, "value", repr(site.gravity), SI)
    _add(real, "unit", _FORCE, SI)
    uncertainty = _add(_add(real, "measurementUncertaintyUnivariate", space=SI), "standardMU", space=SI)
    _add(uncertainty, "valueStandardMU", repr(site.gravity_standard_uncertainty), SI)
    told = dict(profile.conditions)
    if calibration.temperature_celsius is not None:
        told.setdefault(words["temperature"], f"{calibration.temperature_celsius:.1f} °C")
    for name, value in told.items():
        condition = _add(conditions, "influenceCondition")
        _text(condition, "name", name, language)
        _rich(_add(condition, "data"), "text", value, language)


def _result(results: ET.Element, kind: str, name: str, language: str) -> ET.Element:
    made = _add(results, "result", refType=kind)
    _text(made, "name", name, language)
    return _add(made, "data")


def in_si(unit: str) -> tuple[str, float] | None:
    """Return a parameter's unit as D-SI with the factor to it; None for what D-SI cannot say.

    Parameters
    ----------
    unit : as a calibration has it.
    """
    if unit in _UNITS:
        return _UNITS[unit], 1.0
    raw, _, per = unit.removesuffix(")").partition("/(")
    if per in ("T", "local field"):
        factor = magnetic_field_factor(raw)
        if factor is None:
            return (r"\tesla\tothe{-1}" if per == "T" else r"\one"), 1.0
        return (r"\one" if per == "T" else r"\tesla"), factor
    for factor_of, name in (
        (specific_force_factor, _FORCE),
        (angular_rate_factor, _RATE),
        (magnetic_field_factor, r"\tesla"),
    ):
        try:
            factor = factor_of(unit)
        except UsageError:
            continue
        return (r"\one", 1.0) if factor is None else (name, factor)
    return None


def _parameters(results: ET.Element, calibration: Calibration, language: str) -> None:
    rows: list[tuple[str, float, str, float, float]] = []
    for one in calibration.every_parameter:
        told = in_si(one.unit)
        if told is not None:
            k = one.coverage_factor or calibration.quality.coverage_factor
            expanded = k * one.standard_uncertainty * told[1]
            rows.append((one.name.replace(" ", "_"), one.value * told[1], told[0], expanded, k))
    if not rows:
        return
    data = _result(results, "tumble_parameters", phrases(language)["results"], language)
    vector = _add(_add(data, "quantity"), "realListXMLList", space=SI)
    _list(vector, "labelXMLList", [row[0] for row in rows])
    _list(vector, "valueXMLList", [row[1] for row in rows])
    _list(vector, "unitXMLList", [row[2] for row in rows])
    stated = _add(
        _add(vector, "measurementUncertaintyUnivariateXMLList", space=SI), "expandedMUXMLList", space=SI
    )
    _list(stated, "valueExpandedMUXMLList", [row[3] for row in rows])
    _list(stated, "coverageFactorXMLList", [row[4] for row in rows])
    _list(stated, "coverageProbabilityXMLList", [PROBABILITY])


def _list(parent: ET.Element, name: str, values: Sequence[str | float]) -> None:
    words = [value if isinstance(value, str) else repr(float(value)) for value in values]
    _add(parent, name, space=SI).text = " ".join(words)


def entries_in_si(calibration: Calibration) -> tuple[list[str], list[str], np.ndarray, np.ndarray]:
    """Return names, D-SI units, values (n,) and covariance (n, n) of matrices and biases.

    Parameters
    ----------
    calibration : with a covariance.
    """
    order = {name: at for at, name in enumerate(entry_names())}
    values = vector_of_model(calibration.own_model)
    names: list[str] = []
    units: list[str] = []
    factors: list[float] = []
    places: list[int] = []
    rows: list[int] = []
    raw = calibration.raw_units
    told = {"accelerometer": (specific_force_factor(raw.specific_force), _FORCE, "counts/(m/s²)")}
    told["gyroscope"] = (angular_rate_factor(raw.angular_rate), _RATE, "counts/(rad/s)")
    for row, name in enumerate(calibration.covariance_parameters):
        triad, _, rest = name.partition(".")
        if name not in order or not rest.startswith(("matrix", "bias")):
            continue
        factor, si, per_count = told[triad]
        is_bias = rest.startswith("bias")
        unit = (
            (_UNITS["counts"] if factor is None else si)
            if is_bias
            else (_UNITS[per_count] if factor is None else _UNITS["1"])
        )
        names.append(name)
        units.append(unit)
        factors.append(1.0 if factor is None else factor)
        places.append(order[name])
        rows.append(row)
    scale = np.array(factors)
    covariance = calibration.covariance_matrix[np.ix_(rows, rows)] * np.outer(scale, scale)
    return names, units, values[places] * scale, covariance


def _entries(results: ET.Element, calibration: Calibration, language: str) -> None:
    if not calibration.covariance_parameters:
        return
    from scipy.special import chdtri

    names, units, values, covariance = entries_in_si(calibration)
    data = _result(results, "tumble_model", phrases(language)["model_title"], language)
    quantity = _add(data, "quantity")
    _rich(quantity, "description", f"{calibration.formula}. Frame: {calibration.frame.description}.", "en")
    vector = _add(quantity, "realListXMLList", space=SI)
    _list(vector, "labelXMLList", names)
    _list(vector, "valueXMLList", values.tolist())
    _list(vector, "unitXMLList", units)
    region = _add(vector, "measurementUncertaintyMultivariateXMLList", space=SI)
    region = _add(region, "ellipsoidalRegionMUXMLList", space=SI)
    matrix = _add(region, "covarianceMatrixXMLList", space=SI)
    for k, unit in enumerate(units):
        column = _add(_add(matrix, "columnXMLList", space=SI), "covarianceXMLList", space=SI)
        _list(column, "valueXMLList", covariance[:, k].tolist())
        _list(column, "unitXMLList", [_product(other, unit) for other in units])
    inverse: Any = chdtri
    told = int(np.sum(np.diag(covariance) > 0.0))
    _list(
        region, "coverageFactorXMLList", [math.sqrt(float(inverse(float(max(told, 1)), 1.0 - PROBABILITY)))]
    )
    _list(region, "coverageProbabilityXMLList", [PROBABILITY])


def _product(one: str, two: str) -> str:
    parts = [part for part in (one, two) if part != _UNITS["1"]]
    return "".join(parts) or _UNITS["1"]


def _bytes(parent: ET.Element, document: str) -> None:
    made = _add(parent, "byteData")
    _rich(made, "description", f"SHA-256 {hashlib.sha256(document.encode()).hexdigest()}", "en")
    _add(made, "fileName", ATTACHED)
    _add(made, "mimeType", "application/json")
    _add(made, "dataBase64").text = base64.b64encode(document.encode()).decode()


def _conformity(one: ET.Element, calibration: Calibration) -> None:
    block = calibration.limits
    if block is None:
        return
    words = {"passed": "pass", "failed": "fail"}
    data = _add(_add(one, "measurementMetaData"), "metaData", refType="basic_conformity")
    _rich(data, "description", f"Limits {block.name!r}, decision rule {block.rule}", "en")
    _add(data, "norm", "JCGM 106:2012")
    _add(data, "reference", f"SHA-256 of the limits {block.sha256}")
    _add(data, "conformity", words.get(block.decision, "noPass"))


def read_dcc(path: Path) -> tuple[str, bytes, dict[str, np.ndarray]]:
    """Read a certificate that `dcc_text` wrote: its number, the document, and its numbers.

    The numbers are ``values`` and ``expanded`` of the parameters, ``entries`` and ``covariance`` of the model.

    Parameters
    ----------
    path : of the XML.

    Raises
    ------
    UsageError
        If it is none.
    """
    try:
        root = ET.fromstring(_content_of(path))
        number = root.findtext(f".//{{{DCC}}}uniqueIdentifier") or ""
        attached = base64.b64decode(
            root.findtext(f".//{{{DCC}}}byteData/{{{DCC}}}dataBase64") or "", validate=True
        )
        numbers = _numbers(root)
    except (ET.ParseError, ValueError, AttributeError, KeyError) as error:
        raise UsageError(
            f"{path} is no digital calibration certificate of tumble: {shown(str(error))[:100]}."
        ) from None
    if not attached:
        raise UsageError(f"{path} carries no calibration.json: it is no certificate of tumble.")
    return number, attached, numbers


def _content_of(path: Path) -> bytes:
    """A certificate's XML, which may declare no entities."""
    with reading(path, "a certificate"), opened(path) as file:
        content = file.read(LARGEST + 1)
    if b"<!DOCTYPE" in content[:4096] or b"<!ENTITY" in content or len(content) > LARGEST:
        raise UsageError(
            f"{path} is no digital calibration certificate: it declares entities, or is too long."
        )
    return content


def _words(root: ET.Element) -> dict[str, list[str]]:
    """What stands beside the numbers and is the document's: names, units, conformity, the item, the day."""
    places = {
        "names of results": f".//{{{SI}}}labelXMLList",
        "units": f".//{{{SI}}}unitXMLList",
        "statements of conformity": f".//{{{DCC}}}metaData[@refType='basic_conformity']//*",
        "identifications of the item": f".//{{{DCC}}}item/{{{DCC}}}identifications//{{{DCC}}}value",
        "days": f".//{{{DCC}}}beginPerformanceDate",
    }
    return {name: [(one.text or "").strip() for one in root.findall(place)] for name, place in places.items()}


def _numbers(root: ET.Element) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for kind, name in (("tumble_parameters", "values"), ("tumble_model", "entries")):
        vector = root.find(f".//{{{DCC}}}result[@refType='{kind}']//{{{SI}}}realListXMLList")
        if vector is None:
            continue
        found[name] = _floats(vector.findtext(f"{{{SI}}}valueXMLList"))
        columns = vector.findall(f".//{{{SI}}}columnXMLList/{{{SI}}}covarianceXMLList/{{{SI}}}valueXMLList")
        if columns:
            found["covariance"] = np.array([_floats(column.text) for column in columns]).T
        else:
            found["expanded"] = _floats(vector.findtext(f".//{{{SI}}}valueExpandedMUXMLList"))
    return found


def _floats(text: str | None) -> np.ndarray:
    return np.array([float(word) for word in (text or "").split()])


def check_dcc(path: Path, document: Path | None = None) -> CertificateCheck:
    """Check a digital calibration certificate against the document that it carries, and that against a file.

    Parameters
    ----------
    path : of the XML.
    document : ``calibration.json`` that it should be of; None for no comparison.

    Raises
    ------
    UsageError
        If it cannot be read, or is none of tumble's.
    """
    _, attached, numbers = read_dcc(path)
    digest = hashlib.sha256(attached).hexdigest()
    calibration, problems = carried_document(path, attached, document)
    expected_root = ET.fromstring(dcc_text(calibration, _anybody(), "–", "2000-01-01", "en"))
    said = _words(ET.fromstring(_content_of(path)))
    problems += [
        f"The certificate's {name} are not those of the document that it carries."
        for name, words in _words(expected_root).items()
        if words and words != ["–"] and said[name] != words
    ]
    made = _numbers(expected_root)
    for name, expected in made.items():
        if name not in numbers or not np.array_equal(numbers[name], expected):
            problems.append(f"The certificate's {name} are not those of the document that it carries.")
    return CertificateCheck(digest, "", problems, sum(len(one) for one in made.values()))


def _anybody() -> Profile:
    from tumble.certificate.profile import Laboratory

    return Profile(laboratory=Laboratory(name="–"))
