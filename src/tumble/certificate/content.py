"""What stands on a certificate (ISO/IEC 17025:2017, 7.8.2, 7.8.4 and 7.8.6), as texts in one language.

There is no recall date: a certificate recommends none unless the customer agreed (7.8.4.3); `tumble registry
list --due` says it. Nothing claims an accreditation: what a laboratory states stands as its own statement.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import field
from importlib.resources import files
from typing import Any

from tumble.certificate.profile import Profile
from tumble.document import Calibration
from tumble.errors import UsageError
from tumble.parameters import decimals_of, fixed, parameter_of, said_unit
from tumble.records import dataclass
from tumble.report import rows_of

LANGUAGES = {"en": "English", "de": "German", "fr": "French", "es": "Spanish", "zh": "Chinese"}
# Which write a comma where English has a point.
DECIMAL_COMMA = ("de", "fr", "es")

_ORDER = ("en", "de", "fr", "es", "zh")


def _read() -> str:
    """A phrase a line: its key, then itself in each language."""
    return (files("tumble.certificate") / "templates" / "phrases.txt").read_text(encoding="utf-8")


PHRASES: dict[str, dict[str, str]] = {
    key: dict(zip(_ORDER, (word.strip(" ​") for word in words), strict=True))
    for key, *words in (line.split("|") for line in _read().strip().splitlines())
}


def phrases(language: str) -> dict[str, str]:
    """Return all phrases in a language, by key.

    Parameters
    ----------
    language : of `LANGUAGES`.
    """
    return {key: words[language] for key, words in PHRASES.items()}


def parameter_words(name: str, language: str) -> str:
    """Return what a parameter without its triad is called, its axis behind.

    Parameters
    ----------
    name : as a calibration has it, without accelerometer or gyro in front.
    language : of `LANGUAGES`.
    """
    for key in sorted(PHRASES, key=len, reverse=True):
        if name == key or name.startswith(f"{key} "):
            return f"{PHRASES[key][language]}{name[len(key) :].replace(' to force ', ' ← ')}"
    return name


PROBABILITY = 0.95
# Notes of the calibration whose names the certificate has in its languages.
_NOTED = ("operator", "instrument", "remarks")
_MOST_NAMED = 6
_GROUPS = ("accelerometer", "gyro", "magnetometer", "other")


@dataclass(frozen=True)
class CertificateContent:
    """All texts of a certificate.

    Attributes
    ----------
    number, date, language : of the certificate; the day as YYYY-MM-DD.
    document : text of ``calibration.json``.
    sha256 : of it.
    phrases : fixed words.
    facts : (what, said) above the results.
    groups : (title, rows of quantity, value, expanded uncertainty, factor, unit).
    conformity : (rows of quantity, limits, decision), the rule, and the whole decision; None without limits.
    notes : sentences below the results.
    model : the formula that the results are of, and what each of its letters means.
    laboratory : lines of name and address; `authorised` : who answers for it.
    """

    number: str
    date: str
    language: str
    document: str
    sha256: str
    phrases: dict[str, str]
    facts: list[tuple[str, str]]
    groups: list[tuple[str, list[list[str]]]]
    conformity: dict[str, Any] | None
    notes: list[str]
    laboratory: list[str]
    statement: str = ""
    authorised: str = ""
    frame: str = ""
    model: list[str] = field(default_factory=list[str])
    not_determined: list[str] = field(default_factory=list[str])


def certificate_content(
    calibration: Calibration, profile: Profile, number: str, date: str, language: str, text: str | None = None
) -> CertificateContent:
    """Return what a certificate says.

    Parameters
    ----------
    calibration, profile : the document, and what the laboratory says.
    number : unique to the certificate; it stands on each page.
    date : of issue, YYYY-MM-DD.
    language : of `LANGUAGES`.
    text : of the document's file; None writes it anew.

    Raises
    ------
    UsageError
        If the language is none of these.
    """
    if language not in LANGUAGES:
        raise UsageError(f"--language {language}: there are {', '.join(LANGUAGES)}.")
    words, laboratory, field_block = phrases(language), profile.laboratory, calibration.magnetometer
    against = [] if field_block is None else field_block.reasons_against
    text = calibration.to_json() if text is None else text
    comma = language in DECIMAL_COMMA
    return CertificateContent(
        number=number,
        date=date,
        language=language,
        document=text,
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        phrases=words,
        facts=_facts(calibration, profile, words, comma=comma),
        groups=_results(calibration, language, comma=comma),
        conformity=_conformity(calibration, words, language, comma=comma),
        notes=_notes(calibration, words),
        laboratory=[laboratory.name, *filter(None, (laboratory.address, laboratory.contact))],
        statement=profile.statement,
        authorised=profile.authorised_by,
        frame=calibration.frame.description,
        model=_model(calibration, words),
        not_determined=[*calibration.not_determined, *against],
    )


def _facts(
    calibration: Calibration, profile: Profile, words: dict[str, str], *, comma: bool
) -> list[tuple[str, str]]:
    item, customer, site = profile.item, profile.customer, calibration.site
    known = 2.0 * site.gravity_standard_uncertainty
    digits = max(decimals_of(known), 0) if known > 0.0 else 5
    gravity = _number(site.gravity, digits, comma=comma)
    spread = f"({gravity} ± {_number(known, digits, comma=comma)}) m/s² (k = 2)"
    gravity = spread if known > 0.0 else f"{gravity} m/s²"
    celsius = calibration.temperature_celsius
    conditions, noted = dict(profile.conditions), dict(calibration.notes)
    where = noted.pop("place", "")
    temperature = "" if celsius is None else f"{_number(celsius, 1, comma=comma)} °C"
    serial = item.serial_number or calibration.imu.serial_number or "–"
    whom = "" if customer is None else ", ".join(filter(None, (customer.name, customer.address)))
    parts = [
        (words["customer"], whom),
        (words["item"], words["item_kind"]),
        (words["manufacturer"], item.manufacturer),
        (words["model"], item.model or calibration.imu.model or "–"),
        (words["serial"], serial),
        (words["condition"], item.condition),
        (words["received"], item.received),
        (words["calibrated"], calibration.created[:10]),
        (words["place"], profile.place or where or profile.laboratory.address or "–"),
        (words["method"], ", ".join(filter(None, (profile.method, calibration.procedure)))),
        (words["gravity"], gravity),
        (words["temperature"], temperature),
        *((name, value) for name, value in conditions.items()),
        *((words[name] if name in _NOTED else name.capitalize(), value) for name, value in noted.items()),
        (words["adjustment"], profile.adjustment),
        (words["traceability"], profile.traceability or "–"),
        (
            words["recordings"],
            ", ".join(f"{one.name} ({one.sha256[:12]}…)" for one in calibration.recordings[:_MOST_NAMED])
            + (f" + {more}" if (more := len(calibration.recordings) - _MOST_NAMED) > 0 else ""),
        ),
        (words["software"], calibration.software),
    ]
    return [(name, value) for name, value in parts if value]


def _results(calibration: Calibration, language: str, *, comma: bool) -> list[tuple[str, list[list[str]]]]:
    groups: dict[str, list[list[str]]] = {name: [] for name in _GROUPS}
    for row in rows_of(calibration.every_parameter, calibration):
        k, one = row.factor(calibration.quality.coverage_factor), row.said
        expanded = k * one.sigma
        decimals = max(decimals_of(expanded), 0) if math.isfinite(expanded) and expanded > 0.0 else 6
        groups[row.parameter.family.triad or "other"].append(
            [
                parameter_words(row.parameter.within_triad, language),
                _number(one.value, decimals, comma=comma),
                _number(expanded, decimals, comma=comma) if expanded > 0.0 else "–",
                _number(k, 2, comma=comma),
                one.unit or "1",
            ]
        )
    return [(phrases(language)[name], rows) for name, rows in groups.items() if rows]


def _conformity(
    calibration: Calibration, words: dict[str, str], language: str, *, comma: bool
) -> dict[str, Any] | None:
    block = calibration.limits
    if block is None:
        return None
    rows: list[list[str]] = []
    for one in block.parameters:
        known = parameter_of(one.name)
        name = parameter_words(known.within_triad, language)
        if known.family.triad:
            name = f"{words[known.family.triad]}: {name}"
        times, unit = said_unit(
            one.unit, [abs(end) for end in (one.value, one.lower, one.upper) if end is not None]
        )
        ends = ["" if end is None else f"{times * end:.6g}" for end in (one.lower, one.upper)]
        text = f"{ends[0]} … {ends[1]} {unit}".replace("-", "−") if any(ends) else "–"
        rows.append([name, text.replace(".", ",") if comma else text, words[one.decision]])
    rule = words[f"rule_{block.rule}"] + (
        f": {100 * (block.risk or 0.0):.3g} %" if block.rule == "risk" else ""
    )
    return {
        "rows": rows,
        "rule": f"{words['rule']}: {rule}",
        "decision": words[block.decision],
        "name": block.name,
    }


def _model(calibration: Calibration, words: dict[str, str]) -> list[str]:
    """The formula with the terms that the results have, and sentences for its letters."""
    families = [parameter_of(parameter.name).family for parameter in calibration.every_parameter]
    kinds = {family.kind.replace("-", "_") for family in families}
    there = {term: term in kinds for term in ("asymmetry", "quadratic", "g_sensitivity")}
    u = f"M · {words['true']}"
    bent = there["asymmetry"] or there["quadratic"]
    terms = [
        "u" if bent else u,
        *(["a · |u|"] if there["asymmetry"] else []),
        *(["q · u²"] if there["quadratic"] else []),
        *([f"G · f ({words['gyro']})"] if there["g_sensitivity"] else []),
        "b",
    ]
    formula = f"{words['raw']} = {' + '.join(terms)}" + (f", u = {u}" if bent else "")
    letters = [words[f"{term}_words"] for term, seen in there.items() if seen]
    letters += [words["field_words"]] if any(family.triad == "magnetometer" for family in families) else []
    return [f"{formula}.", words["model_words"], *letters, words["definitions"]]


def _notes(calibration: Calibration, words: dict[str, str]) -> list[str]:
    fit = calibration.verdict.fit
    # Reasons against the results are the evaluation's own words, in its language.
    reasons = [] if fit else calibration.verdict.reasons
    return [words["verdict_fit"] if fit else words["verdict_unfit"], *reasons, words["uncertainty_words"]]


def _number(value: float, decimals: int, *, comma: bool) -> str:
    text = fixed(value, decimals).replace("-", "−")
    return text.replace(".", ",") if comma else text
