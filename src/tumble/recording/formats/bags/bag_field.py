"""The magnetometer of a bag: which topic it is, and its messages as samples beside the table of the IMU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tumble.errors import RecordingError
from tumble.recording.columns import kind_of_file
from tumble.recording.formats.bags.ros_messages import FIELD, READABLE, decode
from tumble.recording.formats.table import FieldStream
from tumble.recording.recording import Remark

if TYPE_CHECKING:
    from tumble.recording.formats.bags.bag import Bag, Topic

_BATCH = 4096
_TESLA = "T"


def is_field_topic(topic: Topic) -> bool:
    """Say whether a topic is a magnetometer's: by its type, or a vector's by its name."""
    if topic.kind == FIELD:
        return True
    return topic.kind == READABLE[1] and kind_of_file(topic.name.replace("_", " ").replace("/", " ")) == "m"


def split_wanted(bag: Bag, wanted: Sequence[str]) -> tuple[list[str], str | None, list[Remark]]:
    """Return the wanted topics without the magnetometer's, the magnetometer's topic or None, and what is said of it.

    Parameters
    ----------
    bag : opened.
    wanted : names of topics; without a magnetometer's among them the first one that the bag holds is read.
    """
    fields = {t.name: t for t in bag.topics if is_field_topic(t)}
    named = [name for one in wanted for name in (one, "/" + one.strip("/"), one.strip("/")) if name in fields]
    rest = [one for one in wanted if not {one, "/" + one.strip("/"), one.strip("/")} & set(fields)]
    known = [t.name for t in fields.values() if t.count != 0]
    if not named and not known:
        return rest, None, []
    chosen = (named or known)[0]
    text = f"{bag.path.name}: {chosen} is read as the magnetometer"
    others = [name for name in known if name != chosen]
    more = f"; {', '.join(others)} could be read with --topic" if others and not named else ""
    return rest, chosen, [Remark("found", f"{text}{more}.")]


def read_field(bag: Bag, name: str) -> FieldStream | None:
    """Return the messages of a magnetometer's topic as samples in time order, None if there are none.

    Parameters
    ----------
    bag, name : opened; the topic.

    Raises
    ------
    RecordingError
        If a message is too short for its type.
    """
    topic = next(t for t in bag.topics if t.name == name)
    times: list[np.ndarray] = []
    values: list[np.ndarray] = []
    waiting: list[bytes] = []
    stamps: list[int] = []

    def drain() -> None:
        if waiting:
            decoded = decode(topic.kind, waiting, stamps, name, cdr=topic.cdr)
            times.append(decoded.time)
            values.append(decoded.force)
            waiting.clear()
            stamps.clear()

    for _, time, data in bag.messages([name]):
        waiting.append(data)
        stamps.append(time)
        if len(waiting) >= _BATCH:
            drain()
    drain()
    if not times:
        return None
    time, field = np.concatenate(times), np.concatenate(values)
    good = np.isfinite(field).all(axis=1)
    time, field = time[good], field[good]
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        row = int(back[0])
        raise RecordingError(
            f"{bag.path.name}: the stamps of {name} step back from {time[row]:.6f} s to {time[row + 1]:.6f} s; "
            "cut the recording there, for the order of its samples is unknown."
        )
    note = "" if topic.kind == FIELD else "has no unit in its type (--units uT)"
    return FieldStream(name, time, field, _TESLA if topic.kind == FIELD else None, note)
