"""A result is a regular file, never an input, never a device, and whole."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tumble.errors import OutputError, UsageError
from tumble.files import check_target, filled_folder, inputs_kept, write_text, write_texts


def test_an_input_is_not_written_over(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    file.write_text("precious")
    (tmp_path / "link.json").symlink_to(file)
    with inputs_kept([tmp_path]):
        for place in (file, tmp_path / "link.json", tmp_path / "." / "calibration.json"):
            with pytest.raises(UsageError, match="one of the inputs"):
                write_text(place, "new")
    assert file.read_text() == "precious"
    write_text(file, "new")
    assert file.read_text() == "new"


@pytest.mark.parametrize("kind", ["device", "pipe", "folder"])
def test_what_is_no_ordinary_file_is_not_replaced(kind: str, tmp_path: Path) -> None:
    place = {"device": Path("/dev/null"), "pipe": tmp_path / "pipe", "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(place)
    before = place.stat()
    with pytest.raises(UsageError, match=f"is a {kind}"):
        check_target(place)
    with pytest.raises(UsageError, match=f"is a {kind}"):
        write_text(place, "new")
    assert place.stat().st_ino == before.st_ino


def test_several_texts_come_together_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "second").mkdir()
    with pytest.raises(UsageError):
        write_texts({tmp_path / "first": "1", tmp_path / "second": "2"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["second"]
    assert write_texts({tmp_path / "a" / "x": "1", tmp_path / "b": "2"}) == [
        tmp_path / "a" / "x",
        tmp_path / "b",
    ]


def test_a_name_that_is_no_utf_8_can_be_written_into_a_text(tmp_path: Path) -> None:
    write_text(tmp_path / "file", "caf\udce9.csv, σ")
    assert (tmp_path / "file").read_text(encoding="utf-8") == "caf?.csv, σ"


def test_a_filled_folder_takes_the_place_of_what_it_replaces(tmp_path: Path) -> None:
    for name in ("kept", "both"):
        (tmp_path / name).write_text(name)
    with filled_folder(tmp_path) as beside:
        (beside / "both").write_text("new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"kept": "kept", "both": "new"}
    with pytest.raises(OSError, match="stop"), filled_folder(tmp_path / "never"):
        raise OSError("stop")
    assert not (tmp_path / "never").exists()


def test_a_folder_under_a_file_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be made"):
        write_text(tmp_path / "file" / "new", "text")


@pytest.mark.parametrize("name", ["x" * 255, "é" * 127 + "a", "calibration.json"])
def test_a_name_may_be_as_long_as_the_disk_has_names(name: str, tmp_path: Path) -> None:
    write_texts({tmp_path / name: "new", tmp_path / (name[:-1] + "b"): "other"})
    assert (tmp_path / name).read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 2
