from .formulas import FORMULAS as FORMULAS
from .section_9 import SECTION_9 as SECTION_9
from .strapdown_simulation import (
    GRADES as GRADES,
    START_NORM as START_NORM,
    Setting as Setting,
    run_study as run_study,
    simulate_run as simulate_run,
)
