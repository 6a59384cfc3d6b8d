from .coach import BELLS as BELLS, Event as Event
from .guide import groups_of as groups_of, read_targets as read_targets
from .machine import Capture as Capture
from .run import (
    CaptureOrder as CaptureOrder,
    CaptureRun as CaptureRun,
    Listener as Listener,
    require_hold as require_hold,
    run_capture as run_capture,
)
from .source import SourceOptions as SourceOptions, find_source as find_source, known_sources as known_sources
from .sources.serial import found_ports as found_ports
