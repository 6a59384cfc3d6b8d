"""Decompression by libraries that are no part of Python: lz4 and zstd, of the extra `ros`."""

from __future__ import annotations

from importlib import import_module
from typing import Any, BinaryIO

from tumble.errors import RecordingError, UsageError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_PIECE = 1 << 13  # bytes; of a damaged piece nothing is left


def _library(name: str, file: str, what: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise UsageError(
            f'{file} is compressed with {what}; reading it needs pip install "tumble[ros]".'
        ) from error


def decompress_lz4(data: bytes, file: str) -> bytes:
    """Return the content of an lz4 frame.

    Raises
    ------
    UsageError
        If lz4 is not installed; the message names the file and the extra.
    RuntimeError
        If the frame is damaged.
    """
    content: bytes = _library("lz4.frame", file, "lz4").decompress(data)
    return content


def decompress_zstd(data: bytes, file: str) -> bytes:
    """Return the content of zstd data.

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    RecordingError
        If the data is damaged.
    """
    library = _library("zstandard", file, "zstd")
    try:
        content: bytes = library.ZstdDecompressor().decompressobj().decompress(data)
    except library.ZstdError as error:
        raise RecordingError(f"{file} is compressed with zstd and damaged ({error}).") from error
    return content


def unpack_zstd(file: BinaryIO, target: BinaryIO, name: str) -> None:
    """Write the content of an open file that is compressed with zstd, frame after frame.

    Parameters
    ----------
    file, target : opened to read and to write.
    name : of the file, for messages.

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    EOFError
        If the file ends inside a frame, or a frame is damaged; what came before is written.
    """
    library = _library("zstandard", name, "zstd")
    frame: Any = None
    while piece := file.read(_PIECE):
        while piece:
            frame = frame or library.ZstdDecompressor().decompressobj()
            try:
                target.write(frame.decompress(piece))
            except library.ZstdError as error:
                raise EOFError(str(error)) from error
            piece = frame.unused_data if frame.eof else b""
            frame = None if frame.eof else frame
    if frame is not None:
        raise EOFError("the file ends inside a frame")
