"""Only ordinary files are opened: a pipe is refused at once and in words, and nothing of it is lost."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tumble.files import opened, read_text, size_of


def test_nothing_is_taken_from_a_pipe_that_is_refused() -> None:
    reading, writing = os.pipe()
    try:
        os.write(writing, b"t,ax,ay,az\n")
        with pytest.raises(OSError, match="a pipe"):
            opened(Path(f"/dev/fd/{reading}"))
        assert os.read(reading, 100) == b"t,ax,ay,az\n"
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.parametrize(("name", "words"), [("/dev/zero", "a device"), ("/", "a folder")])
def test_devices_and_folders_are_refused_in_words(name: str, words: str) -> None:
    with pytest.raises(OSError, match=words):
        size_of(Path(name))


def test_a_text_may_have_the_mark_of_utf_8_and_no_more_than_its_limit(tmp_path: Path) -> None:
    file = tmp_path / "text"
    file.write_bytes(b"\xef\xbb\xbf1 2\n")
    assert read_text(file) == "1 2\n"
    with pytest.raises(OSError, match="longer"):
        read_text(file, 3)
