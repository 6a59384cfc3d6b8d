from .hold_noise import wander_sigma as wander_sigma, white_density as white_density
from .joint_information import (
    NAMES as NAMES,
    PARAMETER_GROUPS as PARAMETER_GROUPS,
    PARAMETERS as PARAMETERS,
    SESSION as SESSION,
    TOLD as TOLD,
    JointInformation as JointInformation,
    observed_problem as observed_problem,
    parameter_sizes as parameter_sizes,
    parameters_of as parameters_of,
    sizes_of_sheet as sizes_of_sheet,
)
from .joint_plan import (
    Foretold as Foretold,
    JointPlan as JointPlan,
    PlanTask as PlanTask,
    StepWorth as StepWorth,
    find_step_worths as find_step_worths,
    plan_protocol as plan_protocol,
)
from .next_step import (
    WORTH as WORTH,
    Aim as Aim,
    NextStep as NextStep,
    StepCandidate as StepCandidate,
    find_next_steps as find_next_steps,
    judge_stop as judge_stop,
    led_holds as led_holds,
    step_candidates as step_candidates,
    turn_candidates as turn_candidates,
    usual_pose as usual_pose,
    what_would_tell as what_would_tell,
)
from .planned_motion import PlannedNoise as PlannedNoise
from .pose_plan import (
    NORM_GROUPS as NORM_GROUPS,
    PosePlan as PosePlan,
    PoseTask as PoseTask,
    best_order as best_order,
    known_norms as known_norms,
    plan_of as plan_of,
    plan_poses as plan_poses,
    plan_schemes as plan_schemes,
    plan_time as plan_time,
    pose_rows as pose_rows,
)
