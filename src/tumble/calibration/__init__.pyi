from .checks.scores import (
    hold_norm_errors as hold_norm_errors,
    hold_norm_variances as hold_norm_variances,
    score_turns as score_turns,
)
from .checks.suspicions import hidden_jumps as hidden_jumps
from .checks.unseen import (
    state_gravity as state_gravity,
    state_rounding as state_rounding,
    state_unseen as state_unseen,
    state_unseen_clock as state_unseen_clock,
    unseen_table as unseen_table,
)
from .equations.adjustment import (
    JointAdjustment as JointAdjustment,
    RecordingStretch as RecordingStretch,
    SectionStretch as SectionStretch,
    balance_recording as balance_recording,
    still_sway as still_sway,
)
from .equations.gathering import gather as gather
from .equations.holds_and_turns import HoldsAndTurns as HoldsAndTurns, window_directions as window_directions
from .equations.imu_unknowns import (
    LAYOUT as LAYOUT,
    PLAIN as PLAIN,
    gyro_matrix as gyro_matrix,
    imu_unknowns as imu_unknowns,
    name_plate as name_plate,
    terms_prior as terms_prior,
    unknowns_of as unknowns_of,
)
from .equations.observed import (
    Observed as Observed,
    TableRotation as TableRotation,
    observe as observe,
    table_rotation as table_rotation,
)
from .equations.reference_equations import Heading as Heading
from .equations.rotation_equations import LEAST_WOBBLE as LEAST_WOBBLE
from .equations.triad_unknowns import (
    ANGLE as ANGLE,
    BIAS as BIAS,
    COUNT as COUNT,
    SCALE as SCALE,
    NormConditions as NormConditions,
    rough_triad as rough_triad,
    triad_from_unknowns as triad_from_unknowns,
    unknowns_from_triad as unknowns_from_triad,
)
from .equations.turn_equations import Link as Link, Turn as Turn
from .estimate import (
    Beside as Beside,
    Described as Described,
    Estimate as Estimate,
    Figures as Figures,
    NamedValue as NamedValue,
    OverTemperature as OverTemperature,
    Said as Said,
    TermTest as TermTest,
    correlation_matrix as correlation_matrix,
    coverage_factor as coverage_factor,
)
from .evidence import (
    BiasCurve as BiasCurve,
    Budget as Budget,
    Detectable as Detectable,
    Evidence as Evidence,
    GlobalTest as GlobalTest,
    Holds as Holds,
    ModelChoice as ModelChoice,
    Spins as Spins,
    ThermalCurves as ThermalCurves,
    TurnOns as TurnOns,
    Turns as Turns,
    UncertaintyStatement as UncertaintyStatement,
)
from .free_inertial import (
    LONGEST as LONGEST,
    CalibratedUnit as CalibratedUnit,
    nominal_errors as nominal_errors,
    position_from as position_from,
    sheet_unit as sheet_unit,
    triad_errors as triad_errors,
)
from .joint import (
    CLOCK_TOLD as CLOCK_TOLD,
    begin as begin,
    calibrate as calibrate,
    calibrate_accelerometers as calibrate_accelerometers,
    check_prior as check_prior,
)
from .magnetometer.estimate import (
    GIVEN_SIGMA as GIVEN_SIGMA,
    NAMES as NAMES,
    GivenField as GivenField,
    Magnetometer as Magnetometer,
    magnetometer_alone as magnetometer_alone,
    magnetometer_of as magnetometer_of,
    named_parameters as named_parameters,
    nearest_axes as nearest_axes,
)
from .magnetometer.verdict import FieldVerdict as FieldVerdict, judge_magnetometer as judge_magnetometer
from .mount import (
    MountAlignment as MountAlignment,
    align_to_mount as align_to_mount,
    check_poses as check_poses,
    mean_covariances as mean_covariances,
)
from .objections import (
    find_missing as find_missing,
    of_other_rests as of_other_rests,
    say_of_recording as say_of_recording,
    say_of_sheets as say_of_sheets,
    say_of_turns as say_of_turns,
)
from .optional_terms import unknowns_with as unknowns_with
from .outcome.budget import draw_distributions as draw_distributions
from .outcome.description import (
    canonical_names as canonical_names,
    describe as describe,
    gravity_slope as gravity_slope,
    named_function as named_function,
)
from .outcome.settled import JointOutcome as JointOutcome, recording_influences as recording_influences
from .poses import (
    SAME_POSE as SAME_POSE,
    describe_direction as describe_direction,
    describe_mending as describe_mending,
    describe_untold as describe_untold,
    distinct_poses as distinct_poses,
    match_faces as match_faces,
    missing_poses as missing_poses,
    most_telling_poses as most_telling_poses,
    norm_rows as norm_rows,
)
from .prior import (
    FleetSheet as FleetSheet,
    StableKnowledge as StableKnowledge,
    TriadFleet as TriadFleet,
    stable_knowledge as stable_knowledge,
    together as together,
    triad_sheets as triad_sheets,
)
from .session import (
    FIRST_TRIED as FIRST_TRIED,
    PROCEDURES as PROCEDURES,
    Estimator as Estimator,
    Options as Options,
    Procedure as Procedure,
    Session as Session,
    find_procedure as find_procedure,
)
from .start import start_adjustment as start_adjustment
from .terms import TERMS as TERMS, LeverArms as LeverArms
from .thermal.coverage import require_time_base as require_time_base
from .turn_ons.adjustment import adjust_several as adjust_several, find_strangers as find_strangers
from .turn_ons.estimate import SeveralEstimate as SeveralEstimate, several_estimate as several_estimate
from .verdict import Judgement as Judgement, judge as judge
