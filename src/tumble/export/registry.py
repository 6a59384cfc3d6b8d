"""The targets by name, in the order in which they are listed."""

from __future__ import annotations

from tumble.errors import UsageError
from tumble.export import (
    ardupilot,
    basalt,
    c_header,
    cpp_header,
    fusion,
    ikalibr,
    imu_tk,
    imucal,
    kalibr,
    kf_gins,
    matlab,
    okvis,
    openvins,
    px4,
    python_file,
    realsense,
    ros,
    svo,
    vectornav,
    vins,
)
from tumble.export.target import Target

_ALL = (
    kalibr.NOISE_TARGET,
    kalibr.TARGET,
    openvins.TARGET,
    imu_tk.TARGET,
    imu_tk.OPENICC,
    px4.TARGET,
    ardupilot.TARGET,
    c_header.TARGET,
    cpp_header.TARGET,
    python_file.TARGET,
    ros.TARGET,
    vins.TARGET,
    okvis.TARGET,
    svo.TARGET,
    basalt.TARGET,
    kf_gins.TARGET,
    fusion.TARGET,
    vectornav.TARGET,
    matlab.TARGET,
    imucal.TARGET,
    realsense.TARGET,
    ikalibr.TARGET,
)
TARGETS: dict[str, Target] = {target.name: target for target in _ALL}


def find_target(name: str, *, reading: bool = False) -> Target:
    """Return the target of a name.

    Parameters
    ----------
    name : as ``--to`` takes it.
    reading : it is to be read from.

    Raises
    ------
    UsageError
        If there is none, or it can be written only.
    """
    if name not in TARGETS:
        raise UsageError(f"There is no target {name!r}: choose one of {', '.join(TARGETS)}.")
    target = TARGETS[name]
    if reading and target.read is None:
        readable = ", ".join(t.name for t in TARGETS.values() if t.read is not None)
        raise UsageError(f"{target.title} is written only: its files do not say enough. Read are {readable}.")
    return target
