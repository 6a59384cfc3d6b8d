"""tumble: calibrate an IMU from a recording of it being held and turned.

Begin with a recording that says where it was made::

    import math, tumble
    site = tumble.Site.from_latitude(math.radians(48.1), 520.0)
    run = tumble.calibrate("imu.csv", site=site, output="calibrated")
    run.accepted            # whether it is fit for use
    run.to_frame()          # parameters with standard uncertainties
    run.figures()["holds"]  # a figure of the report
    calibration = tumble.read_calibration("calibrated")
    force, rate = calibration.correct(raw_force, raw_rate)

The names below are the package's front; everything else is reached through its room
(``tumble.earth``, ``tumble.sensor``, ...). Importing the package alone imports no other library: a
room is entered when one of its names is first used.

Conventions
-----------
**Data.** numpy in, numpy out; float64; samples run along the first axis, so a signal is (samples, 3).

**Units.** SI and radians everywhere. A name carries a unit exactly when it is not SI
(``latitude_deg``, ``temperature_celsius``). Raw signals keep the numbers of their file, counts or SI.

**Frames**, one letter each: i inertial, e Earth-fixed, n local level north-east-down, b the IMU's
output frame, t table base, p platform; a and g the non-orthogonal accelerometer and gyro triads. A
vector ends in the frame that it is written in (``specific_force_b``); an angular rate says first what
turns against what (``angular_rate_ib_b``: b against i).

**Rotations.** Subscripts run to-from, so that neighbours cancel: ``v_n = C_nb @ v_b``. Quaternions are
scalar last, as scipy's.

**Sign.** An accelerometer senses specific force. At rest it is minus gravity: a unit held level with
its z axis up shows +9.8 m/s² on z.

**The one model.** Each triad, true values in m/s² or rad/s in frame b::

    u   = matrix @ true
    raw = u + asymmetry * |u| + quadratic * u**2 + g_sensitivity @ specific_force + bias + noise

``matrix`` maps *true to raw*: scale, non-orthogonality and the rotation to b together. Which frame b is,
the calibration's gauge says; by default the forward accelerometer matrix is lower-triangular, so that
b's x axis is the sensing axis of the x accelerometer. g-sensitivity is the gyro's alone.

``docs/conventions.md`` works these out with an example in numbers.
"""

from __future__ import annotations

# As `typing` has it; importing that takes half the time that `tumble` has to stop without a word.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from tumble.document import Calibration, read_calibration
    from tumble.earth import Site
    from tumble.errors import TumbleError, __version__
    from tumble.recording import Recording, read_recording
    from tumble.segmentation import find_timeline
    from tumble.sensor import ImuModel
    from tumble.workflows import analyse_noise, apply, calibrate, convert_to, simulate, verify

__all__ = [
    "Calibration",
    "ImuModel",
    "Recording",
    "Site",
    "TumbleError",
    "__version__",
    "analyse_noise",
    "apply",
    "calibrate",
    "convert_to",
    "find_timeline",
    "read_calibration",
    "read_recording",
    "simulate",
    "verify",
]

_ROOMS = {
    "Calibration": "document",
    "ImuModel": "sensor",
    "Recording": "recording",
    "Site": "earth",
    "TumbleError": "errors",
    "__version__": "errors",
    "analyse_noise": "workflows",
    "apply": "workflows",
    "calibrate": "workflows",
    "convert_to": "workflows",
    "find_timeline": "segmentation",
    "read_calibration": "document",
    "read_recording": "recording",
    "simulate": "workflows",
    "verify": "workflows",
}


def __getattr__(name: str) -> object:
    """Fetch a public name from its room at first use (PEP 562).

    Raises
    ------
    AttributeError
        If the package has no such public name.
    """
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
