from .chapter_4 import CHAPTER_4 as CHAPTER_4
from .field_campaign import POSITIONS as POSITIONS
from .norm import adjust_norm as adjust_norm
from .norm_batch import (
    adjust_norms as adjust_norms,
    run_setting as run_setting,
    simulate_means as simulate_means,
    table_setting as table_setting,
)
from .scenarios import SCENARIO_TABLES as SCENARIO_TABLES
