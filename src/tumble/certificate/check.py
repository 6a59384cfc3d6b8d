"""Is a certificate what it says: does it carry the document of its hash, and are its numbers the document's.

The numbers are worked out anew from the document that the PDF carries, and looked for in the PDF's text, row by row.
"""

from __future__ import annotations

import hashlib
import io
import logging
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tumble.certificate.content import CertificateContent, certificate_content
from tumble.certificate.languages import LANGUAGES, phrases
from tumble.certificate.profile import Laboratory, Profile
from tumble.document.result import Calibration
from tumble.errors import UsageError, install
from tumble.files import opened, reading, shown
from tumble.records import dataclass

LARGEST = 64 << 20
ATTACHED = "calibration.json"


@dataclass(frozen=True, slots=True)
class CertificateCheck:
    """What was found.

    Attributes
    ----------
    sha256 : of the document that the certificate carries.
    language : of the certificate.
    problems : sentences; none of a certificate that is as it says.
    rows : results that were compared.
    """

    sha256: str
    language: str
    problems: list[str]
    rows: int


def check_certificate(path: Path, document: Path | None = None) -> CertificateCheck:
    """Check a certificate against the document that it carries, and that against a file.

    Parameters
    ----------
    path : of the PDF.
    document : ``calibration.json`` that it should be of; None for no comparison.

    Raises
    ------
    UsageError
        If it cannot be read, or is no certificate of tumble.
    """
    text, attached = _text_and_attachment(path)
    plain = re.sub(r"\s+", "", text)
    digest = hashlib.sha256(attached).hexdigest()
    problems: list[str] = []
    if digest not in plain:
        problems.append("The hash that is printed is not that of the document that the certificate carries.")
    calibration, others = carried_document(path, attached, document)
    problems += others
    found = [one for one in LANGUAGES if re.sub(r"\s+", "", phrases(one)["title"]) in plain]
    if not found:
        raise UsageError(f"{path} is no certificate of tumble: no title of one is in it.")
    profile = Profile(laboratory=Laboratory(name="–"))
    content = certificate_content(calibration, profile, "–", "2000-01-01", found[0])
    rows = [row for _, members in content.groups for row in members]
    # With the name in front: a digit or a sign before a number makes it another one.
    problems += [
        f"{row[0]}: {row[1]} ± {row[2]} {row[4]} of the document is not what the certificate says."
        for row in rows
        if not _is_on(plain, row)
    ]
    problems += [
        f"{name}: {said} of the document is not what the certificate says."
        for name, said in content.facts
        if name in _of_document(content.phrases, calibration) and not _is_on(plain, [name, said])
    ]
    problems += _wrong_conformity(plain, content)
    return CertificateCheck(digest, found[0], problems, len(rows))


def carried_document(path: Path, attached: bytes, document: Path | None) -> tuple[Calibration, list[str]]:
    """Return the document that a certificate carries, and a problem if it is not the one of a file.

    Parameters
    ----------
    path, attached : of the certificate, and what it carries.
    document : ``calibration.json`` that it should be of; None for no comparison.

    Raises
    ------
    UsageError
        If a file cannot be read, or what is carried is damaged.
    """
    problems: list[str] = []
    if document is not None:
        with reading(document, "a calibration"), opened(document) as file:
            same = file.read() == attached
        if not same:
            problems.append(
                f"The certificate is not of {document}: the document that it carries is another one."
            )
    try:
        return Calibration.model_validate_json(attached), problems
    except ValidationError:
        raise UsageError(f"{path} carries a calibration.json that is damaged.") from None


def _is_on(plain: str, words: Sequence[str]) -> bool:
    """Whether words stand on the pages, one after the other."""
    return re.sub(r"\s+", "", "".join(words)) in plain


def _of_document(words: dict[str, str], calibration: Calibration) -> set[str]:
    """The facts that the document states, and not the profile."""
    known = ["calibrated", "gravity", "software"]
    known += ["temperature"] if calibration.temperature_celsius is not None else []
    known += ["serial"] if calibration.imu.serial_number is not None else []
    return {words[name] for name in known}


def _wrong_conformity(plain: str, content: CertificateContent) -> list[str]:
    told = content.conformity
    if told is None:
        return []
    heading = [content.phrases["conformity"], ": ", told["name"], " – ", told["decision"]]
    if not (_is_on(plain, heading) and _is_on(plain, [told["rule"]])):
        return ["The decision on conformity, or its rule, is not the document's."]
    head = [content.phrases[word] for word in ("quantity", "limits", "decision")]
    if not _is_on(plain, head):  # one page has no rows
        return []
    return [
        f"{name}: {limits}, {decision} of the document is not what the certificate says of conformity."
        for name, limits, decision in told["rows"]
        if not _is_on(plain, [name, limits, decision])
    ]


def _text_and_attachment(path: Path) -> tuple[str, bytes]:
    try:
        import pypdf
        from pypdf.errors import PyPdfError
    except ImportError:
        raise UsageError(f"--check needs pypdf: {install('certificate')}.") from None
    with reading(path, "a certificate"), opened(path) as file:
        content = file.read(LARGEST + 1)
    if not content.startswith(b"%PDF") or len(content) > LARGEST:
        raise UsageError(f"{path} is no PDF of a certificate.")
    logging.getLogger("pypdf").setLevel(logging.CRITICAL)  # what is wrong is said below, in one sentence
    try:
        reader: Any = pypdf.PdfReader(io.BytesIO(content))
        text = "\n".join(page.extract_text() for page in reader.pages)
        attached: list[Any] = list(reader.attachments.get(ATTACHED) or [])
    except (PyPdfError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        raise UsageError(f"{path} is damaged: {shown(str(error))[:120]}.") from None
    if not attached:
        raise UsageError(f"{path} carries no calibration.json: it is no certificate of tumble.")
    return text, bytes(attached[0])
