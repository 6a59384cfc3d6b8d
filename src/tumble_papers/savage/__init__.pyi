from .formulas import FORMULAS as FORMULAS
from .section_9 import SECTION_9 as SECTION_9
from .sequences import sequence_model as sequence_model, solve_measurements as solve_measurements
from .strapdown_simulation import (
    AS_PRINTED as AS_PRINTED,
    EXACT as EXACT,
    GRADES as GRADES,
    START_NORM as START_NORM,
    UNITS_SI as UNITS_SI,
    VARIANTS as VARIANTS,
    Setting as Setting,
    group_rms as group_rms,
    run_study as run_study,
    simulate_run as simulate_run,
)
