from .axis_angles import fixture_angles as fixture_angles, unit as unit
from .chamber import Chamber as Chamber, ChamberTruth as ChamberTruth, simulate_chamber as simulate_chamber
from .errors import EARTHS_FIELD as EARTHS_FIELD, SessionErrors as SessionErrors, read_errors as read_errors
from .fixtures import play_protocol as play_protocol, poses_26 as poses_26
from .grades import (
    GRADES as GRADES,
    Grade as Grade,
    ThermalGrade as ThermalGrade,
    TriadGrade as TriadGrade,
    find_grade as find_grade,
    find_thermal_grade as find_thermal_grade,
)
from .magnetometer import (
    SimulatedMagnetometer as SimulatedMagnetometer,
    find_magnetometer as find_magnetometer,
)
from .motion import Motion as Motion
from .noise import (
    TriadNoise as TriadNoise,
    convert_to_digital as convert_to_digital,
    simulate_noise as simulate_noise,
    simulate_wander as simulate_wander,
)
from .protocols import simulate_protocol as simulate_protocol
from .recordings import Truth as Truth, simulate_recording as simulate_recording
from .table import TableErrors as TableErrors
from .thermal_steps import has_chamber as has_chamber
from .trajectories import (
    CART as CART,
    POSES as POSES,
    REST as REST,
    WARM_UP as WARM_UP,
    SplineTrajectory as SplineTrajectory,
    TravelledStates as TravelledStates,
    cart_trajectory as cart_trajectory,
    drive_along as drive_along,
    pose_motion as pose_motion,
    simulate_drive as simulate_drive,
    warming as warming,
)
from .two_axis import FixtureErrors as FixtureErrors
