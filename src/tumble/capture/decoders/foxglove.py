"""Messages of foxglove_bridge, each behind its length: `sensor_msgs/Imu` and `sensor_msgs/MagneticField`.

The socket has messages, and a stream of bytes has none: `message` puts one into the stream.

References
----------
Foxglove WebSocket protocol, version 1: message data is 01, the subscription (u32), the time in ns (u64), the payload.
"""

from __future__ import annotations

import struct

from tumble.capture.apart import ApartSensors, three
from tumble.capture.link import Format
from tumble.capture.source import Piece, SourceOptions
from tumble.errors import RecordingError
from tumble.recording.formats.bags.ros_messages import FIELD, READABLE, decode

IMU = READABLE[0]
# Length, which topic, whether a magnetometer's, whether CDR; then the message as the socket has it.
_HEAD, _DATA = struct.Struct("<IH??"), struct.Struct("<BIQ")
_LONGEST = 1 << 16


def message(data: bytes, topic: int, *, field: bool, cdr: bool) -> bytes:
    """Return a message of the socket as it goes into a stream.

    Parameters
    ----------
    data : binary message.
    topic : which of those that are read.
    field : whether it is a magnetometer's.
    cdr : whether it is ROS 2's serialisation, and not ROS 1's.
    """
    return _HEAD.pack(len(data), topic, field, cdr) + data


class FoxgloveMessages:
    """Bytes in, samples out.

    Parameters
    ----------
    options, name : as for every decoder.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self.good = self.damaged = 0
        self._sensors = ApartSensors(options, name, field_unit="T")
        self._rest = b""

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return what is complete."""
        rest = self._rest + data
        while len(rest) >= _HEAD.size:
            length, topic, field, cdr = _HEAD.unpack_from(rest)
            if length > _LONGEST:
                rest = rest[1:]
                self.damaged += 1
                continue
            if len(rest) < _HEAD.size + length:
                break
            good = self._take(rest[_HEAD.size : _HEAD.size + length], topic, field=field, cdr=cdr)
            self.good += good
            self.damaged += not good
            rest = rest[_HEAD.size + length :]
        self._rest = rest
        return self._sensors.pieces()

    def end(self) -> list[Piece]:
        """Return what is left."""
        return self._sensors.pieces(last=True)

    def _take(self, data: bytes, topic: int, *, field: bool, cdr: bool) -> bool:
        if len(data) <= _DATA.size or data[0] != 1:
            return False
        _, _, logged = _DATA.unpack_from(data)
        kind = FIELD if field else IMU
        try:
            found = decode(kind, [data[_DATA.size :]], [logged % (1 << 63)], "a topic", cdr=cdr)
        except RecordingError:
            return False
        time = float(found.time[0])
        if field:
            self._sensors.add("field", topic, time, three(found.force[0]))
        else:
            self._sensors.add("force", topic, time, three(found.force[0]))
            self._sensors.add("rate", topic, time, three(found.rate[0]))
        return True


FORMAT = Format("foxglove", "messages of foxglove_bridge", lambda head: False, FoxgloveMessages)
