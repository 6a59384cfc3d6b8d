"""`tumble certificate`: a calibration as a certificate."""

from __future__ import annotations

from dataclasses import asdict

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import progress, results_stand, say, say_json, say_written
from tumble.workflows import CertificateRequest


def certificate_command(asked: CertificateRequest, printed: PrintOptions) -> None:
    """A certificate of a calibration in the form of ISO/IEC 17025: PDF/A with the calibration.json inside.

    tumble certificate calibrated --profile laboratory.yaml -o unit-17.pdf
    """
    from tumble.workflows import make_certificate

    with progress(printed.silent) as tell:
        tell("the certificate")
        made = make_certificate(asked)
    results_stand()
    if printed.as_json:
        say_json({**asdict(made), "files": [str(one) for one in made.files]}, indent=1)
        return
    say(f"Certificate {made.number}", *(made.lacking if not printed.quiet else []))
    say_written(made.files)
