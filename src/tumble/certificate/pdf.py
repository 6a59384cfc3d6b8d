"""A certificate as PDF/A-3 by typst: the same content and day give the same bytes."""

from __future__ import annotations

import json
import tempfile
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from tumble.certificate.content import CertificateContent
from tumble.errors import UsageError, install

STANDARD = "a-3a"
"""PDF/A-3, accessible: it may carry any file, and here carries calibration.json."""
CJK = (
    "Noto Serif CJK SC",
    "Noto Sans CJK SC",
    "Source Han Serif SC",
    "Source Han Sans SC",
    "Songti SC",
    "SimSun",
)
_LOGO = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg"}


def certificate_pdf(content: CertificateContent, *, logo: bytes | None = None) -> bytes:
    """Return a certificate as PDF.

    Parameters
    ----------
    content : of it.
    logo : SVG, PNG or JPEG.

    Raises
    ------
    UsageError
        If a library or a font is missing, or the logo is no picture.
    """
    try:
        import typst
    except ImportError:
        raise UsageError(f"A certificate needs typst and segno: {install('certificate')}.") from None
    day = datetime.strptime(content.date, "%Y-%m-%d").replace(tzinfo=UTC)
    told: dict[str, Any] = {**asdict(content), "logo": None, "cjk": []}
    told.pop("document")
    if content.language == "zh":
        told["cjk"] = _chinese_fonts()
    with tempfile.TemporaryDirectory(prefix="tumble-certificate-") as name:
        folder = Path(name)
        if logo is not None:
            told["logo"] = f"logo{next((e for head, e in _LOGO.items() if logo.startswith(head)), '.svg')}"
            (folder / told["logo"]).write_bytes(logo)
        (folder / "content.json").write_text(json.dumps(told, ensure_ascii=False), encoding="utf-8")
        (folder / "calibration.json").write_text(content.document, encoding="utf-8")
        (folder / "code.svg").write_bytes(_qr_code(content))
        template = (files("tumble.certificate") / "templates" / "certificate.typ").read_text(encoding="utf-8")
        (folder / "main.typ").write_text(template, encoding="utf-8")
        compiled: Any = typst.compile
        try:
            made = compiled(
                str(folder / "main.typ"), root=name, format="pdf", pdf_standards=STANDARD, timestamp=day
            )
        except RuntimeError as error:
            words = str(error).partition("\n")[0][:200]
            raise UsageError(f"The certificate could not be set: {words} (is the logo a picture?).") from None
    return bytes(made)


def _qr_code(content: CertificateContent) -> bytes:
    """Return the code that leads from paper to the document: the certificate's number and the hash, as SVG."""
    import io

    try:
        import segno
    except ImportError:
        raise UsageError(f"A certificate needs typst and segno: {install('certificate')}.") from None
    out = io.BytesIO()
    made: Any = segno.make(f"sha256:{content.sha256} {content.number}", error="m", micro=False)
    made.save(out, kind="svg", scale=1, border=1)
    return out.getvalue()


def _chinese_fonts() -> list[str]:
    import typst

    there = set(typst.Fonts().families())
    found = [name for name in CJK if name in there]
    if not found:
        raise UsageError(
            "No font with Chinese characters is installed: install Noto Serif CJK (Debian: fonts-noto-cjk)."
        )
    return found
