"""A bag of any kind, opened to be written anew: what is in it, in the order of its files, and how it is copied."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from tumble.errors import RecordingError, UsageError
from tumble.recording.formats import find_format
from tumble.recording.formats.bags import mcap as mcap_format
from tumble.recording.formats.bags import rosbag1 as rosbag1_format
from tumble.recording.formats.bags import rosbag2 as rosbag2_format
from tumble.recording.formats.bags.bag import Bag
from tumble.recording.formats.bags.mcap import McapFile
from tumble.recording.formats.bags.rosbag1 import RosbagFile
from tumble.recording.formats.bags.rosbag2 import Chain, Database, opened_bag
from tumble.recording.rewriting import mcap, rosbag1, rosbag2
from tumble.recording.rewriting.exchange import Exchange
from tumble.records import dataclass

Messages = Iterator[tuple[str, int, bytes]]

ENDINGS = (".bag", ".mcap", ".db3")
"""Of files of bags; a ROS 2 bag is also a folder."""
_KINDS: tuple[tuple[ModuleType, str, ModuleType], ...] = (
    (rosbag1_format, ".bag", rosbag1),
    (mcap_format, ".mcap", mcap),
    (rosbag2_format, ".db3", rosbag2),
)


@dataclass(frozen=True, slots=True)
class Rewritable:
    """An opened bag.

    Attributes
    ----------
    bag : its topics and remarks.
    in_order : yields the messages of some topics as they stand in its files.
    write : writes it anew to a file, or into a folder that is there.
    """

    bag: Bag
    in_order: Callable[[Iterable[str]], Messages]
    write: Callable[[Path, Exchange], None]


def ending_of(path: Path) -> str | None:
    """Return the ending that a copy of a bag has, "" of one that is a folder; None of what is no bag.

    Parameters
    ----------
    path : of a recording.
    """
    try:
        format_ = find_format(path)
    except RecordingError:
        return None
    ending = next((ending for kind, ending, _ in _KINDS if kind is format_), None)
    return "" if ending is not None and path.is_dir() else ending


def corrections(path: Path) -> dict[str, tuple[str, ...]]:
    """Return which calibrations the topics of a bag were corrected by; of what is no bag, or is unreadable, none.

    Parameters
    ----------
    path : of a recording.
    """
    try:
        format_ = find_format(path)
        for kind, _, written in _KINDS:
            if kind is format_:
                found: dict[str, tuple[str, ...]] = written.corrections(path)
                return found
    except (RecordingError, UsageError, OSError):
        pass  # reading it says what is wrong
    return {}


@contextmanager
def rewritable(path: Path) -> Generator[Rewritable]:
    """Open a bag to be written anew.

    Parameters
    ----------
    path : of a bag.

    Raises
    ------
    RecordingError
        If it is damaged.
    UsageError
        If a library is missing.
    OSError
        If it cannot be read.
    """
    ending = ending_of(path)
    if ending == ".bag":
        bag = RosbagFile(path)
        yield Rewritable(bag, bag.messages, lambda target, put: rosbag1.rewrite(path, target, put))
    elif ending == ".mcap":
        file = McapFile(path)
        yield Rewritable(file, file.messages_in_order, lambda target, put: mcap.rewrite(path, target, put))
    else:
        with opened_bag(path) as parts:
            yield _of_parts(parts)


def _of_parts(parts: Database | Chain) -> Rewritable:
    if isinstance(parts, Database):
        return Rewritable(
            parts, parts.messages, lambda target, put: rosbag2.rewrite_database(parts, target, put)
        )

    def in_order(names: Iterable[str]) -> Messages:
        wanted = list(names)
        for part in parts.parts:
            in_file = part.messages_in_order if isinstance(part, McapFile) else part.messages
            yield from in_file(wanted)

    return Rewritable(parts, in_order, lambda target, put: rosbag2.rewrite_folder(parts, target, put))
