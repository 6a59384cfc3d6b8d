"""The commands on the pages are the commands that there are, option by option."""

import re
import sys
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tumble.cli import app

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z]")


@cache
def help_of(*command: str) -> str:
    """What `tumble COMMAND --help` prints, without colours and wide enough not to break a line."""
    plain = {"NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "240"}
    answer = CliRunner().invoke(app, [*command, "--help"], env=plain)
    assert answer.exit_code == 0, f"tumble {' '.join(command)} --help: {answer.output}"
    return answer.stdout


def commands_of(text: str) -> list[str]:
    """The names at the start of the rows of a help text."""
    return re.findall(r"^  ([a-z][a-z-]*)(?=\s{2,}|$)", text, re.M)


def options_of(command: str) -> set[str]:
    """The options that a command's help lists at the start of a row, `--help` apart; of a group, of its commands."""
    rows = re.findall(r"^[│|* ]*(-[-\w]+(?:[ ,/]+-[-\w]+)*)", help_of(command), re.M)
    if "COMMAND" in help_of(command).partition("\n")[0]:
        for one in commands_of(help_of(command)):
            rows += re.findall(r"^[│|* ]*(-[-\w]+(?:[ ,/]+-[-\w]+)*)", help_of(command, one), re.M)
    return {option for row in rows for option in OPTION.findall(row)} - {"--help"}


def sections() -> dict[str, str]:
    """The text of each command's section on the page of commands."""
    parts = re.split(r"^## tumble ([a-z-]+)$", COMMANDS, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_command_has_a_section_and_every_section_a_command() -> None:
    assert set(sections()) == set(commands_of(help_of()))


def common_options() -> set[str]:
    """Options that the page explains once, ahead of the commands."""
    return set(OPTION.findall(COMMANDS.partition("\n## ")[0]))


@pytest.mark.parametrize("command", sorted(sections()))
def test_every_documented_option_exists(command: str) -> None:
    written = set(OPTION.findall(sections()[command]))
    assert written <= options_of(command), "documented, but not there"


def test_the_site_has_every_option_of_every_command() -> None:
    sys.path.insert(0, str(ROOT / "docs" / "site"))
    from command_pages import command_page, commands

    for name, command in commands():
        page = command_page(name, command)
        for parameter in command.params:
            assert all(f"`{spelling}`" in page for spelling in parameter.opts if spelling.startswith("--")), (
                name
            )


def test_every_common_option_exists_somewhere() -> None:
    there = {option for command in sections() for option in options_of(command)}
    there |= set(OPTION.findall(help_of()))
    assert common_options() - {"--help"} <= there


@pytest.mark.parametrize("command", sorted(set(re.findall(r"^\$ tumble (\S+)", README, re.M))))
def test_every_command_of_the_readme_exists_with_its_options(command: str) -> None:
    lines = re.findall(rf"^\$ tumble {command} .*$", README, re.M)
    assert {option for line in lines for option in OPTION.findall(line)} <= options_of(command)


def test_the_readme_shows_the_demo_and_the_four_steps() -> None:
    shown = re.findall(r"^\$ tumble (\S+)", README, re.M)
    assert shown == ["demo", "inspect", "calibrate", "apply", "verify"]
