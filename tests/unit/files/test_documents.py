"""JSON and YAML of unknown origin are read whole or refused in words, soon and without much memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from tumble.files import read_json, read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 100_000, "nested too deeply"),
        ("[" * 200 + "]" * 200, "nested too deeply"),
        ('{"n": ' + "9" * 5000 + "}", "99…, which cannot be"),
        ('{"imu": {"model": "\\ud800"}}', "half a character"),
        ('{"\\udfff": 1}', "half a character"),
        ('{"a": {"bias": [1], "matrix": 2, "bias": [3]}}', 'the key "bias" twice'),
        ('{"a\\n": 1, "a\\n": 1}', "a<U\\+000A>"),
        ("[1, 2", "no JSON"),
        ("", "no JSON"),
    ],
)
def test_json_that_cannot_be_is_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "document.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_json(file)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "aliases repeat"),
        ("a: &a [*a]", "refers to itself"),
        ("[" * 400_000 + "]" * 400_000, "nested too deeply"),
        ("n: " + "9" * 5000, "cannot be"),
        ("day: 2001-99-99", "cannot be"),
        ("? [a]\n: b", "no YAML"),
        ("a: 1\nb: {c: 1, d: 2, c: 3}", 'the key "c" twice'),
        ("- {c: 1, 'c': 3}", 'the key "c" twice'),
        ("{a: [1, 2}", "mistake in line 1"),
        ("!!python/object/apply:os.system ['true']", "no YAML"),
    ],
)
def test_yaml_that_cannot_be_is_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "document.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_yaml(file)


def test_a_pair_of_halves_is_a_character(tmp_path: Path) -> None:
    (file := tmp_path / "document.json").write_text('{"name": "\\ud83d\\ude00"}')
    assert read_json(file) == {"name": "\U0001f600"}


def test_yaml_with_opencvs_first_line_and_few_aliases_is_read(tmp_path: Path) -> None:
    file = tmp_path / "document.yaml"
    file.write_text("%YAML:1.0\na: &a [1, 2]\nb: *a\n")
    assert read_yaml(file) == {"a": [1, 2], "b": [1, 2]}


def test_a_document_beyond_its_limit_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "document"
    file.write_text('{"a": "' + "x" * 5000 + '"}')
    with pytest.raises(OSError, match="longer than 4 kB"):
        read_json(file, 4096)
    monkeypatch.setattr("tumble.files.documents.LARGEST_YAML", 4096)
    with pytest.raises(OSError, match="longer than 4 kB"):
        read_yaml(file)
