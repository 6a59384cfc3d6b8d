"""Libraries of the extra `ros`, and zstd by one of them."""

from __future__ import annotations

from importlib import import_module
from typing import Any, BinaryIO

from tumble.errors import RecordingError, UsageError, install

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


def decompress_zstd(data: bytes, file: str) -> bytes:
    """Return the content of zstd data.

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    RecordingError
        If the data is damaged.
    """
    library = needed("zstandard", f"{file} is compressed with zstd")
    try:
        content: bytes = library.ZstdDecompressor().stream_reader(data).read()
    except library.ZstdError as error:
        raise RecordingError(f"{file} is compressed with zstd and damaged ({error}).") from error
    return content


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
