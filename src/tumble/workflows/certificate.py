"""From a calibration and a laboratory's profile to a certificate, and back."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from tumble.certificate import Profile, certificate_content, certificate_pdf, read_profile
from tumble.certificate.profile import Laboratory
from tumble.document import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.files import check_target, make_folder, read_text, shown, write_text, written_beside
from tumble.records import dataclass

NOBODY = "–"


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate that was written: its number, the document's hash, its files, and what it lacks, in sentences."""

    number: str
    sha256: str
    files: list[Path]
    lacking: list[str]


def make_certificate(
    calibration: Path,
    output: Path,
    *,
    profile: Path | None = None,
    number: str | None = None,
    date: str | None = None,
    language: str = "en",
    short: bool = False,
    dcc: Path | None = None,
    registry: str | None = None,
) -> Certificate:
    """Write a certificate.

    Parameters
    ----------
    calibration : a ``calibration.json``, or its folder.
    output : PDF file.
    profile : what the laboratory says; without it the certificate has no laboratory.
    number : of the certificate; by default made of the day and the calibration's identity.
    date : of issue, YYYY-MM-DD; today by default. The same day makes the same bytes.
    language : of `tumble.certificate.languages.LANGUAGES`.
    short : on one page.
    dcc : file for the digital calibration certificate beside it.
    registry : that keeps the certificate's number.

    Raises
    ------
    CalibrationFileError, UsageError, OutputError
        If an input is wrong, or a file cannot be written.
    """
    document = read_calibration(calibration)
    told, logo = (
        (Profile(laboratory=Laboratory(name=NOBODY)), None) if profile is None else read_profile(profile)
    )
    _require_same_item(document, told)
    day = date or datetime.now(UTC).strftime("%Y-%m-%d")
    number = number or f"{day.replace('-', '')}-{document.identity}"
    if shown(number) != number or len(number) > 80 or not number.strip():
        raise UsageError(f"--number {shown(number)[:40]!r}: give up to 80 visible characters.")
    check_target(output)
    # The file itself is attached, so that its hash is the certificate's.
    text = read_text(calibration / "calibration.json" if calibration.is_dir() else calibration)
    content = certificate_content(document, told, number, day, language, text)
    pdf = certificate_pdf(content, short=short, logo=logo)
    xml = None
    if dcc is not None:
        from tumble.certificate.dcc import dcc_text

        xml = dcc_text(document, told, number, day, language, text)
        check_target(dcc)
    if registry is not None:
        _register(registry, _document_hash_of(document), number)
    make_folder(output.parent)
    with written_beside(output) as beside:
        beside.write_bytes(pdf)
    if dcc is not None and xml is not None:
        write_text(dcc, xml)
    return Certificate(number, content.sha256, [output, *([dcc] if dcc else [])], _lacking(told))


def _require_same_item(document: Calibration, profile: Profile) -> None:
    """Refuse a profile of another unit."""
    item, unit = profile.item, document.imu
    for what, said, noted in (
        ("serial number", item.serial_number, unit.serial_number),
        ("model", item.model, unit.model),
    ):
        if said and noted and said != noted:
            raise UsageError(
                f"The profile's item has the {what} {shown(said)}, and the calibration is of {shown(noted)}: "
                "correct the profile, or leave it out there."
            )


def _lacking(profile: Profile) -> list[str]:
    """What ISO/IEC 17025 asks for and nobody has said."""
    asked: Sequence[tuple[str, str]] = (
        ("the laboratory (laboratory: name)", profile.laboratory.name.replace(NOBODY, "")),
        ("the customer (customer: name)", "" if profile.customer is None else profile.customer.name),
        ("what the results are traceable to (traceability)", profile.traceability),
        ("the item's condition (item: condition)", profile.item.condition),
        ("who authorised it (authorised_by)", profile.authorised_by),
        ("conditions such as temperature (conditions)", "".join(profile.conditions)),
    )
    missing = [name for name, said in asked if not said]
    if not missing:
        return []
    return [f"ISO/IEC 17025 asks for more than the profile says: {'; '.join(missing)}."]


def _document_hash_of(calibration: Calibration) -> str:
    """Return the hash by which a registry knows a document."""
    return hashlib.sha256(calibration.to_json().encode()).hexdigest()


def _register(name: str, sha256: str, number: str) -> None:
    from tumble.registry.store import add_certificate
    from tumble.workflows.registry import registry_at

    with registry_at(name) as registry:
        add_certificate(registry, sha256, number)
