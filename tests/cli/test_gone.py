"""What left answers with what to do instead."""

from __future__ import annotations

import pytest
from typer.main import get_command

from tumble.cli import groups
from tumble.cli.main import app
from tumble.errors import UsageError


def _said(*words: str) -> str:
    with pytest.raises(UsageError) as raised:
        get_command(app).main(list(words), prog_name="tumble", standalone_mode=False)
    return str(raised.value)


def test_a_command_that_left_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    left = {"commands": {"fly": "tumble fly has left: walk."}}
    monkeypatch.setattr(groups, "what_left", lambda: left)
    assert _said("fly", "away", "--far") == "tumble fly has left: walk."


@pytest.mark.parametrize("words", [("--wings", "2"), ("--wings=2",), ("--set", "wings=2"), ("--set=wings",)])
@pytest.mark.parametrize("command", ["simulate", "inspect"])
def test_an_option_that_left_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, command: str, words: tuple[str, ...]
) -> None:
    left = {"options": {command: {"--wings": "--wings has left: use legs."}}}
    monkeypatch.setattr(groups, "what_left", lambda: left)
    assert _said(command, "something", *words) == "--wings has left: use legs."


def test_a_command_without_arguments_is_let_pass() -> None:
    get_command(app).main(["convert"], prog_name="tumble", standalone_mode=False)


def test_every_sentence_of_what_left_is_one_and_its_command_or_option_is_no_longer_there() -> None:
    program = get_command(app)
    for name, sentence in groups.what_left()["commands"].items():
        assert sentence.endswith(".")
        assert not _found(program, name), name
    for name, options in groups.what_left()["options"].items():
        if name != "every command":
            command = _found(program, name)
            assert command, name
            there = {spelling for one in command.params for spelling in one.opts}
            assert not there & set(options)
        assert all(option.startswith("-") and text.endswith(".") for option, text in options.items())


def _found(program: object, name: str) -> object:
    for word in name.split():
        inside = getattr(program, "commands", {})
        if word not in inside:
            return None
        program = inside[word]
    return program
