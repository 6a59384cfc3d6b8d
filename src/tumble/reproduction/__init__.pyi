from .items import Item as Item, all_items as all_items, find_items as find_items, run_item as run_item
from .outcome import (
    INSIDE as INSIDE,
    OUTSIDE as OUTSIDE,
    UNJUDGED as UNJUDGED,
    Curve as Curve,
    Marks as Marks,
    Outcome as Outcome,
    Plot as Plot,
    Row as Row,
    Value as Value,
)
