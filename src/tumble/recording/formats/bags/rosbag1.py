"""ROS 1 bags (version 2.0), read by the library rosbags, without ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import field
from pathlib import Path
from typing import Any

from tumble.recording.formats.bags.bag import Topic, bag_reader, plain_type
from tumble.recording.formats.packed import needed
from tumble.recording.formats.table import foreign
from tumble.recording.samples import Remark
from tumble.records import dataclass

_NAME = "ROS 1 bag"


def library(path: Path) -> Any:
    """Return the library that reads and writes a bag.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    return needed("rosbags.rosbag1", f"{path.name} is a {_NAME}")


@dataclass(slots=True)
class Rosbag1:
    """An opened bag.

    Attributes
    ----------
    path, reader : the file, and the library's reader of it.
    topics : what it holds.
    compression : of its first chunk, "bz2" or "lz4"; None without.
    remarks : none, for a bag that is not whole is refused.
    """

    path: Path
    reader: Any
    topics: list[Topic] = field(default_factory=list[Topic])
    compression: str | None = None
    remarks: list[Remark] = field(default_factory=list[Remark])

    def __post_init__(self) -> None:
        counts: Counter[tuple[str, str]] = Counter()
        for connection in self.reader.connections:
            counts[connection.topic, plain_type(connection.msgtype)] += connection.msgcount
        span = 1e-9 * (self.reader.duration - 1)
        for (name, kind), count in counts.items():
            rate = (count - 1) / span if span > 0.0 and count > 1 else None
            self.topics.append(Topic(name, kind, count, cdr=False, rate=rate))
        known = {d: n for n, d in needed("rosbags.rosbag1.reader", "").decompressors.items()}
        packed = (known[chunk.decompressor] for chunk in self.reader.chunks.values())
        self.compression = next((name for name in packed if name != "none"), None)

    def messages(self, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        wanted = set(names)
        chosen = [c for c in self.reader.connections if c.topic in wanted]
        if chosen:
            with self.damage_as_sentence():
                for connection, time, data in self.reader.messages(chosen):
                    yield connection.topic, time, data

    def damage_as_sentence(self) -> AbstractContextManager[None]:
        """Turn what the library makes of a damaged file into a sentence."""
        return foreign(self.path, _NAME, _mend(self.path))


def _mend(path: Path) -> str:
    return f"If it was cut short or not closed, repair it first: rosbag reindex {path.name}"


@contextmanager
def opened_bag(path: Path) -> Generator[Rosbag1]:
    """Open a bag.

    Raises
    ------
    RecordingError
        If it is cut short, was not closed, or is damaged.
    UsageError
        If a library is missing.
    OSError
        If the file cannot be read.
    """
    made = library(path)
    with foreign(path, _NAME, _mend(path)):
        reader = made.Reader(path)
        reader.open()
        bag = Rosbag1(path, reader)
    try:
        yield bag
    finally:
        reader.close()


read_tables = bag_reader(opened_bag)
