"""Options: each means one thing in all commands, the help teaches in 80 columns, and starts without what work needs."""

from __future__ import annotations

import inspect
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import tumble as package
from tumble.cli import groups
from tumble.cli.groups import flowing
from tumble.cli.main import COMMANDS, app, first_sentence
from tumble.cli.terminal import plain
from tumble.document import read_calibration
from tumble.errors import UsageError
from tumble.workflows.request import FILE, FIRST, PLACE, numbers

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


# A new option of `calibrate`, in two files: its field with its words, and the place that uses it.
BRAND = (
    ("request.py", "    registry : The", "    brand : Who made it.\n    registry : The"),
    (
        "request.py",
        "    registry: str | None = option",
        '    brand: str = option(RECORD, "NAME", default="")\n    registry: str | None = option',
    ),
    ("calibrate.py", "notes_of(request.notes),", '{**notes_of(request.notes), "brand": request.brand},'),
)


def test_a_new_option_of_calibrate_is_two_files_and_goes_with_several_turn_ons_and_batches(
    sessions: Callable[..., np.ndarray], written: Callable[..., Path], tmp_path: Path
) -> None:
    home, units = Path(package.__file__).parent, tmp_path / "units"
    shutil.copytree(home, tmp_path / "tumble", ignore=shutil.ignore_patterns("__pycache__"))
    for name, before, after in BRAND:
        file = tmp_path / "tumble/workflows" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(before) == 1
        file.write_text(text.replace(before, after), encoding="utf-8")
    units.mkdir()
    files = [written(units / f"{seed}.csv", sessions(seed, holds=12)) for seed in (3, 4)]
    for call in (
        ["calibrate", files[0]],
        ["calibrate", *files],
        ["calibrate", *files, "--turn-ons"],
        ["batch", units, "--workers", "1"],
    ):
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                RUN,
                *call,
                "--gravity",
                "9.81",
                "--brand",
                "ours",
                "-o",
                tmp_path / "made",
            ],
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode in (0, 1), done.stderr
        made = [*(tmp_path / "made").rglob("calibration.json")]
        assert [read_calibration(file).notes["brand"] for file in made] == ["ours"] * len(made)
        assert len(made) == (2 if call[0] == "batch" else 1)
        shutil.rmtree(tmp_path / "made")


def test_a_help_text_flows_and_its_examples_stay() -> None:
    assert (
        flowing("One\ntwo.\n\ntumble demo -o x\n\nThree\nfour.")
        == "One two.\n\ntumble demo -o x\n\nThree four."
    )


def test_numbers_that_are_none_are_refused() -> None:
    assert numbers("1,2.5", "--x", 2) == (1.0, 2.5)
    for wrong in ("", "1,,2", "nan", "1,inf", "a"):
        with pytest.raises(UsageError, match="--x takes 2 numbers"):
            numbers(wrong, "--x", 2)
    with pytest.raises(UsageError, match="3 numbers"):
        numbers("1,2", "--x", 3)


def test_what_a_terminal_obeys_is_written_out() -> None:
    assert plain("a\x1b[31mb\u202ec\x9bd\udcffe\tf\n") == "a\\x1b[31mb\\u202ec\\x9bd\\xffe\tf\n"


HEAVY = ("numpy", "scipy", "polars", "yaml", "plotly", "jinja2")


def test_the_help_of_no_command_imports_anything_heavy() -> None:
    commands = [name for name in COMMANDS if name != "capture"]  # whose guide's events are numpy's
    code = (
        "import sys\nfrom tumble.cli.main import main\n"
        f"for command in {commands!r}:\n"
        "    sys.argv = ['tumble', command, '--help']\n"
        "    try: main()\n    except SystemExit: pass\n"
        f"sys.exit(' '.join(name for name in {HEAVY!r} if name in sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert answer.stdout.count("Usage: tumble") == len(commands)


def test_the_list_of_commands_imports_none_of_them() -> None:
    code = (
        "import sys\nfrom tumble.cli.main import main\nsys.argv = ['tumble', '--help']\n"
        "try: main()\nexcept SystemExit: pass\n"
        f"sys.exit(' '.join(n for n in {(*HEAVY, 'rich.markdown', 'tumble.cli.options')!r} if n in sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert all(f"\n  {name} " in answer.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_says_what_the_command_says(name: str) -> None:
    room = import_module(f"tumble.cli.{COMMANDS[name]}")
    words = room.app.info.help if hasattr(room, "app") else getattr(room, f"{name}_command").__doc__
    assert " ".join(inspect.cleandoc(words).split("\n\n")[0].split()) == first_sentence(name)


def _said(*words: str) -> str:
    with pytest.raises(UsageError) as raised:
        typer.main.get_command(app).main(list(words), prog_name="tumble", standalone_mode=False)
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
    typer.main.get_command(app).main(["convert"], prog_name="tumble", standalone_mode=False)


def test_every_sentence_of_what_left_is_one_and_its_command_or_option_is_no_longer_there() -> None:
    program = typer.main.get_command(app)
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
