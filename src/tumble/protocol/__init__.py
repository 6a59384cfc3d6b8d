"""Protocols: what is done to a unit in a test, step by step, as data that a file can hold.

The room is low in the house: simulation plays a protocol, segmentation matches a recording with it,
calibration interprets it, and none of them knows the others.
"""

from tumble.protocol.file import protocol_schema, protocol_to_yaml, read_protocol, write_protocol
from tumble.protocol.library import PROTOCOLS, named_protocol
from tumble.protocol.steps import HoldStep, Pose, Protocol, RampStep, SoakStep, SpinStep, Step, TurnStep
from tumble.protocol.strapdown_rotation import SequenceSteps, sequence_steps

__all__ = [
    "PROTOCOLS",
    "HoldStep",
    "Pose",
    "Protocol",
    "RampStep",
    "SequenceSteps",
    "SoakStep",
    "SpinStep",
    "Step",
    "TurnStep",
    "named_protocol",
    "protocol_schema",
    "protocol_to_yaml",
    "read_protocol",
    "sequence_steps",
    "write_protocol",
]
