"""Decompression by libraries that are no part of Python: lz4 and zstd, of the extra `ros`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tumble.errors import RecordingError, UsageError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


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


def open_zstd(file: Any, name: str) -> Any:
    """Return a stream of the content of an open file that is compressed with zstd.

    Raises
    ------
    UsageError
        If zstandard is not installed; the message names the file and the extra.
    """
    return _library("zstandard", name, "zstd").ZstdDecompressor().stream_reader(file, read_across_frames=True)


def zstd_errors() -> tuple[type[Exception], ...]:
    """Return what the library of zstd raises on damaged data; nothing where it is not installed."""
    try:
        error: type[Exception] = import_module("zstandard").ZstdError
    except ImportError:
        return ()
    return (error,)
