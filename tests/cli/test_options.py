"""Options: each means one thing in all commands, the help teaches in 80 columns, and starts without what work needs."""

import inspect
import shutil
import subprocess
import sys
from collections import defaultdict
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from tests.cli.program import Bench, tumbled_rows
from typer.testing import CliRunner

import tumble as package
from tumble.cli import groups
from tumble.cli.application import COMMANDS, app, first_sentence
from tumble.cli.groups import flowing
from tumble.cli.terminal import plain
from tumble.document import read_calibration
from tumble.errors import UsageError
from tumble.workflows import FILE, FIRST, PLACE, numbers

PROGRAM: Any = typer.main.get_command(app)
# Of these only where a result is written, and how much is printed, differs between commands.
OF_EACH_COMMAND = {"--output", "--quiet", "--verbose", "--help"}


@cache
def parameters() -> dict[str, dict[str, Any]]:
    """Spelling -> each command that has it, and what it is there."""
    found: dict[str, dict[str, Any]] = defaultdict(dict)
    for name, command in PROGRAM.commands.items():
        for parameter in command.params:
            for spelling in [*parameter.opts, *parameter.secondary_opts]:
                if parameter.param_type_name == "option" and spelling.startswith("--"):
                    found[spelling][name] = parameter
    return found


def test_an_option_takes_the_same_kind_of_value_in_every_command() -> None:
    several = {s: found for s, found in parameters().items() if len(found) > 1 and s not in OF_EACH_COMMAND}
    assert len(several) > 12
    for spelling, found in several.items():
        assert len({type(p.default) for p in found.values() if p.default is not None}) <= 1, spelling
        assert len({(p.metavar or "").split("|")[0].split(",")[0] for p in found.values()}) == 1, spelling


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_the_help_fits_into_80_columns_and_cuts_no_name(command: str) -> None:
    answer = CliRunner().invoke(
        app, [command, "--help"], env={"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}
    )
    assert answer.exit_code == 0, answer.output
    lines = answer.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    for spelling, found in parameters().items():
        if command in found and spelling != "--help" and not found[command].hidden:
            assert any(spelling in line for line in lines), spelling
    # Options that people need first stand first, what all commands have last.
    titles = [line for line in lines if line and line[0] not in " UW" and not line.endswith(".")]
    if "What people need first" in titles:
        assert titles[-1] == "What is printed"
    # And the list of commands says what the command says.
    room = import_module(f"tumble.cli.{COMMANDS[command]}")
    words = room.app.info.help if hasattr(room, "app") else getattr(room, f"{command}_command").__doc__
    assert " ".join(inspect.cleandoc(words).split("\n\n")[0].split()) == first_sentence(command)


def test_few_options_are_shown_and_ten_at_most_come_first() -> None:
    for name, command in PROGRAM.commands.items():
        first = [p for p in command.params if getattr(p, "rich_help_panel", "") in (FIRST, PLACE, FILE)]
        shown = [p.opts[0] for p in first if p.param_type_name == "argument" or not p.hidden]
        assert len(shown) <= 10, (name, shown)
    assert sum(not all(p.hidden for p in found.values()) for found in parameters().values()) < 110


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
def test_the_shell_completes_names_from_the_registries(tmp_path: Path, words: str, found: set[str]) -> None:
    asked = {"COMP_WORDS": f"tumble {words}", "COMP_CWORD": str(len(words.split()))}
    answer = Bench(tmp_path).apart(_TUMBLE_COMPLETE="complete_bash", **asked)
    assert set(answer.stdout.decode().split()) == found, answer
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


def test_a_new_option_of_calibrate_is_two_files_and_goes_with_several_turn_ons_and_batches(tmp_path):
    shutil.copytree(
        Path(package.__file__).parent, tmp_path / "tumble", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name, before, after in BRAND:
        file = tmp_path / "tumble/workflows" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(before) == 1
        file.write_text(text.replace(before, after), encoding="utf-8")
    (tmp_path / "units").mkdir()
    bench = Bench(tmp_path)
    for seed in (3, 4):
        bench.write(f"units/{seed}.csv", tumbled_rows(seed, holds=12))
    both = "units/3.csv units/4.csv"
    for number, (call, count) in enumerate(
        (
            ("calibrate units/3.csv", 1),
            (f"calibrate {both}", 1),
            (f"calibrate {both} --turn-ons", 1),
            ("batch units --workers 1", 2),
        )
    ):
        folder = f"made{number}"
        done = bench.apart(call, f"--gravity 9.81 --brand ours -o {folder}", PYTHONPATH=str(tmp_path))
        assert done.returncode in (0, 1), done.stderr
        made = [*(tmp_path / folder).rglob("calibration.json")]
        assert [read_calibration(file).notes["brand"] for file in made] == ["ours"] * count


def test_numbers_and_texts_for_a_terminal() -> None:
    """A help text flows and its examples stay; what a terminal obeys is written out; wrong numbers are refused."""
    flowed = "One two.\n\ntumble demo -o x\n\nThree four."
    assert flowing("One\ntwo.\n\ntumble demo -o x\n\nThree\nfour.") == flowed
    assert plain("a\x1b[31mb\u202ec\x9bd\udcffe\tf\n") == "a\\x1b[31mb\\u202ec\\x9bd\\xffe\tf\n"
    assert numbers("1,2.5", "--x", 2) == (1.0, 2.5)
    for wrong in ("", "1,,2", "nan", "1,inf", "a", "1", "1,2,3"):
        with pytest.raises(UsageError, match="--x takes 2 numbers"):
            numbers(wrong, "--x", 2)


HEAVY = ("numpy", "scipy", "polars", "yaml", "plotly", "jinja2")
HELPS = """
import sys
from tumble.cli import main
for command in {commands!r}:
    sys.argv = ['tumble', *command, '--help']
    try: main()
    except SystemExit: pass
sys.exit(' '.join(name for name in {heavy!r} if name in sys.modules))
"""


@pytest.mark.parametrize(
    ("commands", "heavy"),
    [
        # of `capture` the guide's events are numpy's
        ([[name] for name in COMMANDS if name != "capture"], HEAVY),
        ([[]], (*HEAVY, "rich.markdown", "tumble.cli.options")),
    ],
)
def test_the_help_imports_nothing_heavy(commands: list[list[str]], heavy: tuple[str, ...]) -> None:
    code = HELPS.format(commands=commands, heavy=heavy)
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, encoding="utf-8")
    assert not answer.stderr.strip()
    assert answer.stdout.count("Usage: tumble") == len(commands)
    assert len(commands) > 1 or all(f"\n  {name} " in answer.stdout for name in COMMANDS)


# --- what left


def _said(*words: str) -> str:
    with pytest.raises(UsageError) as raised:
        PROGRAM.main(list(words), prog_name="tumble", standalone_mode=False)
    return str(raised.value)


@pytest.mark.parametrize("words", [("--wings", "2"), ("--wings=2",), ("--set", "wings=2"), ("--set=wings",)])
@pytest.mark.parametrize("command", ["simulate", "inspect"])
def test_a_command_or_an_option_that_left_says_what_to_do(monkeypatch, command, words):
    left = {
        "commands": {"fly": "tumble fly has left: walk."},
        "options": {command: {"--wings": "--wings has left: use legs."}},
    }
    monkeypatch.setattr(groups, "what_left", lambda: left)
    assert _said("fly", "away", "--far") == "tumble fly has left: walk."
    assert _said(command, "something", *words) == "--wings has left: use legs."
    PROGRAM.main(["convert"], prog_name="tumble", standalone_mode=False)  # without arguments it is let pass


def test_every_sentence_of_what_left_is_one_and_its_command_or_option_is_no_longer_there() -> None:
    for name, sentence in groups.what_left()["commands"].items():
        assert sentence.endswith(".")
        assert not _found(name), name
    for name, options in groups.what_left()["options"].items():
        if name != "every command":
            command = _found(name)
            assert command, name
            assert not {spelling for one in command.params for spelling in one.opts} & set(options)
        assert all(option.startswith("-") and text.endswith(".") for option, text in options.items())


def _found(name: str) -> Any:
    program = PROGRAM
    for word in name.split():
        program = getattr(program, "commands", {}).get(word)
    return program


# --- scipy's functions without their package, which loads itself when anything else is asked of it


@pytest.mark.parametrize(
    ("code", "said"),
    [
        pytest.param(
            "from scipy.special import chdtrc\n"
            "print(round(float(chdtrc(3.0, 7.814728)), 8),"
            " [n for n in ('scipy.special._basic', 'numpy.f2py') if n in sys.modules])",
            # Of three degrees of freedom, chi-square 7.8147 is the 5 % point of every table.
            "0.05 []",
            id="they are scipy's own and nothing else is loaded",
        ),
        pytest.param(
            "import scipy.special as special\n"
            "before = special.chdtrc\n"
            "from scipy.special import comb\n"
            "import scipy.stats\n"
            "print(int(comb(5, 2)), special.chdtrc is before, hasattr(special, 'nothing'))\n"
            "print(round(float(scipy.stats.chi2.ppf(0.95, 3)), 4), 'logsumexp' in special.__all__)",
            "10 True False\n7.8147 True",
            id="what is no such function loads the package as it is",
        ),
        pytest.param(
            "from concurrent.futures import ThreadPoolExecutor\n"
            "import scipy.special as s\n"
            "with ThreadPoolExecutor(8) as pool:\n"
            "    found = list(pool.map(lambda _: s.comb(5, 2) + s.logsumexp([0.0]), range(64)))\n"
            "print(set(map(float, found)))",
            "{10.0}",
            id="threads that ask at once get the whole package",
        ),
        pytest.param(
            "import tumble.cli.scipy_functions as ours\n"
            "ours.FUNCTIONS = 'scipy.special._elsewhere'\n"
            "from scipy.special import chdtrc\n"
            "print(round(float(chdtrc(3.0, 7.814728)), 8))",
            "0.05",
            id="a scipy that has its functions elsewhere is loaded whole",
        ),
    ],
)
def test_the_program_takes_scipys_functions_alone(code: str, said: str) -> None:
    begin = "import sys\nfrom tumble.cli.scipy_functions import FunctionsAlone\n"
    begin += "sys.meta_path.insert(0, FunctionsAlone())\n"
    made = subprocess.run([sys.executable, "-c", begin + code], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    assert made.stdout.strip() == said
