"""What a thermal calibration is worth in another session of the same simulated unit.

    python benchmarks/thermal_session.py [FOLDER]

Calibrates a ramp, corrects another session's ramp (another seed: other biases at turn-on, other noise), and prints
by how much the means of 60 stretches differ before and after.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

RUN = "import sys; from tumble.cli.main import main; sys.argv[0] = 'tumble'; main()"
STRETCHES = 60


def tumble(*words: str | Path) -> None:
    """Run the program quietly; what goes wrong is its own sentence."""
    subprocess.run([sys.executable, "-c", RUN, *map(str, words), "-q"], check=True, stdout=subprocess.DEVNULL)


def spans(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return largest less smallest mean of the stretches of both triads, mm/s² and mrad/s."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows = rows[: len(rows) // STRETCHES * STRETCHES]
    means = rows.reshape(STRETCHES, -1, rows.shape[1]).mean(axis=1)
    return 1e3 * np.ptp(means[:, 1:4], axis=0), 1e3 * np.ptp(means[:, 4:7], axis=0)


def main() -> None:
    """Print a line for each triad before and after."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    tumble("simulate", "thermal-ramp", "-o", folder / "one")
    tumble("simulate", "thermal-ramp", "--unit", "0", "--seed", "5", "-o", folder / "other")
    tumble(
        "calibrate", folder / "one" / "recording.csv", "--procedure", "thermal", "-o", folder / "calibrated"
    )
    raw, corrected = folder / "other" / "recording.csv", folder / "corrected.csv"
    tumble("apply", folder / "calibrated", raw, "-o", corrected, "--units", "m/s^2,rad/s,s")
    for name, path in (("raw", raw), ("corrected", corrected)):
        force, rate = spans(path)
        print(f"specific force, {name:10s}", *(f"{value:8.2f}" for value in force), "mm/s²")
        print(f"angular rate,   {name:10s}", *(f"{value:8.2f}" for value in rate), "mrad/s")


if __name__ == "__main__":
    main()
