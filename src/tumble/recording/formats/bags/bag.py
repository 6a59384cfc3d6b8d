"""What bags have in common, whatever file they are in: topics, the choice among them, messages as a table.

What ROS messages of inertial sensors look like, serialised by ROS 1 or as CDR by ROS 2.

Layouts are those of the message definitions `sensor_msgs/Imu`, `sensor_msgs/MagneticField`,
`geometry_msgs/Vector3Stamped` and `std_msgs/Header`: their numbers have fixed places after the frame's name, so that
messages of one length are decoded together. A stamp is the header's, or the recorder's where the header has none.

References
----------
ROS common_interfaces, message definitions; OMG, *DDS-XTypes 1.3*, section 7.4 (CDR).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from itertools import islice
from pathlib import Path
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series, Vectors
from tumble.counting import counted
from tumble.errors import RecordingError, UsageError
from tumble.recording.columns import kind_of_file
from tumble.recording.formats.streams import SI, Merging, refuse_backwards, table_of_samples
from tumble.recording.formats.table import BLOCK_ROWS, RawTable
from tumble.recording.samples import MagneticField, Remark, Samples, joined
from tumble.records import dataclass

_IMU = "sensor_msgs/Imu"
_VECTOR = "geometry_msgs/Vector3Stamped"
# Numbers of float64 after the header, and where the triads begin among them.
FIELD = "sensor_msgs/MagneticField"
"""The type of a magnetometer's messages: a vector in T, and its covariance."""
_LAYOUTS = {_IMU: (37, 25, 13), _VECTOR: (3, 0, 0), FIELD: (12, 0, 0)}
READABLE = (_IMU, _VECTOR)
"""The types of message that are read as accelerometer and gyro."""


def plain_type(name: str) -> str:
    """Return a type's name as ROS 1 writes it.

    Examples
    --------
    >>> plain_type("sensor_msgs/msg/Imu")
    'sensor_msgs/Imu'
    """
    return name.replace("/msg/", "/").replace("::msg::dds_::", "/").rstrip("_")


@dataclass(frozen=True)
class Decoded:
    """Messages of one topic as arrays.

    Attributes
    ----------
    time : (n,) seconds, of the header or of the recorder.
    force, rate : (n, 3), or None.
    unstamped : whether the headers have no time.
    """

    time: Series
    force: Vectors
    rate: Vectors
    unstamped: bool


Message: TypeAlias = tuple[str, int, bytes]
"""Topic, time of recording in ns, and bytes."""


def decode(topic: Topic, batch: Sequence[Message]) -> Decoded:
    """Decode messages of one topic.

    Raises
    ------
    RecordingError
        If a message is too short to be of that type.
    """
    size, force, rate = _LAYOUTS[topic.kind]
    numbers, stamps, size = np.empty((len(batch), size)), np.empty((len(batch), 2)), 8 * size
    for index, rows, begin, order in _alike([data for _, _, data in batch], cdr=topic.cdr):
        length = rows.shape[1]
        if length < 16 or begin + size > length:
            raise RecordingError(
                f"A message of {topic.name} has {length} bytes, too few for {topic.kind}, which the file says that it "
                "is. The file is damaged, or the topic was recorded with another definition of the type."
            )
        numbers[index] = rows[:, begin : begin + size].copy().view(order + "f8")
        stamps[index] = rows[:, 4:12].copy().view(order + "u4")
    unstamped = not stamps.any()
    if unstamped:
        logged = np.array([time for _, time, _ in batch], np.int64)
        stamps = np.column_stack(np.divmod(logged, 1_000_000_000)).astype(np.float64)
    # Seconds and the rest apart: nanoseconds since 1970 have more digits than a float64 holds.
    return Decoded(
        stamps[:, 0] + stamps[:, 1] / 1e9,
        numbers[:, force : force + 3],
        numbers[:, rate : rate + 3],
        unstamped,
    )


def _alike(
    messages: list[bytes], *, cdr: bool
) -> Iterator[tuple[list[int], npt.NDArray[np.uint8], int, str]]:
    """Yield messages whose numbers have the same places: which, their bytes, where the numbers begin, order of bytes.

    They are of one length with a frame's name of one length; after four bytes, the encapsulation of CDR or the sequence
    number of ROS 1, comes the stamp. The numbers stand after the frame's name, with CDR at a multiple of eight.
    """
    alike: dict[tuple[int, bytes, bytes], list[int]] = {}
    for number, message in enumerate(messages):
        alike.setdefault((len(message), message[1:2] if cdr else b"", message[12:16]), []).append(number)
    for (length, encoding, name), numbers in alike.items():
        order = ">" if encoding and encoding[0] % 2 == 0 else "<"
        begin = 16 + int.from_bytes(name, "big" if order == ">" else "little")
        rows = np.frombuffer(b"".join(messages[i] for i in numbers), np.uint8).reshape(len(numbers), length)
        yield numbers, rows, 4 + (begin - 4 + 7) // 8 * 8 if cdr else begin, order


def substituted(
    topic: Topic, messages: list[bytes], force: Vectors | None, rate: Vectors | None, shift: int
) -> list[bytes]:
    """Return messages with other numbers in them; every other byte stays.

    Parameters
    ----------
    topic, messages : that `decode` has read.
    force, rate : (messages, 3) m/s² and rad/s; None leaves what is there.
    shift : ns that stamps of headers are moved by; those of zero, which are none, stay.
    """
    _, *places = _LAYOUTS[topic.kind]
    made: list[bytes] = [b""] * len(messages)
    for numbers, seen, begin, order in _alike(messages, cdr=topic.cdr):
        rows = seen.copy()
        for place, values in zip(places, (force, rate), strict=True):
            if values is not None:
                packed = np.ascontiguousarray(values[numbers], dtype=order + "f8").view(np.uint8)
                rows[:, begin + 8 * place :][:, : packed.shape[1]] = packed
        if shift:
            rows[:, 4:12] = _moved(rows[:, 4:12], shift, order)
        for row, number in enumerate(numbers):
            made[number] = rows[row].tobytes()
    return made


def _moved(stamps: npt.NDArray[np.uint8], shift: int, order: str) -> npt.NDArray[np.uint8]:
    """Return stamps of seconds and nanoseconds (n, 8 bytes), moved; none before 1970."""
    parts = stamps.copy().view(order + "u4").astype(np.int64)
    total = parts[:, 0] * 1_000_000_000 + parts[:, 1]
    moved = np.where(total > 0, np.maximum(total + shift, 0), 0)
    both = np.column_stack(np.divmod(moved, 1_000_000_000))
    return np.ascontiguousarray(both, dtype=order + "u4").view(np.uint8)


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


_PEEKED = 16  # messages of each topic that show which triads it has
_MOST_PEEKED = 200_000
_BATCH = 4096  # messages that are decoded together
_LISTED = 12


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes
    ----------
    name, kind : its name, and the type of its messages as ROS 1 writes it.
    count : number of its messages.
    cdr : whether the messages are serialised as CDR (ROS 2).
    span : ns from the first to the last of them; 0 where it is not known.
    """

    name: str
    kind: str
    count: int
    cdr: bool
    span: int = 0

    def words(self) -> str:
        """Return name, type, count and rate in words."""
        rate = f", {1e9 * (self.count - 1) / self.span:.4g} Hz" if self.count > 1 and self.span > 0 else ""
        return f"{self.name} ({self.kind}, {self.count} messages{rate})"


@runtime_checkable
class Bag(Protocol):
    """A file of messages with topics."""

    @property
    def path(self) -> Path:
        """The file, or the folder."""
        ...

    @property
    def topics(self) -> list[Topic]:
        """What it holds."""
        ...

    @property
    def remarks(self) -> list[Remark]:
        """What was noticed, left out or mended so far."""
        ...

    def messages(self, names: Iterable[str]) -> Iterator[Message]:
        """Yield topic, time of recording in ns, and bytes of the messages of some topics."""
        ...


@dataclass(frozen=True)
class Choice:
    """Which topics are read: of the accelerometer, of the gyro; the same, or one of them None."""

    force: str | None
    rates: str | None

    def names(self) -> list[str]:
        """Return the topics' names, each once."""
        return list(dict.fromkeys(n for n in (self.force, self.rates) if n is not None))


def choose_topics(bag: Bag, wanted: Sequence[str]) -> Choice:
    """Return the topics that are read: the wanted ones, or those of the one IMU that the bag holds.

    Raises
    ------
    RecordingError
        If the bag holds no IMU, or several of which none was wanted.
    UsageError
        If a wanted topic is not there, or more than two are wanted.
    """
    known = {t.name: t for t in bag.topics}
    if all(t.count == 0 for t in bag.topics):
        raise RecordingError(
            f"{bag.path.name} holds no message that could be read: it is empty, cut short or damaged."
        )
    if wanted:
        names = [_named(known, name, bag.path.name) for name in wanted]
    else:
        imus = [t.name for t in bag.topics if t.kind == READABLE[0] and t.count != 0]
        vectors = [t.name for t in bag.topics if t.kind in READABLE and t.count != 0]
        names = imus or vectors
        if not names:
            raise RecordingError(
                f"{bag.path.name} holds no topic of sensor_msgs/Imu; it holds {_list_topics(bag.topics)}."
            )
    return _chosen(bag, known, names, asked=bool(wanted))


def _named(known: dict[str, Topic], name: str, file: str) -> str:
    for spelling in spellings(name):
        if spelling in known:
            if known[spelling].kind not in READABLE:
                raise RecordingError(
                    f"{file}: {spelling} is {known[spelling].kind}; read are {' and '.join(READABLE)}. "
                    f"The file holds {_list_topics(list(known.values()))}."
                )
            return spelling
    raise UsageError(
        f"--topic {name}: {file} has no such topic; it holds {_list_topics(list(known.values()))}."
    )


def _list_topics(topics: Sequence[Topic]) -> str:
    """Return the topics in words, those of IMUs first."""
    if not topics:
        return "no topic at all"
    ordered = sorted(topics, key=lambda t: (t.kind not in READABLE, t.name))
    more = f" and {len(ordered) - _LISTED} more" if len(ordered) > _LISTED else ""
    return ", ".join(t.words() for t in ordered[:_LISTED]) + more


def _chosen(bag: Bag, known: dict[str, Topic], names: list[str], *, asked: bool) -> Choice:
    """Find out which triads the topics hold, and which of them are one recording."""
    if len(names) > 2 and asked:
        raise UsageError(f"--topic names {len(names)} topics; give one, or one of each triad.")
    found = _peek(bag, known, names)
    full = [n for n, (force, rate) in found.items() if force and rate]
    forces = [n for n, (force, _) in found.items() if force]
    rates = [n for n, (_, rate) in found.items() if rate]
    lone_forces, lone_rates = [n for n in forces if n not in full], [n for n in rates if n not in full]
    if len(full) == 1 and not (asked and len(names) == 2):
        return Choice(full[0], full[0])
    if not full and len(lone_forces) <= 1 and len(lone_rates) <= 1 and (lone_forces or lone_rates):
        return Choice(next(iter(lone_forces), None), next(iter(lone_rates), None))
    if asked and len(names) == 2 and len(full) == 1 and (lone_forces or lone_rates):
        other = (lone_forces or lone_rates)[0]
        return Choice(other, full[0]) if lone_forces else Choice(full[0], other)
    if not found and bag.remarks:
        raise RecordingError(
            f"{bag.path.name} holds no message of {' or '.join(names)} that could be read: it is cut short or damaged."
        )
    if not found or not (forces or rates):
        raise RecordingError(
            f"{bag.path.name}: {' and '.join(names)} hold(s) no message with an acceleration or a rate; "
            f"the file holds {_list_topics(bag.topics)}."
        )
    several = ", ".join(known[n].words() for n in names)
    advice = "name one of them" if full else "name one accelerometer and one gyro"
    raise RecordingError(f"{bag.path.name} holds several sensors: {several}; {advice} with --topic.")


def _peek(bag: Bag, known: dict[str, Topic], names: list[str]) -> dict[str, tuple[bool, bool]]:
    """Return for each topic with messages whether it holds specific force, and whether angular rate.

    A driver with one topic a sensor leaves the other's numbers zero. A lone vector is what its topic's name says.
    """
    heads: dict[str, list[Message]] = {n: [] for n in names}
    for seen, message in enumerate(bag.messages(names)):
        if len(head := heads[message[0]]) < _PEEKED:
            head.append(message)
        if seen > _MOST_PEEKED or all(len(h) >= _PEEKED for h in heads.values()):
            break
    found: dict[str, tuple[bool, bool]] = {}
    for name, head in heads.items():
        if head:
            decoded, said = decode(known[name], head), kind_of_file(name)
            here = bool(decoded.force.any()), bool(decoded.rate.any())
            found[name] = (said == "a", said == "g") if known[name].kind == _VECTOR else here
    return found


def batches(messages: Iterator[Message]) -> Iterator[list[Message]]:
    """Return messages some thousands at a time."""
    return iter(lambda: list(islice(messages, _BATCH)), [])


@dataclass
class _Decoding:
    """Messages of the chosen topics on their way to arrays, and what is learnt of them meanwhile."""

    bag: Bag
    choice: Choice
    unstamped: set[str] = field(default_factory=set[str])
    counts: Counter[str] = field(default_factory=Counter[str])

    def pieces(self) -> Iterator[dict[str, Samples]]:
        """Yield samples by topic, those of some thousands of messages at a time."""
        topics = {t.name: t for t in self.bag.topics if t.name in self.choice.names()}
        messages, total = self.bag.messages([*topics]), sum(t.count for t in topics.values())
        for batch in batches(counted(messages, total) if total else messages):
            of_topics = {name: [m for m in batch if m[0] == name] for name in topics}
            yield {name: self._samples(topics[name], own) for name, own in of_topics.items() if own}

    def _samples(self, topic: Topic, batch: list[Message]) -> Samples:
        self.counts[topic.name] += len(batch)
        decoded = decode(topic, batch)
        if decoded.unstamped:
            self.unstamped.add(topic.name)
        force = decoded.force if topic.name == self.choice.force else None
        return Samples(decoded.time, force, decoded.rate if topic.name == self.choice.rates else None)


def bag_tables(bag: Bag, wanted: Sequence[str]) -> Iterator[RawTable]:
    """Yield the table of a bag in blocks of half a million rows; what is noticed on the way stands on the last one.

    Raises
    ------
    RecordingError
        If it is damaged or holds no IMU, or several.
    UsageError
        If a topic is not there.
    """
    rest, name, said = split_wanted(bag, wanted)
    field = None if name is None else _read_field(bag, name)
    first = [Remark("found", f"{bag.path.name} holds {_list_topics(bag.topics)}."), *said]
    others = [t for t in bag.topics if t.kind in READABLE and not is_field_topic(t)]
    if field is not None and not rest and not others:
        samples = Samples(field.time, magnetic_field=field.values)
        yield table_of_samples(bag.path, samples, {"m": field.unit or None}, first)
        return
    choice = choose_topics(bag, rest)
    decoding = _Decoding(bag, choice)
    first += [_choice_remark(bag, choice), *_misnamed(bag, choice)]
    split = choice.force is not None and choice.rates is not None and choice.force != choice.rates
    merging = Merging(bag.path.name, choice.force or "", choice.rates or "") if split else None
    topic = None if split else choice.names()[0]
    held: Samples | None = None
    for samples in _merged(decoding.pieces(), merging) if merging else _single(decoding.pieces()):
        if held is not None:
            yield replace(table_of_samples(bag.path, held, SI, first), topic=topic, field=field)
            first = []
        held = samples
    if held is None:
        raise RecordingError(
            f"{bag.path.name}: {' and '.join(choice.names())} hold(s) no message that could be read."
        )
    first += [*bag.remarks, *_lost(bag, choice, decoding.counts), *(merging.remarks() if merging else [])]
    text = "have no stamps; the times at which the messages were recorded are taken, which jitter"
    unstamped = [f"{bag.path.name}: the headers of {name} {text}." for name in sorted(decoding.unstamped)]
    first += [Remark("assumed", one) for one in unstamped]
    yield replace(table_of_samples(bag.path, held, SI, first), topic=topic, field=field)


def _single(pieces: Iterator[dict[str, Samples]]) -> Iterator[Samples]:
    held: list[Samples] = []
    for piece in pieces:
        held += piece.values()
        if sum(map(len, held)) >= BLOCK_ROWS:
            yield joined(held)
            held = []
    if held:
        yield joined(held)


def _merged(pieces: Iterator[dict[str, Samples]], merging: Merging) -> Iterator[Samples]:
    for piece in pieces:
        merging.add(piece.get(merging.force_name), piece.get(merging.rate_name))
        if merging.waiting() >= BLOCK_ROWS and (block := merging.take()) is not None:
            yield block
    if (block := merging.take(last=True)) is not None:
        yield block


def _read_field(bag: Bag, name: str) -> MagneticField | None:
    """Return the messages of a magnetometer's topic as samples in time order, None if there are none."""
    pieces = [samples for piece in _Decoding(bag, Choice(name, None)).pieces() for samples in piece.values()]
    if not pieces:
        return None
    samples, tesla = joined(pieces), any(t.name == name and t.kind == FIELD for t in bag.topics)
    assert samples.specific_force is not None
    note = "" if tesla else "has no unit in its type (--units uT)"
    unit = "T" if tesla else None
    stream = MagneticField.finite(samples.time, samples.specific_force, unit, name, note)
    refuse_backwards(bag.path.name, name, stream.time)
    return stream


def _choice_remark(bag: Bag, choice: Choice) -> Remark:
    if choice.force == choice.rates:
        return Remark("found", f"{bag.path.name}: {choice.force} is read.")
    parts = [
        f"{n} as the {what}" for n, what in ((choice.force, "accelerometer"), (choice.rates, "gyro")) if n
    ]
    return Remark("found", f"{bag.path.name}: read are {' and '.join(parts)}.")


def _misnamed(bag: Bag, choice: Choice) -> list[Remark]:
    """Say where a topic's name says the other triad than its messages hold."""
    if choice.force == choice.rates:
        return []
    said: list[Remark] = []
    for name, kind, what, other in (
        (choice.force, "a", "an acceleration", "a gyro"),
        (choice.rates, "g", "an angular rate", "an accelerometer"),
    ):
        named = None if name is None else kind_of_file(name)
        if named in ("a", "g") and named != kind:
            text = f"{bag.path.name}: {name} is named after {other}, but its messages hold {what}: it is read as that."
            said.append(Remark("unchecked", text))
    return said


def _lost(bag: Bag, choice: Choice, counts: Counter[str]) -> list[Remark]:
    """Say how many messages the bag's index promises that could not be read."""
    said: list[Remark] = []
    for name in choice.names():
        promised = sum(t.count for t in bag.topics if t.name == name)
        if counts[name] < promised:
            lost = promised - counts[name]
            text = f"{bag.path.name}: {lost} of {promised} messages of {name} could not be read."
            said.append(Remark("mended", text))
    return said
