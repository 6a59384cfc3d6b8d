"""PTB's digital calibration certificate (DCC 3.3.0) with numbers as D-SI 2.2.1, for machines.

The parameters stand in it with expanded uncertainties, matrices and biases with their covariance
(`measurementUncertaintyMultivariateXMLList`), and the ``calibration.json`` as bytes. There is no profile of DCCs for
inertial sensors yet: the types of results named ``tumble_…`` here are our own.
"""

from __future__ import annotations

import base64
import hashlib
import math
from typing import Any

import numpy as np

from tumble.certificate.content import PROBABILITY, phrases
from tumble.certificate.profile import Customer, Profile
from tumble.document import Calibration, entry_names, vector_of_model
from tumble.errors import UsageError
from tumble.files import shown, templates
from tumble.parameters import si_of
from tumble.units import magnetic_field_factor

_FORCE, _RATE = r"\metre\second\tothe{-2}", r"\radian\second\tothe{-1}"
_KINDS = {
    "ratio": r"\one",
    "specific force": _FORCE,
    "angular rate": _RATE,
    "angle increment": r"\radian",
    "magnetic field": r"\tesla",
    "time": r"\second",
    "length": r"\metre",
    "rate per force": r"\radian\second\metre\tothe{-1}",
    "per force": r"\metre\tothe{-1}\second\tothe{2}",
}
_ONE = _KINDS["ratio"]
# Of a count nothing more is known than that it is one.
_PER_FORCE, _PER_RATE = r"\metre\tothe{-1}\second\tothe{2}", r"\radian\tothe{-1}\second"
_COUNTS = {"counts": _ONE, "counts/(m/s²)": _PER_FORCE, "counts/(rad/s)": _PER_RATE}


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

    Raises
    ------
    UsageError
        If the laboratory's country is none.
    """
    _check_country(profile.laboratory.country)
    document = (calibration.to_json() if text is None else text).encode()
    block, words = calibration.limits, phrases(language)
    given: dict[str, Any] = {
        "visible": _visible,
        "calibration": calibration,
        "profile": profile,
        "item": profile.item,
        "nobody": Customer(name=""),
        "number": number,
        "date": date,
        "language": language,
        "phrases": words,
        "software": calibration.software.partition(" "),
        "method": ", ".join(filter(None, (profile.method, calibration.procedure))),
        "statements": [
            (words["traceability"], profile.traceability),
            (words["adjustment"], profile.adjustment),
            ("", profile.statement),
            ("", words["only_item"]),
        ],
        "conditions": _conditions(calibration, profile, words["temperature"]),
        "probability": PROBABILITY,
        "parameters": _parameters(calibration),
        "entries": _entries(calibration),
        "sha256": hashlib.sha256(document).hexdigest(),
        "base64": base64.b64encode(document).decode(),
        "limits": block,
        "limits_title": "" if block is None else f"Limits {block.name!r}, decision rule {block.rule}",
    }
    return templates("certificate").get_template("dcc.xml").render(given) + "\n"


def _visible(text: str) -> str:
    """No character that XML cannot hold, and no white space at the ends, which the schema forbids."""
    return " ".join(shown(text).split()) or "–"


def _check_country(code: str) -> None:
    if len(code) != 2 or not code.isascii() or not code.isupper():
        raise UsageError(f"laboratory: country: {shown(code)[:20]!r} is no code of two capitals, such as DE.")


def _conditions(calibration: Calibration, profile: Profile, temperature: str) -> dict[str, str]:
    """What the laboratory says of the conditions, and the temperature if it says none."""
    celsius = calibration.temperature_celsius
    known = {} if celsius is None else {temperature: f"{celsius:.1f} °C"}
    return profile.conditions | known | profile.conditions


def _in_si(unit: str) -> tuple[str, float] | None:
    """Return a parameter's unit as D-SI with the factor to it; None for what D-SI cannot say."""
    raw, _, per = unit.removesuffix(")").partition("/(")
    if per in ("T", "local field"):
        factor = magnetic_field_factor(raw)
        if factor is None:
            return (r"\tesla\tothe{-1}" if per == "T" else _ONE), 1.0
        return (_ONE if per == "T" else r"\tesla"), factor
    kind, factor = si_of(unit)
    found = _KINDS.get(kind) or _COUNTS.get(unit)
    return None if found is None else (found, factor)


def _parameters(calibration: Calibration) -> list[dict[str, str | float]]:
    rows: list[dict[str, str | float]] = []
    for one in calibration.every_parameter:
        told = _in_si(one.unit)
        if told is not None:
            unit, scale = told
            k = one.coverage_factor or calibration.quality.coverage_factor
            expanded = k * one.standard_uncertainty * scale
            row = {"name": one.name.replace(" ", "_"), "value": one.value * scale, "unit": unit}
            rows.append({**row, "expanded": expanded, "factor": float(k)})
    return rows


def entries_in_si(calibration: Calibration) -> tuple[list[str], list[str], np.ndarray, np.ndarray]:
    """Return names, D-SI units, values (n,) and covariance (n, n) of matrices and biases.

    Parameters
    ----------
    calibration : with a covariance.
    """
    order = {name: at for at, name in enumerate(entry_names())}
    values = vector_of_model(calibration.model)
    units: list[str] = []
    factors: list[float] = []
    rows: list[int] = []
    force, rate = calibration.raw_units.factors
    told = {"accelerometer": (force, _FORCE, _PER_FORCE), "gyroscope": (rate, _RATE, _PER_RATE)}
    for row, name in enumerate(calibration.covariance_parameters):
        triad, _, rest = name.partition(".")
        if name not in order or not rest.startswith(("matrix", "bias")):
            continue
        factor, si, per_count = told[triad]
        bias, entry = (_ONE, per_count) if factor is None else (si, _ONE)
        units.append(bias if rest.startswith("bias") else entry)
        factors.append(1.0 if factor is None else factor)
        rows.append(row)
    names = [calibration.covariance_parameters[row] for row in rows]
    scale = np.array(factors)
    covariance = calibration.covariance_matrix[np.ix_(rows, rows)] * np.outer(scale, scale)
    return names, units, values[[order[name] for name in names]] * scale, covariance


def _entries(calibration: Calibration) -> dict[str, Any] | None:
    """Matrices and biases with the columns of their covariance, and the factor of their ellipsoid."""
    if not calibration.covariance_parameters:
        return None
    from scipy.special import chdtri

    names, units, values, covariance = entries_in_si(calibration)
    inverse: Any = chdtri
    told = int(np.sum(np.diag(covariance) > 0.0))
    return {
        "names": names,
        "values": values.tolist(),
        "units": units,
        "columns": [
            (covariance[:, k].tolist(), [_product(other, unit) for other in units])
            for k, unit in enumerate(units)
        ],
        "factor": math.sqrt(float(inverse(float(max(told, 1)), 1.0 - PROBABILITY))),
    }


def _product(one: str, two: str) -> str:
    parts = [part for part in (one, two) if part != _ONE]
    return "".join(parts) or _ONE
