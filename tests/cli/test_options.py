"""Options: each means one thing in all commands, and the help teaches in 80 columns."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from tumble.cli.groups import FILE, FIRST, PLACE, flowing, numbers
from tumble.cli.main import COMMANDS, PANELS, app
from tumble.cli.terminal import plain
from tumble.errors import UsageError

RUN = "import sys; from tumble.cli.main import main; sys.argv[0] = 'tumble'; main()"
NEEDED = (FIRST, PLACE, FILE)
# Of these only where a result is written, and how much is printed, differs between commands.
OF_EACH_COMMAND = {"--output", "--quiet", "--verbose", "--help"}


@cache
def parameters() -> dict[str, list[tuple[str, Any]]]:
    """Spelling -> each command that has it, and what it is there."""
    found: dict[str, list[tuple[str, Any]]] = defaultdict(list)
    program: Any = typer.main.get_command(app)
    for name, command in program.commands.items():
        for parameter in command.params:
            for spelling in [*parameter.opts, *parameter.secondary_opts]:
                if parameter.param_type_name == "option" and spelling.startswith("--"):
                    found[spelling].append((name, parameter))
    return found


def test_an_option_takes_the_same_kind_of_value_in_every_command() -> None:
    several = {s: found for s, found in parameters().items() if len(found) > 1 and s not in OF_EACH_COMMAND}
    assert len(several) > 12
    kinds = {
        s: {type(p.default).__name__ for _, p in found if p.default is not None}
        for s, found in several.items()
    }
    metavars = {
        s: {(p.metavar or "").split("|")[0].split(",")[0] for _, p in found} for s, found in several.items()
    }
    assert not {s for s, of in kinds.items() if len(of) > 1}
    assert not {s for s, of in metavars.items() if len(of) > 1}


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_the_help_fits_into_80_columns_and_cuts_no_name(command: str) -> None:
    plain = {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}
    answer = CliRunner().invoke(app, [command, "--help"], env=plain)
    assert answer.exit_code == 0, answer.output
    lines = answer.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    for spelling, found in parameters().items():
        if command in dict(found) and spelling != "--help" and not dict(found)[command].hidden:
            assert any(spelling in line for line in lines), spelling
    # Options that people need first stand first, what all commands have last.
    titles = [line for line in lines if line and line[0] not in " UW" and not line.endswith(".")]
    if "What people need first" in titles:
        after = titles[titles.index("What people need first") :]
        assert after[-1] == "What is printed"


def test_few_options_are_shown_and_ten_at_most_come_first() -> None:
    program: Any = typer.main.get_command(app)
    for name, command in program.commands.items():
        needed = [p.opts[0] for p in command.params if getattr(p, "rich_help_panel", "") in NEEDED]
        shown = [one for one in needed if not parameters()[one] or not dict(parameters()[one])[name].hidden]
        assert len(shown) <= 10, (name, shown)
    assert len({s for s, found in parameters().items() if not all(p.hidden for _, p in found)}) < 110


def test_every_command_stands_in_one_panel_of_the_help() -> None:
    assert sorted(name for names in PANELS.values() for name in names) == sorted(COMMANDS)


def test_a_chip_is_a_kind_of_units(tumble: Any, tmp_path: Path) -> None:
    path = tmp_path / "counts.csv"
    rows = [
        "t,ax,ay,az,gx,gy,gz",
        *(f"{0.01 * k:.2f},{k % 3},{-k % 5},{8192 + k % 4},1,-2,{k % 2}" for k in range(600)),
    ]
    path.write_text("\n".join(rows), encoding="utf-8")
    first = tumble("inspect", path, "--units", "mpu6050,4g,500dps")
    assert "8192 LSB/g" in first.out
    tumble("inspect", path, "--chip", "mpu6050,4g,500dps").is_told(2, "a part of --units")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("calibrate --procedure m", {"modified-multi-position", "multi-position"}),
        ("calibrate --protocol rate", {"rate-table"}),
        ("simulate --imu hg", {"hg1900", "hg1700"}),
        ("simulate strap", {"strapdown-rotation"}),
        ("convert --to kalib", {"kalibr", "kalibr-noise"}),
        ("calib", {"calibrate"}),
        ("calibrate --proc", {"--procedure"}),
    ],
)
def test_the_shell_completes_names_from_the_registries(words: str, found: set[str]) -> None:
    answer = subprocess.run(
        [sys.executable, "-c", RUN],
        env={
            **os.environ,
            "_TUMBLE_COMPLETE": "complete_bash",
            "COMP_WORDS": f"tumble {words}",
            "COMP_CWORD": str(len(words.split())),
        },
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert set(answer.stdout.split()) == found, answer
    assert not answer.stderr


def test_a_help_text_flows_and_its_examples_stay() -> None:
    assert (
        flowing("One\ntwo.\n\ntumble demo -o x\n\nThree\nfour.")
        == "One two.\n\ntumble demo -o x\n\nThree four."
    )


def test_numbers_that_are_none_are_refused() -> None:
    assert numbers("1,2.5", "--x") == (1.0, 2.5)
    for wrong in ("", "1,,2", "nan", "1,inf", "a"):
        with pytest.raises(UsageError, match="--x takes numbers"):
            numbers(wrong, "--x")
    with pytest.raises(UsageError, match="3 numbers"):
        numbers("1,2", "--x", 3)


def test_what_a_terminal_obeys_is_written_out() -> None:
    assert plain("a\x1b[31mb\u202ec\x9bd\udcffe\tf\n") == "a\\x1b[31mb\\u202ec\\x9bd\\xffe\tf\n"
