"""`tumble apply`: correct a recording with a calibration."""

from __future__ import annotations

from dataclasses import replace

from tumble.cli.options import PrintOptions
from tumble.cli.terminal import progress, results_stand, say, say_json
from tumble.workflows import ApplyRequest


def apply_command(asked: ApplyRequest, printed: PrintOptions) -> None:
    """Correct a recording: specific force in m/s², angular rate in rad/s, in the calibration's frame b.

    tumble apply calibrated imu.csv -o corrected.csv

    tumble apply calibrated drive.bag -o drive-corrected.bag

    Of a bag everything but the IMU's messages stays as it is, byte for byte. Recordings longer than memory are
    corrected block by block. A calibration with a thermal model follows the recording's temperature; beyond the
    temperatures that were calibrated it refuses (see --outside). The file says which calibrations it went through:
    none is applied twice.
    """
    from tumble.workflows import apply

    with progress(printed.silent) as tell:
        tell("reading")

        def so_far(samples: int) -> None:
            tell(f"{samples:,} samples corrected")

        done = apply(**vars(replace(asked, progress=so_far)))
    results_stand()
    if printed.as_json:
        say_json({"file": str(done.file.resolve()), "samples": done.samples, "remarks": done.remarks})
        return
    if not printed.quiet:
        say(*done.remarks)
    say(f"{done.samples} samples corrected, written: {done.file.resolve()}")
