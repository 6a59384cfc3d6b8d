"""MAVLink of autopilots: HIGHRES_IMU in SI, else SCALED_IMU in mg and mrad/s, else RAW_IMU as it comes."""

from __future__ import annotations

from typing import Any

from tumble.capture.frames import Frames, Measured
from tumble.capture.link import Decoder, Format
from tumble.capture.source import Piece, SourceOptions
from tumble.errors import UsageError, install
from tumble.units import COUNTS

# Best first: units, and s of one unit of its stamp. RAW_IMU's units are the vehicle's (ArduPilot: mg and mrad/s).
_MESSAGES = {
    "HIGHRES_IMU": (("m/s^2", "rad/s", "gauss"), "time_usec", 1e-6),
    "SCALED_IMU": (("mg", "mrad/s", "mgauss"), "time_boot_ms", 1e-3),
    "RAW_IMU": ((COUNTS, COUNTS, COUNTS), "time_usec", 1e-6),
}
# Messages after which it is known which of these come.
_LOOKED_AT = 60


class MavlinkFrames:
    """Bytes in, samples of the best message out.

    Parameters
    ----------
    options, name : with a message's name as topic, where another than the best is wanted.

    Raises
    ------
    UsageError
        If pymavlink is not installed, or the message asked for is none of an IMU.
    """

    def __init__(self, options: SourceOptions, name: str) -> None:
        self._options = options
        self._parser = _parser()
        wanted = options.topics[0] if options.topics else None
        if wanted is not None and wanted not in _MESSAGES:
            raise UsageError(f"--topic {wanted}: known are {', '.join(_MESSAGES)}.")
        self._chosen = wanted
        self._seen: list[Any] = []
        self._frames: Frames | None = None
        self.good = self.damaged = 0

    def feed(self, data: bytes, arrived: float) -> list[Piece]:
        """Return what is complete."""
        found: list[Any] = self._parser.parse_buffer(data) or []
        for message in found:
            kind = message.get_type()
            self.good += kind != "BAD_DATA"
            self.damaged += kind == "BAD_DATA"
            if kind in _MESSAGES:
                self._seen.append(message)
        if self._frames is None and not self._choose(last=False):
            return []
        return self._pieces(arrived)

    def end(self) -> list[Piece]:
        """Return what is left."""
        if self._frames is None and not self._choose(last=True):
            return []
        pieces = self._pieces(0.0)
        return pieces + (self._frames.end() if self._frames is not None else [])

    def _choose(self, *, last: bool) -> bool:
        if not self._seen or (len(self._seen) < _LOOKED_AT and not last and self._chosen is None):
            return False
        kinds = {message.get_type() for message in self._seen}
        self._chosen = self._chosen or next(kind for kind in _MESSAGES if kind in kinds)
        self._frames = Frames(self._options, lambda data: (0, None, True), _MESSAGES[self._chosen][0])
        return True

    def _pieces(self, arrived: float) -> list[Piece]:
        assert self._frames is not None
        assert self._chosen is not None
        _, stamp, tick = _MESSAGES[self._chosen]
        messages = [message for message in self._seen if message.get_type() == self._chosen]
        self._seen.clear()
        return self._frames.measured(
            [
                Measured(
                    (m.xacc, m.yacc, m.zacc),
                    (m.xgyro, m.ygyro, m.zgyro),
                    getattr(m, stamp) * tick,
                    field=(m.xmag, m.ymag, m.zmag) if m.xmag or m.ymag or m.zmag else None,
                )
                for m in messages
            ],
            arrived,
        )


def _parser() -> Any:
    try:
        from pymavlink.dialects.v20 import common
    except ImportError:
        raise UsageError(f"MAVLink needs pymavlink: {install('mavlink')}.") from None
    parser: Any = common.MAVLink(None)
    parser.robust_parsing = True
    return parser


def _recognises(head: bytes) -> bool:
    if b"\xfd" not in head and b"\xfe" not in head:
        return False
    try:
        found: list[Any] = _parser().parse_buffer(head) or []
    except UsageError:
        return False
    return sum(message.get_type() != "BAD_DATA" for message in found) >= 2


def _decoder(options: SourceOptions, name: str) -> Decoder:
    return MavlinkFrames(options, name)


FORMAT = Format("mavlink", "MAVLink of autopilots", _recognises, _decoder)
