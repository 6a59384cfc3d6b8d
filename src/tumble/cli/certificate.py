"""`tumble certificate`: a calibration as a certificate."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from tumble.cli.options import PrintOptions, RegistryName
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows.request import FIRST, argument, option


def certificate_command(
    printed: PrintOptions,
    calibration: Path = argument("CALIBRATION"),
    output: Path = option(FIRST, "FILE", "--output", "-o", default=Path("certificate.pdf")),
    profile: Path | None = option(FIRST, "PROFILE.YAML"),
    number: str | None = option(FIRST, "TEXT"),
    language: str = option(FIRST, "CODE", default="en", show_default=True),
    date: str | None = option(FIRST, "YYYY-MM-DD"),
    registry: RegistryName = None,
) -> None:
    """A certificate of a calibration in the form of ISO/IEC 17025: PDF/A with the calibration.json inside.

    tumble certificate calibrated --profile laboratory.yaml -o unit-17.pdf

    Parameters
    ----------
    calibration : calibration.json, or its folder.
    output : The PDF (default: certificate.pdf); as .xml, PTB's digital calibration certificate (DCC 3.3.0).
    profile : What the laboratory says: name, logo, customer, traceability, conditions.
    number : Its number (default: made of the day).
    language : en, de, fr, es or zh.
    date : Day of issue (default: today); the same day makes the same bytes.
    """
    from tumble.workflows.certificate import make_certificate

    with progress(printed.silent) as tell:
        tell("the certificate")
        made = make_certificate(
            calibration,
            output,
            profile=profile,
            number=number,
            date=date,
            language=language,
            registry=registry,
        )
    results_stand()
    if printed.as_json:
        say_json({**asdict(made), "files": [str(one) for one in made.files]}, indent=1)
        return
    say(f"Certificate {made.number}", *(made.lacking if not printed.quiet else []))
    say_written(made.files)
