"""Recordings of which the truth is known: motion, sensor errors, noise.

`Motion` says what is done to the unit, a `Grade` says what kind of unit it
is, and `simulate_recording` plays it; `simulate_protocol` plays a protocol with its placement errors. Every
random number comes from the generator that is passed in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tumble.simulation.axis_angles import fixture_angles
    from tumble.simulation.chamber import Chamber, ChamberTruth, simulate_chamber
    from tumble.simulation.errors import SessionErrors
    from tumble.simulation.fixtures import PlayedProtocol, play_protocol
    from tumble.simulation.grades import (
        GRADES,
        Grade,
        ThermalGrade,
        TriadGrade,
        find_grade,
        find_thermal_grade,
    )
    from tumble.simulation.motion import Motion
    from tumble.simulation.noise import TriadNoise, convert_to_digital, simulate_noise
    from tumble.simulation.poses import poses_26
    from tumble.simulation.protocols import simulate_protocol
    from tumble.simulation.recordings import Truth, simulate_recording
    from tumble.simulation.sampling import Imperfections
    from tumble.simulation.table import TableErrors
    from tumble.simulation.trajectories import SplineTrajectory, drive_along, simulate_drive
    from tumble.simulation.two_axis import FixtureErrors, play_sequences

__all__ = [
    "GRADES",
    "Chamber",
    "ChamberTruth",
    "FixtureErrors",
    "Grade",
    "Imperfections",
    "Motion",
    "PlayedProtocol",
    "SessionErrors",
    "SplineTrajectory",
    "TableErrors",
    "ThermalGrade",
    "TriadGrade",
    "TriadNoise",
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
    "simulate_noise",
    "simulate_protocol",
    "simulate_recording",
]

# What each module has that others may use.
_NAMES = {
    "axis_angles": "fixture_angles",
    "chamber": "Chamber ChamberTruth simulate_chamber",
    "errors": "SessionErrors",
    "fixtures": "PlayedProtocol play_protocol",
    "grades": "GRADES Grade ThermalGrade TriadGrade find_grade find_thermal_grade",
    "motion": "Motion",
    "noise": "TriadNoise convert_to_digital simulate_noise",
    "poses": "poses_26",
    "protocols": "simulate_protocol",
    "recordings": "Truth simulate_recording",
    "sampling": "Imperfections",
    "table": "TableErrors",
    "trajectories": "SplineTrajectory drive_along simulate_drive",
    "two_axis": "FixtureErrors play_sequences",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


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
