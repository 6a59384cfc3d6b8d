"""Decompression by libraries that are no part of Python: lz4 and zstd, of the extra `ros`."""

from __future__ import annotations

import bz2
from importlib import import_module
from typing import Any, BinaryIO

from tumble.errors import RecordingError, UsageError, install

_LARGEST_CHUNK = (
    256 << 20
)  # bytes that a chunk of a bag may unpack to; recorders write one of a few megabytes
_ANY_CHUNK = 16 << 20  # bytes that every chunk may unpack to
_ALWAYS = 64 << 20  # bytes that may always be unpacked
_LARGEST_RATIO = (
    300  # times; text of numbers is packed to a third or a tenth, a constant column to a fiftieth
)
_LARGEST = 64 << 30  # bytes in all
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_PIECE = 1 << 13  # bytes; of a damaged piece nothing is left


def needed(name: str, words: str) -> Any:
    """Return a module of the libraries of the extra `ros`.

    Parameters
    ----------
    name : of the module.
    words : what it is needed for, as the beginning of a sentence.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise UsageError(f"{words}; reading it needs {install('ros')}.") from error


def largest_chunk(data: bytes) -> int:
    """Return how many bytes a packed chunk of a bag may unpack to."""
    return min(_LARGEST_CHUNK, max(_ANY_CHUNK, _LARGEST_RATIO * len(data)))


def refuse_unmeasured(unpacked: int, packed: int, name: str) -> None:
    """Refuse what unpacks to far more than it is: no recording does, and it would fill the memory or the disk.

    Parameters
    ----------
    unpacked, packed : bytes so far, and bytes of the whole packed file.
    name : of the file.

    Raises
    ------
    RecordingError
        If it is more than 64 MB and 300 times the packed size, or 64 GB.
    """
    if unpacked > _LARGEST or unpacked > max(_ALWAYS, _LARGEST_RATIO * packed):
        raise RecordingError(
            f"{name} unpacks to {unpacked >> 20} MB or more from {max(packed >> 10, 1)} kB, which no recording does; "
            "if it is one, unpack it and name the file in it."
        )


class Measured:
    """A stream of unpacked bytes that is refused where it grows beyond measure.

    Attributes
    ----------
    stream : whose `read` unpacks.
    packed : bytes of the packed file.
    name : of the file.
    """

    def __init__(self, stream: Any, packed: int, name: str) -> None:
        self.stream, self.packed, self.name = stream, packed, name
        self._total = 0

    def read(self, size: int) -> bytes:
        """Return the next bytes, none at the end.

        Raises
        ------
        RecordingError
            If there are more than `refuse_unmeasured` lets pass.
        """
        data: bytes = self.stream.read(size)
        self._total += len(data)
        refuse_unmeasured(self._total, self.packed, self.name)
        return data


def decompress_bz2(data: bytes, file: str, largest: int | None = None) -> bytes:
    """Return the content of bz2 data, at most `largest` bytes (see `largest_chunk`).

    Raises
    ------
    EOFError
        If the data is damaged or ends early.
    RecordingError
        If it is longer.
    """
    largest = largest_chunk(data) if largest is None else largest
    unpacker = bz2.BZ2Decompressor()
    try:
        content = unpacker.decompress(data, largest + 1)
    except OSError as error:  # which is not the disk's
        raise EOFError(str(error)) from error
    if not unpacker.eof and len(content) <= largest:
        raise EOFError("it ends early")
    return _bounded(content, file, largest)


def _bounded(content: bytes, file: str, largest: int) -> bytes:
    if len(content) > largest:
        raise RecordingError(
            f"{file}: a chunk unpacks to more than {largest >> 20} MB, which no recorder writes."
        )
    return content


def decompress_lz4(data: bytes, file: str, largest: int | None = None) -> bytes:
    """Return the content of an lz4 frame, at most `largest` bytes (see `largest_chunk`).

    Raises
    ------
    UsageError
        If lz4 is not installed; the message names the file and the extra.
    RuntimeError
        If the frame is damaged or ends early.
    RecordingError
        If it is longer.
    """
    largest = largest_chunk(data) if largest is None else largest
    unpacker = needed("lz4.frame", f"{file} is compressed with lz4").LZ4FrameDecompressor()
    content: bytes = unpacker.decompress(data, max_length=largest + 1)
    if not unpacker.eof and len(content) <= largest:
        raise RuntimeError("it ends early")
    return _bounded(content, file, largest)


def decompress_zstd(data: bytes, file: str, largest: int | None = None) -> bytes:
    """Return the content of zstd data, at most `largest` bytes (see `largest_chunk`).

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    RecordingError
        If the data is damaged or longer.
    """
    largest = largest_chunk(data) if largest is None else largest
    library = needed("zstandard", f"{file} is compressed with zstd")
    try:
        content: bytes = library.ZstdDecompressor().stream_reader(data).read(largest + 1)
    except library.ZstdError as error:
        raise RecordingError(f"{file} is compressed with zstd and damaged ({error}).") from error
    return _bounded(content, file, largest)


class ZstdStream:
    """A file that is compressed with zstd, frame after frame, as a stream of unpacked bytes."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        """Begin at the file's place.

        Raises
        ------
        UsageError
            If zstandard is not installed; the message names the file and the extra.
        """
        self._file, self._library = file, needed("zstandard", f"{name} is compressed with zstd")
        self._frame: Any = None
        self._waiting = b""

    def read(self, size: int) -> bytes:
        """Return the next unpacked bytes, those of some thousand packed ones, none at the end.

        Raises
        ------
        EOFError
            If the file ends inside a frame, or a frame is damaged.
        """
        while piece := self._waiting or self._file.read(min(size, _PIECE)):
            self._frame = self._frame or self._library.ZstdDecompressor().decompressobj()
            try:
                content: bytes = self._frame.decompress(piece)
            except self._library.ZstdError as error:
                raise EOFError(str(error)) from error
            self._waiting = self._frame.unused_data if self._frame.eof else b""
            self._frame = None if self._frame.eof else self._frame
            if content:
                return content
        if self._frame is not None:
            raise EOFError("the file ends inside a frame")
        return b""
