"""Recordings of which the truth is known: motion, sensor errors, noise.

`Motion` says what is done to the unit, a `Grade` says what kind of unit it
is, and `simulate_recording` plays it; `simulate_protocol` plays a protocol with its placement errors. Every
random number comes from the generator that is passed in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.simulation.axis_angles import FixtureAngles, fixture_angles
    from tumble.simulation.chamber import Chamber, ChamberTruth, simulate_chamber
    from tumble.simulation.errors import SessionErrors
    from tumble.simulation.fixtures import PlayedProtocol, TrueRotation, TrueSpin, play_protocol
    from tumble.simulation.grades import (
        GRADES,
        Grade,
        ThermalGrade,
        TriadGrade,
        find_grade,
        find_thermal_grade,
    )
    from tumble.simulation.motion import Detours, Motion
    from tumble.simulation.noise import TriadNoise, convert_to_digital, simulate_noise
    from tumble.simulation.poses import poses_26, simulate_hand_poses
    from tumble.simulation.protocols import simulate_protocol
    from tumble.simulation.recordings import Distort, Truth, simulate_recording
    from tumble.simulation.sampling import Imperfections
    from tumble.simulation.table import TableErrors
    from tumble.simulation.trajectories import SplineTrajectory, TravelledStates, drive_along, simulate_drive
    from tumble.simulation.two_axis import FixtureErrors, play_sequences

__all__ = [
    "GRADES",
    "Chamber",
    "ChamberTruth",
    "Detours",
    "Distort",
    "FixtureAngles",
    "FixtureErrors",
    "Grade",
    "Imperfections",
    "Motion",
    "PlayedProtocol",
    "SessionErrors",
    "SplineTrajectory",
    "TableErrors",
    "ThermalGrade",
    "TravelledStates",
    "TriadGrade",
    "TriadNoise",
    "TrueRotation",
    "TrueSpin",
    "Truth",
    "convert_to_digital",
    "drive_along",
    "find_grade",
    "find_thermal_grade",
    "fixture_angles",
    "play_protocol",
    "play_sequences",
    "poses_26",
    "simulate_chamber",
    "simulate_drive",
    "simulate_hand_poses",
    "simulate_noise",
    "simulate_protocol",
    "simulate_recording",
]

_MODULES = {
    "GRADES": "grades",
    "Chamber": "chamber",
    "ChamberTruth": "chamber",
    "Detours": "motion",
    "Distort": "recordings",
    "FixtureAngles": "axis_angles",
    "FixtureErrors": "two_axis",
    "Grade": "grades",
    "Imperfections": "sampling",
    "Motion": "motion",
    "PlayedProtocol": "fixtures",
    "SessionErrors": "errors",
    "SplineTrajectory": "trajectories",
    "TableErrors": "table",
    "ThermalGrade": "grades",
    "TravelledStates": "trajectories",
    "TriadGrade": "grades",
    "TriadNoise": "noise",
    "TrueRotation": "fixtures",
    "TrueSpin": "fixtures",
    "Truth": "recordings",
    "convert_to_digital": "noise",
    "drive_along": "trajectories",
    "find_grade": "grades",
    "find_thermal_grade": "grades",
    "fixture_angles": "axis_angles",
    "play_protocol": "fixtures",
    "play_sequences": "two_axis",
    "poses_26": "poses",
    "simulate_chamber": "chamber",
    "simulate_drive": "trajectories",
    "simulate_hand_poses": "poses",
    "simulate_noise": "noise",
    "simulate_protocol": "protocols",
    "simulate_recording": "recordings",
}


def __getattr__(name: str) -> object:
    """Fetch a name from its module at first use: a data sheet needs no splines.

    Raises
    ------
    AttributeError
        If the room has no such name.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
