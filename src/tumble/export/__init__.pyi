from .noise import SensorNoise as SensorNoise, TriadNoise as TriadNoise, read_noise as read_noise
from .readers import check_plausible as check_plausible, read_file as read_file, read_imu_tk as read_imu_tk
from .subject import Subject as Subject, Wishes as Wishes, prepare as prepare
from .target import (
    G_SENSITIVITY as G_SENSITIVITY,
    MAGNETOMETER as MAGNETOMETER,
    MATRIX as MATRIX,
    NOISE as NOISE,
    READ as READ,
    SCALE as SCALE,
    Target as Target,
    find_target as find_target,
    targets as targets,
)
