"""The magnetometer of a bag: which topic it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tumble.recording.columns import kind_of_file
from tumble.recording.formats.bags.ros_messages import FIELD, READABLE
from tumble.recording.recording import Remark

if TYPE_CHECKING:
    from tumble.recording.formats.bags.bag import Bag, Topic


def is_field_topic(topic: Topic) -> bool:
    """Say whether a topic is a magnetometer's: by its type, or a vector's by its name."""
    if topic.kind == FIELD:
        return True
    return topic.kind == READABLE[1] and kind_of_file(topic.name) == "m"


def spellings(name: str) -> tuple[str, str, str]:
    """Return a topic's name as it is, with a slash before it, and without."""
    return name, "/" + name.strip("/"), name.strip("/")


def split_wanted(bag: Bag, wanted: Sequence[str]) -> tuple[list[str], str | None, list[Remark]]:
    """Return the wanted topics without the magnetometer's, the magnetometer's topic or None, and what is said of it.

    Parameters
    ----------
    bag : opened.
    wanted : names of topics; without a magnetometer's among them the first one that the bag holds is read.
    """
    fields = {t.name: t for t in bag.topics if is_field_topic(t)}
    named = [name for one in wanted for name in spellings(one) if name in fields]
    rest = [one for one in wanted if not {*spellings(one)} & {*fields}]
    known = [t.name for t in fields.values() if t.count != 0]
    if not named and not known:
        return rest, None, []
    chosen = (named or known)[0]
    text = f"{bag.path.name}: {chosen} is read as the magnetometer"
    others = [name for name in known if name != chosen]
    more = f"; {', '.join(others)} could be read with --topic" if others and not named else ""
    return rest, chosen, [Remark("found", f"{text}{more}.")]
