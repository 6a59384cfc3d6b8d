from .conventions.savage import (
    GROUPS as GROUPS,
    NAMES as NAMES,
    OFF_DIAGONAL as OFF_DIAGONAL,
    PAIRS as PAIRS,
    SavageErrors as SavageErrors,
    savage_from_model as savage_from_model,
)
from .conventions.shin import (
    matrix_from_shin as matrix_from_shin,
    shin_derivatives as shin_derivatives,
    shin_from_matrix as shin_from_matrix,
)
from .conventions.zhang import (
    inter_triad_angles as inter_triad_angles,
    inter_triad_rotation as inter_triad_rotation,
    matrix_from_zhang as matrix_from_zhang,
)
from .gauge import (
    FRAMES as FRAMES,
    Function as Function,
    change_frame as change_frame,
    frame_rotation as frame_rotation,
    inverse as inverse,
    jacobian as jacobian,
    lower_factor as lower_factor,
    polar_rotation as polar_rotation,
    propagate as propagate,
    upper_factor as upper_factor,
)
from .imu import CURVES as CURVES, Curve as Curve, ImuModel as ImuModel, Triad as Triad
from .thermal import (
    KINDS as KINDS,
    SHAPES as SHAPES,
    SPAN_MARGIN as SPAN_MARGIN,
    Outside as Outside,
    TemperatureBasis as TemperatureBasis,
    TemperaturePath as TemperaturePath,
    ThermalModel as ThermalModel,
    ThermalState as ThermalState,
    follow_temperature as follow_temperature,
)
