"""What ROS messages of inertial sensors look like, serialised by ROS 1 or as CDR by ROS 2.

Layouts are those of the message definitions `sensor_msgs/Imu`, `sensor_msgs/MagneticField`,
`geometry_msgs/Vector3Stamped` and `std_msgs/Header`: their numbers have fixed places after the frame's name, so that
messages of one length are decoded together. A stamp is the header's, or the recorder's where the header has none.

References
----------
ROS common_interfaces, message definitions; OMG, *DDS-XTypes 1.3*, section 7.4 (CDR).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tumble.arrays import Series
from tumble.errors import RecordingError
from tumble.recording.columns import kind_of_file
from tumble.recording.samples import Samples
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


@dataclass(frozen=True, slots=True)
class Decoded:
    """Messages of one topic as arrays.

    Attributes
    ----------
    time : (n,) seconds, of the header or of the recorder.
    force, rate : (n, 3), or None.
    unstamped : whether the headers have no time.
    """

    time: Series
    force: npt.NDArray[np.float64]
    rate: npt.NDArray[np.float64]
    unstamped: bool


def decode(kind: str, messages: list[bytes], log_times: list[int], topic: str, *, cdr: bool) -> Decoded:
    """Decode messages of one topic.

    Parameters
    ----------
    kind : type of the messages, as `plain_type` gives it.
    messages, log_times : their bytes, and when they were recorded, in ns.
    topic : its name, for messages.
    cdr : whether they are serialised as CDR (ROS 2) and not as ROS 1 does it.

    Raises
    ------
    RecordingError
        If a message is too short to be of that type.
    """
    count = len(messages)
    numbers = np.empty((count, _LAYOUTS[kind][0]))
    stamps = np.empty((count, 2))
    lengths = np.array([len(m) for m in messages])
    for length in np.unique(lengths):
        index = np.flatnonzero(lengths == length)
        body = b"".join([messages[i] for i in index] if index.size < count else messages)
        rows = np.frombuffer(body, np.uint8).reshape(index.size, int(length))
        _decode_rows(rows, index, numbers, stamps, kind, topic, cdr)
    unstamped = not stamps.any()
    if unstamped:
        stamps = np.column_stack(np.divmod(np.array(log_times, np.int64), 1_000_000_000)).astype(np.float64)
    _, force, rate = _LAYOUTS[kind]
    # Seconds and the rest apart: nanoseconds since 1970 have more digits than a float64 holds.
    return Decoded(
        stamps[:, 0] + stamps[:, 1] / 1e9,
        numbers[:, force : force + 3],
        numbers[:, rate : rate + 3],
        unstamped,
    )


def _decode_rows(
    rows: npt.NDArray[np.uint8],
    index: npt.NDArray[np.intp],
    numbers: npt.NDArray[np.float64],
    stamps: npt.NDArray[np.float64],
    kind: str,
    topic: str,
    cdr: bool,
) -> None:
    """Decode messages of one length into the rows `index` of `numbers` and `stamps`."""
    length = rows.shape[1]
    order = ">" if cdr and length > 1 and rows[0, 1] % 2 == 0 else "<"
    start = 4  # after the encapsulation of CDR, or the sequence number of ROS 1
    if length < start + 12:
        raise _too_short(topic, kind, length)
    head = rows[:, start : start + 12].copy().view(order + "u4")
    for name_length in np.unique(head[:, 2]):
        same = head[:, 2] == name_length
        begin = _numbers_begin(int(name_length), cdr=cdr)
        size = 8 * numbers.shape[1]
        if begin + size > length:
            raise _too_short(topic, kind, length)
        numbers[index[same]] = rows[same, begin : begin + size].copy().view(order + "f8")
    stamps[index] = head[:, :2]


def _too_short(topic: str, kind: str, length: int) -> RecordingError:
    return RecordingError(
        f"A message of {topic} has {length} bytes, too few for {kind}, which the file says that it "
        "is. The file is damaged, or the topic was recorded with another definition of the type."
    )


def holds(decoded: Decoded, kind: str, topic: str) -> tuple[bool, bool]:
    """Say whether messages hold specific force, and whether angular rate.

    A driver with one topic a sensor leaves the other's numbers zero. A lone vector is what its topic's
    name says.
    """
    if kind == _VECTOR:
        said = kind_of_file(topic)
        return said == "a", said == "g"
    return bool(decoded.force.any()), bool(decoded.rate.any())


@dataclass(frozen=True, slots=True)
class Substitute:
    """What takes the place of numbers in messages of one topic.

    Attributes
    ----------
    force, rate : (n, 3) m/s² and rad/s; None leaves what is there.
    shift : ns that stamps of headers are moved by; those of zero, which are none, stay.
    """

    force: npt.NDArray[np.float64] | None = None
    rate: npt.NDArray[np.float64] | None = None
    shift: int = 0

    def fields(self, kind: str) -> list[tuple[int, npt.NDArray[np.float64]]]:
        """Return where among the numbers of a message of this type which others go."""
        _, force, rate = _LAYOUTS[kind]
        return [
            (place, values)
            for place, values in ((force, self.force), (rate, self.rate))
            if values is not None
        ]


def substituted(kind: str, messages: list[bytes], put: Substitute, *, cdr: bool) -> list[bytes]:
    """Return messages with other numbers in them; every other byte stays.

    Parameters
    ----------
    kind, messages, cdr : as for `decode`, which has read them.
    put : one row a message.
    """
    made: list[bytes] = [b""] * len(messages)
    # Messages of one length with a frame's name of one length have their numbers at the same places.
    alike: dict[tuple[int, bytes, bytes], list[int]] = {}
    for number, message in enumerate(messages):
        alike.setdefault((len(message), message[:2], message[12:16]), []).append(number)
    for (length, head, _), numbers in alike.items():
        order = ">" if cdr and head[1] % 2 == 0 else "<"
        rows = np.frombuffer(b"".join(messages[i] for i in numbers), np.uint8)
        rows = rows.reshape(len(numbers), length).copy()
        begin = _numbers_begin(int(rows[0, 12:16].copy().view(order + "u4")[0]), cdr=cdr)
        for place, values in put.fields(kind):
            some = values[numbers]
            size = 8 * some.shape[1]
            packed = np.ascontiguousarray(some, dtype=order + "f8").view(np.uint8)
            rows[:, begin + 8 * place : begin + 8 * place + size] = packed
        if put.shift:
            rows[:, 4:12] = _moved(rows[:, 4:12], put.shift, order)
        for row, number in enumerate(numbers):
            made[number] = rows[row].tobytes()
    return made


def _numbers_begin(name_length: int, *, cdr: bool) -> int:
    """Return where the numbers of a message begin: after the frame's name, with CDR at a multiple of eight."""
    begin = 16 + name_length
    return 4 + (begin - 4 + 7) // 8 * 8 if cdr else begin


def _moved(stamps: npt.NDArray[np.uint8], shift: int, order: str) -> npt.NDArray[np.uint8]:
    """Return stamps of seconds and nanoseconds (n, 8 bytes), moved; none before 1970."""
    parts = stamps.copy().view(order + "u4").astype(np.int64)
    total = parts[:, 0] * 1_000_000_000 + parts[:, 1]
    moved = np.where(total > 0, np.maximum(total + shift, 0), 0)
    both = np.column_stack(np.divmod(moved, 1_000_000_000))
    return np.ascontiguousarray(both, dtype=order + "u4").view(np.uint8)


def samples_of(decoded: Decoded, force: bool, rate: bool) -> Samples:
    """Return decoded messages as samples of what is wanted of them."""
    return Samples(decoded.time, decoded.force if force else None, decoded.rate if rate else None)
