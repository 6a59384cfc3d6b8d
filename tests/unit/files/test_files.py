"""Files of unknown origin are read whole or refused in words, soon; a result is a regular file, no input, and whole."""

import os
from pathlib import Path

import pytest

from tumble.errors import OutputError, UsageError
from tumble.files import (
    check_target,
    filled_folder,
    inputs_kept,
    lines_of,
    number_of,
    opened,
    read_json,
    read_text,
    read_yaml,
    shown,
    size_of,
    write_text,
    write_texts,
)

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.json", "[" * 100_000, "nested too deeply"),
        ("a.json", "[" * 200 + "]" * 200, "nested too deeply"),
        ("a.json", '{"n": ' + "9" * 5000 + "}", "99…, which cannot be"),
        ("a.json", '{"imu": {"model": "\\ud800"}}', "half a character"),
        ("a.json", '{"\\udfff": 1}', "half a character"),
        ("a.json", '{"a": {"bias": [1], "matrix": 2, "bias": [3]}}', 'the key "bias" twice'),
        ("a.json", '{"a\\n": 1, "a\\n": 1}', "a<U\\+000A>"),
        ("a.json", "[1, 2", "no JSON"),
        ("a.json", "", "no JSON"),
        ("a.yaml", BOMB, "aliases repeat"),
        ("a.yaml", "a: &a [*a]", "refers to itself"),
        ("a.yaml", "[" * 400_000 + "]" * 400_000, "nested too deeply"),
        ("a.yaml", "n: " + "9" * 5000, "cannot be"),
        ("a.yaml", "day: 2001-99-99", "cannot be"),
        ("a.yaml", "? [a]\n: b", "no YAML"),
        ("a.yaml", "a: 1\nb: {c: 1, d: 2, c: 3}", 'the key "c" twice'),
        ("a.yaml", "- {c: 1, 'c': 3}", 'the key "c" twice'),
        ("a.yaml", "{a: [1, 2}", "mistake in line 1"),
        ("a.yaml", "!!python/object/apply:os.system ['true']", "no YAML"),
    ],
    ids=range(19),
)
def test_documents_that_cannot_be_are_refused_in_words(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    read = read_json if name == "a.json" else read_yaml
    with pytest.raises(ValueError, match=words):
        read(tmp_path / name)


def test_documents_that_can_be_are_read(tmp_path, monkeypatch):
    """A pair of halves is a character; OpenCV's first line and a few aliases are YAML; each has its limit."""
    file = tmp_path / "document"
    file.write_text('{"name": "\\ud83d\\ude00"}')
    assert read_json(file) == {"name": "\U0001f600"}
    file.write_text("%YAML:1.0\na: &a [1, 2]\nb: *a\n")
    assert read_yaml(file) == {"a": [1, 2], "b": [1, 2]}
    file.write_bytes(b"\xef\xbb\xbf1 2\n")
    assert read_text(file) == "1 2\n"
    with pytest.raises(OSError, match="longer"):
        read_text(file, 3)
    file.write_text('{"a": "' + "x" * 5000 + '"}')
    with pytest.raises(OSError, match="longer than 4 kB"):
        read_json(file, 4096)
    monkeypatch.setattr("tumble.files.documents.LARGEST_YAML", 4096)
    with pytest.raises(OSError, match="longer than 4 kB"):
        read_yaml(file)


def test_nothing_is_taken_from_a_pipe_that_is_refused():
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
def test_devices_and_folders_are_refused_in_words(name, words):
    with pytest.raises(OSError, match=words):
        size_of(Path(name))


# -- numbers and lines -------------------------------------------------------------------------------

NO_NUMBERS = [True, None, [], "", "x", "1_0", "\u0661", "nan", "inf", "1e999", "1" * 5000, "0x10"]
NO_NUMBERS += [10**400, float("inf")]


def test_numbers_are_numbers_and_everything_else_is_none():
    assert [number_of(value) for value in (1, 1.0, "1", " +1.0e0 ")] == [1.0] * 4
    for value in NO_NUMBERS:
        with pytest.raises(ValueError, match=r"number|finite|large"):
            number_of(value)


def test_a_line_ends_where_an_editor_ends_it_and_hidden_characters_are_shown_by_their_numbers():
    assert lines_of("a\x0cb\u2028c\x85d\x0be\r\nf\rg\n") == ["a\x0cb\u2028c\x85d\x0be", "f", "g"]
    assert shown("a\x1b[2J\nb\u202ec") == "a<U+001B>[2J<U+000A>b<U+202E>c"
    assert shown("Größe 1 µm") == "Größe 1 µm"


# -- writing -----------------------------------------------------------------------------------------


def test_an_input_is_not_written_over(tmp_path):
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
def test_what_is_no_ordinary_file_is_not_replaced(kind, tmp_path):
    place = {"device": Path("/dev/null"), "pipe": tmp_path / "pipe", "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(place)
    before = place.stat()
    for write in (check_target, lambda place: write_text(place, "new")):
        with pytest.raises(UsageError, match=f"is a {kind}"):
            write(place)
    assert place.stat().st_ino == before.st_ino


def test_several_texts_come_together_or_not_at_all(tmp_path):
    (tmp_path / "second").mkdir()
    with pytest.raises(UsageError):
        write_texts({tmp_path / "first": "1", tmp_path / "second": "2"})
    assert [path.name for path in tmp_path.iterdir()] == ["second"]
    texts = {tmp_path / "a" / "x": "1", tmp_path / "b": "caf\udce9.csv, σ"}
    assert write_texts(texts) == list(texts)
    assert (tmp_path / "b").read_text(encoding="utf-8") == "caf?.csv, σ"  # a name that was no UTF-8
    with pytest.raises(OutputError, match="cannot be made"):
        write_text(tmp_path / "b" / "new", "text")


def test_a_filled_folder_takes_the_place_of_what_it_replaces(tmp_path):
    for name in ("kept", "both"):
        (tmp_path / name).write_text(name)
    with filled_folder(tmp_path) as beside:
        (beside / "both").write_text("new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"kept": "kept", "both": "new"}
    with pytest.raises(OSError, match="stop"), filled_folder(tmp_path / "never"):
        raise OSError("stop")
    assert not (tmp_path / "never").exists()


@pytest.mark.parametrize("name", ["x" * 255, "é" * 127 + "a", "calibration.json"])
def test_a_name_may_be_as_long_as_the_disk_has_names(name, tmp_path):
    write_texts({tmp_path / name: "new", tmp_path / (name[:-1] + "b"): "other"})
    assert (tmp_path / name).read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 2
