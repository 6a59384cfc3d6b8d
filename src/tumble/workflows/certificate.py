"""From a calibration and a laboratory's profile to a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from tumble.certificate import Laboratory, Profile, certificate_content, certificate_pdf, read_profile
from tumble.document import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.files import check_target, read_text, results_folder, shown, write_texts
from tumble.records import dataclass
from tumble.workflows.request import CertificateRequest

NOBODY = "–"


@dataclass(frozen=True)
class Certificate:
    """A certificate that was written: its number, the document's hash, its files, and what it lacks, in sentences."""

    number: str
    sha256: str
    files: list[Path]
    lacking: list[str]


def make_certificate(request: CertificateRequest) -> Certificate:
    """Write a certificate.

    Parameters
    ----------
    request : the calibration, the laboratory's profile, and where it goes. The certificate's number is by default made
        of the day and the calibration's identity; the same day makes the same bytes.

    Raises
    ------
    CalibrationFileError, UsageError, OutputError
        If an input is wrong, or a file cannot be written.
    """
    calibration, output, profile = request.calibration, request.output, request.profile
    document = read_calibration(calibration)
    told, logo = (
        (Profile(laboratory=Laboratory(name=NOBODY)), None) if profile is None else read_profile(profile)
    )
    _require_same_item(document, told)
    day = _day_of(request.date)
    number = request.number or f"{day.replace('-', '')}-{document.identity}"
    if shown(number) != number or len(number) > 80 or not number.strip():
        raise UsageError(f"--number {shown(number)[:40]!r}: give up to 80 visible characters.")
    check_target(output)
    results_folder(output.parent)
    if output.suffix.lower() not in (".pdf", ".xml"):
        raise UsageError(f"-o {output}: a certificate is a .pdf for people or a .xml for machines.")
    # The file itself is attached, so that its hash is the certificate's.
    text = read_text(calibration / "calibration.json" if calibration.is_dir() else calibration)
    content = certificate_content(document, told, number, day, request.language, text)
    if output.suffix.lower() == ".xml":
        from tumble.certificate import dcc_text

        made = dcc_text(document, told, number, day, request.language, text).encode()
    else:
        made = certificate_pdf(content, logo=logo)
    if request.registry is not None:
        from tumble.registry import add_certificate, document_hash
        from tumble.workflows.registry import registry_at

        with registry_at(request.registry) as kept:
            add_certificate(kept, document_hash(document.to_json()), number)
    return Certificate(number, content.sha256, write_texts({output: made}), _lacking(told))


def _day_of(date: str | None) -> str:
    """The day of issue as YYYY-MM-DD, today by default."""
    if date is None:
        return datetime.now(UTC).strftime("%Y-%m-%d")
    try:
        return datetime.strptime(date, "%Y-%m-%d").strftime("%Y-%m-%d")
    except ValueError:
        raise UsageError(f"--date {shown(date)[:40]}: give a day as 2026-11-22.") from None


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
