"""Recordings of which the truth is known: motion, sensor errors, noise.

`Motion` says what is done to the unit, `Disturbance` objects shake it, a `Grade` says what kind of unit it
is, and `simulate_recording` plays it; `simulate_protocol` plays a protocol with its placement errors. Every
random number comes from the generator that is passed in.
"""

from tumble.simulation.axis_angles import FixtureAngles, fixture_angles
from tumble.simulation.chamber import Chamber, ChamberTruth, simulate_chamber
from tumble.simulation.disturbances import Detours, Disturbance, Knock, Oscillation, simulate_tremor
from tumble.simulation.fixtures import PlayedProtocol, TrueRotation, TrueSpin, play_protocol
from tumble.simulation.grades import GRADES, Grade, TriadGrade, find_grade
from tumble.simulation.motion import Motion
from tumble.simulation.noise import TriadNoise, convert_to_digital, simulate_noise
from tumble.simulation.poses import poses_26, simulate_hand_poses
from tumble.simulation.protocols import motion_from_protocol, simulate_protocol
from tumble.simulation.recordings import Distort, Truth, simulate_recording
from tumble.simulation.sampling import Imperfections
from tumble.simulation.table import TableErrors
from tumble.simulation.thermal_grades import THERMAL_GRADES, ThermalGrade, find_thermal_grade
from tumble.simulation.trajectories import SplineTrajectory, TravelledStates, drive_along, simulate_drive
from tumble.simulation.two_axis import FixtureErrors, play_sequences

__all__ = [
    "GRADES",
    "THERMAL_GRADES",
    "Chamber",
    "ChamberTruth",
    "Detours",
    "Distort",
    "Disturbance",
    "FixtureAngles",
    "FixtureErrors",
    "Grade",
    "Imperfections",
    "Knock",
    "Motion",
    "Oscillation",
    "PlayedProtocol",
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
    "motion_from_protocol",
    "play_protocol",
    "play_sequences",
    "poses_26",
    "simulate_chamber",
    "simulate_drive",
    "simulate_hand_poses",
    "simulate_noise",
    "simulate_protocol",
    "simulate_recording",
    "simulate_tremor",
]
