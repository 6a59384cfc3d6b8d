from .alignment import Alignment as Alignment, align_coarse as align_coarse, find_rest as find_rest
from .drive import (
    Drive as Drive,
    prepare_drive as prepare_drive,
    sharpen_clock as sharpen_clock,
    wide_setup as wide_setup,
)
from .filter.kernels import apply_errors as apply_errors
from .filter.run import (
    LONGEST_BRIDGED as LONGEST_BRIDGED,
    FilterRun as FilterRun,
    run_filter as run_filter,
    smooth as smooth,
    unpacked as unpacked,
)
from .filter.setup import (
    FilterSetup as FilterSetup,
    SensorState as SensorState,
    TriadSpread as TriadSpread,
    covariance_from_calibration as covariance_from_calibration,
    plan_filter as plan_filter,
)
from .gnss.reading import read_track as read_track
from .gnss.track import GnssTrack as GnssTrack, fit_velocities as fit_velocities, make_track as make_track
from .mechanisation import navigate as navigate
from .outages import (
    FreeDrift as FreeDrift,
    OutageErrors as OutageErrors,
    Statistic as Statistic,
    free_drift as free_drift,
    outages as outages,
    ratio_of as ratio_of,
    rms_of as rms_of,
)
from .prediction import (
    PredictedErrors as PredictedErrors,
    StateAdvice as StateAdvice,
    predict_errors as predict_errors,
)
from .samples import InertialSamples as InertialSamples
from .time_alignment import (
    TimeAlignment as TimeAlignment,
    spans_in_words as spans_in_words,
    track_velocities as track_velocities,
)
from .trajectory import (
    NavigationState as NavigationState,
    Trajectory as Trajectory,
    position_differences as position_differences,
)
