from .preparing import prepare as prepare
from .readers import check_plausible as check_plausible, read_file as read_file, read_imu_tk as read_imu_tk
from .subject import (
    SensorNoise as SensorNoise,
    Subject as Subject,
    TriadNoise as TriadNoise,
    Wishes as Wishes,
    read_noise as read_noise,
)
from .target import Target as Target, find_target as find_target, targets as targets
