from .drift import (
    FEWEST_RATES as FEWEST_RATES,
    YEAR as YEAR,
    Drift as Drift,
    due_after as due_after,
    ewma_chart as ewma_chart,
    find_drift as find_drift,
)
from .fleet_document import PROCEDURE as PROCEDURE, Between as Between, fleet_document as fleet_document
from .outcome import ACCELEROMETER as ACCELEROMETER, GYRO as GYRO, Batch as Batch, UnitOutcome as UnitOutcome
from .outlying import (
    FALSE_ALARM as FALSE_ALARM,
    find_outlying as find_outlying,
    find_shared as find_shared,
    loud_or_dead as loud_or_dead,
)
from .unit_vector import UnitVector as UnitVector, stack as stack, unit_vector as unit_vector
