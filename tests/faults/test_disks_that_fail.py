"""A disk that fails at any write, close or rename: the earlier result is whole, nothing is left, one sentence."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.fuzz.seeds import HEADER, rows, seeds, text

from tumble.document import read_calibration
from tumble.errors import OutputError
from tumble.files import write_text, write_texts
from tumble.protocol import read_protocol, write_protocol
from tumble.recording import read_recording, write_recording


class Disk:
    """Counts what a writer asks of the disk, and fails at one of the calls."""

    def __init__(self, monkeypatch, fails_at=-1, error=errno.ENOSPC):
        self.calls, self.fails_at, self.error = 0, fails_at, error
        for owner, name in ((os, "fsync"), (Path, "replace")):
            monkeypatch.setattr(owner, name, self.counted(getattr(owner, name)))
        opened = Path.open

        def open_counted(path: Path, mode: str = "r", *more: Any, **options: Any) -> Any:
            if "w" not in mode:
                return opened(path, mode, *more, **options)
            file = self.counted(opened)(path, mode, *more, **options)
            return _Failing(file, self) if hasattr(getattr(file, "buffer", file), "raw") else file

        monkeypatch.setattr(Path, "open", open_counted)

    def counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def counting(*arguments: Any, **options: Any) -> Any:
            self.calls += 1
            if self.calls == self.fails_at:
                raise OSError(self.error, os.strerror(self.error))
            return call(*arguments, **options)

        return counting


class _Failing:
    """An open file whose writes and flushes are counted."""

    def __init__(self, file: Any, disk: Disk) -> None:
        self._file = file
        self.write, self.flush = disk.counted(file.write), disk.counted(file.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self):
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def writers(folder: Path) -> dict[str, Callable[[Path], Any]]:
    """What writes results, each to one place."""
    (folder / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
    (folder / "in.json").write_bytes(seeds()["calibration"][0][1])
    (folder / "in.yaml").write_bytes(seeds()["protocol"][0][1])
    recording, protocol = read_recording(folder / "hand.csv"), read_protocol(folder / "in.yaml")
    return {
        "text": lambda path: write_text(path, "new\n" * 1000),
        "texts": lambda path: write_texts({path: "new\n", path.with_name("second"): "new\n"}),
        "calibration.json": read_calibration(folder / "in.json").write,
        "protocol.yaml": lambda path: write_protocol(protocol, path),
        "out.csv": lambda path: write_recording(recording, path),
    }


@pytest.mark.parametrize("name", ["text", "texts", "calibration.json", "protocol.yaml", "out.csv"])
@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EROFS])
def test_an_earlier_result_is_whole_wherever_the_disk_fails(tmp_path, monkeypatch, name, error):
    write = writers(tmp_path)[name]
    place = tmp_path / "results" / name
    place.parent.mkdir()
    with monkeypatch.context() as patch:
        disk = Disk(patch)
        write(place)
    assert disk.calls >= 3
    for call in range(1, disk.calls + 1):
        for file in place.parent.iterdir():
            file.write_text("old")
        with monkeypatch.context() as patch:
            Disk(patch, call, error)
            with pytest.raises(OutputError, match=os.strerror(error)):
                write(place)
        names = {file.name: file.read_text() for file in place.parent.iterdir()}
        new = [file for file, content in names.items() if content != "old"]
        # Of several files one may have taken its place when the rename of another fails.
        assert len(new) <= (name == "texts" and call == disk.calls), new
        assert not any(file.startswith(".") for file in names)
