"""The one gate: every file that a user names is an ordinary one of a bounded size, or is refused in one sentence."""

import os
from pathlib import Path

import pytest
from tests.fuzz.seeds import HEADER, calibrations, rows, text
from typer.main import get_command

from tumble.cli import app
from tumble.errors import TumbleError

READERS = [
    "inspect {}",
    "calibrate {} -o made",
    "calibrate hand.csv --prior {} -o made",
    "calibrate hand.csv --noise {} -o made",
    "calibrate hand.csv --intervals {} -o made",
    "calibrate hand.csv --protocol {} -o made",
    "calibrate hand.csv --limits {} -o made",
    "apply {} hand.csv -o made.csv",
    "apply calibration.json {} -o made.csv",
    "verify calibration.json {}",
    "verify calibration.json hand.csv --gnss {}",
    "convert --from kalibr {} -o made.json",
    "convert --from ardupilot {} -o made.json",
    "convert --from px4 {} -o made.json",
    "convert calibration.json --to kalibr --noise {} -o made.yaml",
    "diff calibration.json {}",
    "noise {}",
    "simulate {} -o made",
    "simulate hand-held --errors {} -o made",
]
DOCUMENTS = [
    words
    for words in READERS
    if any(w in words for w in ("prior", "--noise", "protocol", "limits", "--from", "--errors"))
]
BOMB = "format: tumble protocol\na0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12)
)


@pytest.fixture
def refused(tmp_path, monkeypatch):
    """What the program says of a call in a folder with sound files, and that it writes nothing."""
    (tmp_path / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
    (tmp_path / "calibration.json").write_bytes(calibrations()[0][1])
    monkeypatch.chdir(tmp_path)

    def call(words: str) -> str:
        before = sorted(tmp_path.iterdir())
        with pytest.raises(TumbleError) as raised:
            get_command(app).main(words.split(), prog_name="tumble", standalone_mode=False)
        assert raised.value.exit_status == 2
        assert sorted(tmp_path.iterdir()) == before
        said = str(raised.value)
        assert "\n" not in said
        assert len(said) < 400
        return said

    return call


@pytest.mark.parametrize("place", ["/dev/zero", "pipe"])
@pytest.mark.parametrize("words", READERS)
def test_every_reader_refuses_a_device_and_a_pipe(refused, words, place):
    os.mkfifo("pipe")
    said = refused(words.format(place))
    assert {"/dev/zero": "a device", "pipe": "a pipe"}[place] in said


@pytest.mark.parametrize("words", DOCUMENTS)
def test_every_reader_of_documents_refuses_what_is_too_long_too_deep_or_no_text(refused, words):
    with Path("bad").open("wb") as file:
        file.truncate(600 << 20)
    assert "longer than" in refused(words.format("bad"))
    for content in (b"[" * 100_000, b"\xff\xfe\xff" * 9, BOMB.encode()):
        Path("bad").write_bytes(content)
        assert "bad" in refused(words.format("bad"))
