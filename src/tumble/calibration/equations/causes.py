"""The causes of error that a budget tells apart, in the order in which it shows them."""

from tumble.estimation import BENT, OUTLYING, PRIOR

FORCE_REST = "accelerometers at rest"
FORCE_TURNING = "accelerometers while turning"
FORCE_WANDER = "accelerometer biases wander"
FORCE_COURSE = "accelerometer biases that jump or drift"
RATE_COURSE = "gyro biases that jump or drift"
RATE_REST = "gyros at rest"
RATE_TURNING = "gyros while turning"
RATE_WANDER = "gyro biases wander"
SWAY = "sway in holds"
TURNS = "turns beyond noise"
ANGLES = "table angles"
AXIS = "wobble of the table's axis"
PLACEMENT = "placement"
LEVER = "lever arms of rotations"
EARTH_RATE_KNOWN = "Earth rate and latitude"
GRAVITY = "reference gravity"
SAMPLE_RATE = "sample rate"
TABLE_RATE = "rate of the table"
OTHER = "everything else"
COURSES = {FORCE_WANDER: FORCE_COURSE, RATE_WANDER: RATE_COURSE}
SOURCES = (
    *(
        FORCE_REST,
        FORCE_TURNING,
        FORCE_WANDER,
        FORCE_COURSE,
        RATE_REST,
        RATE_TURNING,
        RATE_WANDER,
        RATE_COURSE,
        SWAY,
        TURNS,
        ANGLES,
    ),
    *(AXIS, PLACEMENT),
    *(LEVER, EARTH_RATE_KNOWN, PRIOR, OUTLYING, BENT, GRAVITY, SAMPLE_RATE, TABLE_RATE, OTHER),
)
