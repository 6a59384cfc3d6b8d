from .drift import (
    FEWEST_RATES as FEWEST_RATES,
    YEAR as YEAR,
    Drift as Drift,
    due_after as due_after,
    ewma_chart as ewma_chart,
    find_drift as find_drift,
)
from .fleet_document import (
    ACCELEROMETER as ACCELEROMETER,
    GYRO as GYRO,
    PROCEDURE as PROCEDURE,
    Batch as Batch,
    Between as Between,
    UnitOutcome as UnitOutcome,
    fleet_document as fleet_document,
)
from .outlying import (
    FALSE_ALARM as FALSE_ALARM,
    find_outlying as find_outlying,
    find_shared as find_shared,
    loud_or_dead as loud_or_dead,
)
from .unit_vector import UnitVector as UnitVector, stack as stack, unit_vector as unit_vector
