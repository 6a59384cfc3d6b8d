"""Writing what a user names: whole, beside its place, then renamed, or line by line; never over an input or a device.

A file that only grows, line by line, and keeps every whole line whatever happens to the program or the disk.
"""

from __future__ import annotations

import os
import signal
import stat
import threading
import zlib
from collections.abc import Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from tumble.errors import OutputError, UsageError
from tumble.files.documents import kind_of

# A line is never longer than this; the end of a file that was cut off is looked for so far back.
_LONGEST_LINE = 1 << 20

# Set once a finished file has taken its place.
_done = threading.Event()


class GrowingFile:
    """A text file that is appended to; one program at a time.

    Parameters
    ----------
    path : made, in a folder that is there; with `resume` it may be there, and half a last line is cut off.
    resume : go on with what is there.

    Attributes
    ----------
    size : bytes that are in the file, without those that wait.

    Raises
    ------
    UsageError
        If it is no place for a result, is there already without `resume`, or another program appends to it.
    OutputError
        If it cannot be made.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        check_target(path)
        self.path = path
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | (0 if resume else os.O_EXCL)
        try:
            self._handle = os.open(path, flags | getattr(os, "O_BINARY", 0), 0o644)
        except FileExistsError:
            raise UsageError(
                f"{path} is there already, and is not written over: go on with it (--resume), or give another folder."
            ) from None
        except OSError as error:
            raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
        self._pending: list[bytes] = []
        self._lock()
        self.size = self._whole_lines()

    def append(self, lines: bytes) -> None:
        """Keep whole lines until the next `flush`.

        Parameters
        ----------
        lines : each with its end.
        """
        self._pending.append(lines)

    def flush(self, *, durable: bool = False) -> None:
        """Write what waits.

        Parameters
        ----------
        durable : down to the disk, so that even a power cut loses nothing of it.

        Raises
        ------
        OutputError
            If it cannot be written; all lines before are whole.
        """
        content = b"".join(self._pending)
        self._pending.clear()
        try:
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(self._handle, rest) :]
            self.size += len(content)
            if durable:
                os.fsync(self._handle)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._handle, self.size)
                self.size = self._whole_lines()
            raise OutputError(
                f"{self.path} could not be written on: {error.strerror or error}; all before that is kept."
            ) from error

    def close(self) -> None:
        """Write what waits, down to the disk, and let go of the file.

        Raises
        ------
        OutputError
            If it cannot be written; all lines before are whole.
        """
        try:
            self.flush(durable=True)
        finally:
            os.close(self._handle)

    def _lock(self) -> None:
        """Let no other program append; where a system knows no such lock nothing is refused."""
        try:
            import fcntl
        except ImportError:
            return
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._handle)
            raise UsageError(f"{self.path} is being written by another tumble: end that one first.") from None
        except OSError:
            return

    def _whole_lines(self) -> int:
        """Cut off a last line without its end, and return the size."""
        size = os.fstat(self._handle).st_size
        if size == 0:
            return 0
        start = max(size - _LONGEST_LINE, 0)
        with os.fdopen(os.dup(self._handle), "rb") as reader:
            reader.seek(start)
            tail = reader.read()
        whole = start + tail.rfind(b"\n") + 1
        if whole < size:
            os.ftruncate(self._handle, whole)
        return whole


_inputs: ContextVar[frozenset[tuple[int, int]]] = ContextVar("inputs", default=frozenset())

_LONGEST_NAME = 200
"""Bytes of a file's name to which the ending of what is written beside it can be added on any disk."""


@contextmanager
def inputs_kept(paths: Iterable[Path]) -> Generator[None, None, None]:
    """Let nothing be written over these files while a command runs.

    Parameters
    ----------
    paths : what the command reads; of a folder, the files in it that a calibration or a simulation has there.
    """
    held: set[tuple[int, int]] = set(_inputs.get())
    for path in paths:
        for file in (path, path / "calibration.json", path / "protocol.yaml", path / "noise.json"):
            with suppress(OSError, ValueError):
                found = file.stat()
                held |= {(found.st_dev, found.st_ino)} if stat.S_ISREG(found.st_mode) else set()
    token = _inputs.set(frozenset(held))
    try:
        yield
    finally:
        _inputs.reset(token)


def check_target(path: Path) -> None:
    """Refuse a place where no result may stand.

    Parameters
    ----------
    path : where a file is to be.

    Raises
    ------
    UsageError
        If an input is there, or a folder, a device or another thing that is no ordinary file.
    """
    try:
        found = path.stat()
    except (OSError, ValueError):
        return  # nothing there, or no way to it, which writing says
    if kind := kind_of(found):
        raise UsageError(f"{path} is {kind}: give an ordinary file with -o.")
    if (found.st_dev, found.st_ino) in _inputs.get():
        raise UsageError(
            f"{path} is one of the inputs, which is not written over: give another file with -o."
        )


def _beside(path: Path) -> Path:
    """Return a place beside `path` of this process's own, also where the name is as long as a name may be."""
    name = path.name
    if len(os.fsencode(name)) > _LONGEST_NAME:
        name = f"{name[:40]}-{zlib.crc32(os.fsencode(name)):08x}"
    return path.with_name(f".{name}.{os.getpid()}.part")


@contextmanager
def written_beside(path: Path) -> Generator[Path, None, None]:
    """Give a path beside `path` to write to; afterwards it takes the place of `path`.

    Raises
    ------
    UsageError
        If `path` is no place for a result.
    OutputError
        If the file cannot be written; what stood at `path` is then intact.
    """
    check_target(path)
    beside = _beside(path)
    try:
        yield beside
        beside.replace(path)
        _done.set()
    except OSError as error:
        raise OutputError(f"{path} could not be written: {error.strerror or error}.") from error
    finally:
        # On a read-only place even removing what is not there is an error, and not the one to tell.
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text beside `path` and rename it there, making the folder if it is not there.

    Parameters
    ----------
    path, text : in UTF-8; what of a file's name is no UTF-8 becomes a question mark.

    Raises
    ------
    UsageError
        If `path` is no place for a result.
    OutputError
        If it cannot be written; what was at `path` is intact.
    """
    write_texts({path: text})


def write_texts(texts: Mapping[Path, str | bytes]) -> list[Path]:
    """Write several texts beside their places, then rename them all; return the places.

    All are complete on the disk before one takes its place, and no stop comes between.

    Parameters
    ----------
    texts : by place, bytes as they are; folders are made.

    Raises
    ------
    UsageError
        If one is no place for a result.
    OutputError
        If they cannot be written; what was there is intact.
    """
    with ExitStack() as stack:
        for path, text in texts.items():
            stack.enter_context(_folder(path.parent))
            put_text(stack.enter_context(written_beside(path)), text)
        with uninterrupted():
            stack.pop_all().close()
    return list(texts)


def make_folder(folder: Path) -> None:
    """Make a folder, where it is not there.

    Parameters
    ----------
    folder : with those above it.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"The folder {folder} cannot be made: {error.strerror or error}.") from error


def results_folder(output: str | os.PathLike[str] | None) -> Path | None:
    """Return the folder for results, None for none; refuse before the work what would fail after it.

    Parameters
    ----------
    output : as it was named.

    Raises
    ------
    UsageError
        If it is a file.
    OutputError
        If it cannot be made or written to.
    """
    import tempfile

    if output is None:
        return None
    folder = Path(output)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder.")
    existing = next((one for one in (folder, *folder.parents) if one.exists()), folder)
    if not existing.is_dir():
        raise OutputError(f"The folder {folder} cannot be made: {existing} is no folder. Give another -o.")
    try:
        with tempfile.TemporaryDirectory(dir=existing, prefix=".tumble-"):
            return folder
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be made or written to: {error.strerror or error}. Give another folder with -o."
        ) from error


@contextmanager
def _folder(folder: Path) -> Generator[None, None, None]:
    """Have a folder, and take away again what was made of it if nothing came to be in it."""
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        make_folder(folder)
        yield
    finally:
        for one in made:
            with suppress(OSError):
                one.rmdir()


@contextmanager
def filled_folder(folder: Path) -> Generator[Path, None, None]:
    """Give a folder inside `folder` to fill; afterwards its files take their places in `folder`, all or none.

    Parameters
    ----------
    folder : made if it is not there, and removed again if nothing came to be in it.

    Raises
    ------
    UsageError
        If one of the places is no place for a result.
    OSError
        If it cannot be written; what was there is intact.
    OutputError
        If it cannot be made.
    """
    import tempfile

    with _folder(folder), tempfile.TemporaryDirectory(dir=folder, prefix=".tumble-") as temporary:
        yield Path(temporary)
        files = sorted(Path(temporary).iterdir())
        for file in files:
            check_target(folder / file.name)
        with uninterrupted():
            for file in files:
                file.replace(folder / file.name)


@contextmanager
def temporary_folder() -> Generator[Path, None, None]:
    """Give a folder of the system's that is removed afterwards.

    Raises
    ------
    OutputError
        If there is none that can be written to.
    """
    import tempfile

    try:
        held = tempfile.TemporaryDirectory(prefix="tumble-")
    except OSError as error:
        raise OutputError(
            "There is no temporary folder that can be written to, which unpacking takes: set TMPDIR to one."
        ) from error
    with held as place:
        yield Path(place)


def put_text(path: Path, text: str | bytes) -> None:
    """Write a text into a folder that is being filled, down to the disk.

    Parameters
    ----------
    path, text : in UTF-8, or bytes as they are.
    """
    with path.open("wb") as file:
        file.write(text if isinstance(text, bytes) else text.encode(errors="replace"))
        file.flush()
        os.fsync(file.fileno())


def files_in_place() -> bool:
    """Return whether finished files have taken their places since the program began."""
    return _done.is_set()


@contextmanager
def uninterrupted() -> Generator[None, None, None]:
    """Let a stop (Ctrl-C, a request to end) pass unheard for the moment in which finished files take their places.

    It comes too late to stop anything: heard, it would leave one file of two in place.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
        _done.set()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
