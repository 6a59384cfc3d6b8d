"""Is a certificate what it says: does it carry the document of its hash, and are its numbers the document's.

The numbers are worked out anew from the document that the PDF carries, and looked for in the PDF's text, row by row.
"""

from __future__ import annotations

import hashlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tumble.certificate.content import certificate_content
from tumble.certificate.languages import LANGUAGES, phrases
from tumble.certificate.profile import Laboratory, Profile
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.files import opened, shown

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
    if document is not None:
        try:
            with opened(document) as file:
                same = hashlib.sha256(file.read()).hexdigest() == digest
        except OSError as error:
            raise UsageError(f"{document} cannot be read: {error.strerror or error}.") from error
        if not same:
            problems.append(
                f"The certificate is not of {document}: the document that it carries is another one."
            )
    try:
        calibration = Calibration.model_validate_json(attached)
    except ValidationError:
        raise UsageError(f"{path} carries a calibration.json that is damaged.") from None
    found = [one for one in LANGUAGES if re.sub(r"\s+", "", phrases(one)["title"]) in plain]
    if not found:
        raise UsageError(f"{path} is no certificate of tumble: no title of one is in it.")
    profile = Profile(laboratory=Laboratory(name="–"))
    content = certificate_content(calibration, profile, "–", "2000-01-01", found[0])
    rows = [row for _, members in content.groups for row in members]
    wrong = [row for row in rows if re.sub(r"\s+", "", "".join(row[1:4])) not in plain]
    problems += [
        f"{row[0]}: {row[1]} ± {row[2]} {row[4]} of the document is not what the certificate says."
        for row in wrong
    ]
    if content.conformity is not None and content.conformity["decision"] not in text:
        problems.append("The decision on conformity is not the document's.")
    return CertificateCheck(digest, found[0], problems, len(rows))


def _text_and_attachment(path: Path) -> tuple[str, bytes]:
    try:
        import pypdf
        from pypdf.errors import PyPdfError
    except ImportError:
        raise UsageError("--check needs pypdf: pip install 'tumble[certificate]'.") from None
    try:
        with opened(path) as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}.") from error
    if not content.startswith(b"%PDF") or len(content) > LARGEST:
        raise UsageError(f"{path} is no PDF of a certificate.")
    try:
        reader: Any = pypdf.PdfReader(io.BytesIO(content))
        text = "\n".join(page.extract_text() for page in reader.pages)
        attached: list[Any] = list(reader.attachments.get(ATTACHED) or [])
    except (PyPdfError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        raise UsageError(f"{path} is damaged: {shown(str(error))[:120]}.") from None
    if not attached:
        raise UsageError(f"{path} carries no calibration.json: it is no certificate of tumble.")
    return text, bytes(attached[0])
