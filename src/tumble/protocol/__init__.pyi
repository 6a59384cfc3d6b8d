from .consistency import (
    SAME_POSE as SAME_POSE,
    nearest_heading as nearest_heading,
    refuse_contradicting_turns as refuse_contradicting_turns,
    refuse_contradiction as refuse_contradiction,
)
from .file import (
    protocol_schema as protocol_schema,
    protocol_to_yaml as protocol_to_yaml,
    read_protocol as read_protocol,
    write_protocol as write_protocol,
)
from .library import (
    BY_HAND as BY_HAND,
    NINE as NINE,
    PROTOCOLS as PROTOCOLS,
    REST as REST,
    named_protocol as named_protocol,
    rest_protocol as rest_protocol,
)
from .steps import (
    UP_N as UP_N,
    HoldStep as HoldStep,
    Pose as Pose,
    Protocol as Protocol,
    RampStep as RampStep,
    SoakStep as SoakStep,
    SpinStep as SpinStep,
    Step as Step,
    TurnStep as TurnStep,
)
from .strapdown_rotation import (
    AXES as AXES,
    SEQUENCES as SEQUENCES,
    RotationSequence as RotationSequence,
    SequenceSteps as SequenceSteps,
    fixture_rotation as fixture_rotation,
    sequence_steps as sequence_steps,
    start_down as start_down,
)
