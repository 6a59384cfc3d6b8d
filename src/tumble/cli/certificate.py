"""`tumble certificate`: a calibration as a certificate, and whether a certificate is what it says."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli.groups import FIRST, option
from tumble.cli.options import PrintOptions, RegistryName, output_option
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.errors import UsageError

if TYPE_CHECKING:
    from tumble.workflows.certificate import Certificate


def certificate_command(
    printed: PrintOptions,
    calibration: Annotated[
        Path | None,
        typer.Argument(metavar="[CALIBRATION]", help="calibration.json, or its folder.", show_default=False),
    ] = None,
    output: Annotated[Path | None, output_option("The PDF (default: certificate.pdf).", "FILE")] = None,
    profile: Annotated[
        Path | None,
        option(
            FIRST, "PROFILE.YAML", "What the laboratory says: name, logo, customer, traceability, conditions."
        ),
    ] = None,
    number: Annotated[str | None, option(FIRST, "TEXT", "Its number (default: made of the day).")] = None,
    language: Annotated[
        str, option(FIRST, "CODE", "en, de, fr, es or zh.", "--language", show_default=True)
    ] = "en",
    short: Annotated[bool, option(FIRST, "", "On one page.", "--short")] = False,
    date: Annotated[
        str | None,
        option(FIRST, "YYYY-MM-DD", "Day of issue (default: today); the same day makes the same bytes."),
    ] = None,
    dcc: Annotated[
        Path | None,
        option(FIRST, "FILE.XML", "Also write PTB's digital calibration certificate (DCC 3.3.0).", "--dcc"),
    ] = None,
    registry: RegistryName = None,
    check: Annotated[
        Path | None,
        option(
            FIRST,
            "CERTIFICATE",
            "Instead: is this certificate (PDF or DCC) what it says, and of CALIBRATION if one is given? Exit status 1 "
            "if not.",
            "--check",
        ),
    ] = None,
) -> None:
    """A certificate of a calibration in the form of ISO/IEC 17025: PDF/A with the calibration.json inside.

    tumble certificate calibrated --profile laboratory.yaml -o unit-17.pdf

    tumble certificate --check unit-17.pdf
    """
    if check is not None:
        _check(check, calibration, printed)
    if calibration is None:
        raise UsageError(
            "Name a calibration, or a certificate to check with --check: see `tumble certificate --help`."
        )
    from tumble.workflows.certificate import make_certificate

    with progress(printed.silent) as tell:
        tell("the certificate")
        made = make_certificate(
            calibration,
            output or Path("certificate.pdf"),
            profile=profile,
            number=number,
            date=date,
            language=language,
            short=short,
            dcc=dcc,
            registry=registry,
        )
    results_stand()
    _print(made, printed)


def _print(made: Certificate, printed: PrintOptions) -> None:
    if printed.as_json:
        say_json({**asdict(made), "files": [str(one) for one in made.files]}, indent=1)
        return
    say(f"Certificate {made.number}", *(made.lacking if not printed.quiet else []))
    say_written(made.files)


def _check(certificate: Path, calibration: Path | None, printed: PrintOptions) -> None:
    document = (
        calibration / "calibration.json" if calibration is not None and calibration.is_dir() else calibration
    )
    if certificate.suffix.lower() == ".xml":
        from tumble.certificate.dcc import check_dcc

        found = check_dcc(certificate, document)
    else:
        from tumble.certificate.check import check_certificate

        found = check_certificate(certificate, document)
    if printed.as_json:
        say_json({**asdict(found), "holds": not found.problems}, indent=1)
    elif found.problems:
        say(*found.problems)
    else:
        say(
            f"The certificate holds: {found.rows} results are those of the document {found.sha256} that it carries."
        )
    raise typer.Exit(1 if found.problems else 0)
