"""Tables and examples on pages are the reader's keys, the library's numbers.

    python tests/docs/test_tables.py

writes those that it makes anew.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.cli.program import Bench

from tumble.calibration import norm_rows
from tumble.protocol import PROTOCOLS, HoldStep, SpinStep, named_protocol, protocol_schema, read_protocol
from tumble.reproduction import run_item
from tumble.simulation import GRADES, play_protocol
from tumble.units import STANDARD_GRAVITY
from tumble_papers.catalogue import ITEMS
from tumble_papers.zhang import paper_nine

DOCS = Path(__file__).resolve().parents[2] / "docs"


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def between(name: str, mark: str) -> str:
    """What stands on a page between `<!-- mark -->` and `<!-- /mark -->`."""
    found = re.search(rf"<!-- {mark}\b.*?-->\n(.*?)\n?<!-- /{mark} -->", page(name), re.S)
    return found[1]


# --- the grades of the page of simulation

MICRO_G, DEGREE = 1e-6 * STANDARD_GRAVITY, np.pi / 180.0
PER_HOUR, PER_ROOT_HOUR = DEGREE / 3600.0, DEGREE / 60.0


def grade_table(triad: str, headings: str, first: tuple[float, ...], last: tuple[float, ...]) -> str:
    """Units of noise, flicker, in-run and bias; of step and limit."""
    lines = [f"| grade | {headings} |", "|" + "---|" * (headings.count("|") + 2)]
    for name, grade in GRADES.items():
        t = getattr(grade, triad)
        biases = np.array([t.noise.random_walk, t.noise.bias_instability, t.bias_stability, t.bias]) / first
        values = [*biases, *(1e6 * np.array([t.scale_factor, t.misalignment, t.alignment, t.linearity]))]
        if triad == "gyroscope":
            values.append(grade.g_sensitivity * STANDARD_GRAVITY / PER_HOUR)
        values += [t.noise.resolution / last[0], t.noise.full_scale / last[1]]
        # Three digits; a dash for what there is none of.
        cells = ["–" if value == 0.0 else f"{float(f'{value:.3g}'):g}" for value in values]
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def accelerometers() -> str:
    headings = (
        "noise µg/√Hz | flicker µg | in-run µg | bias mg | scale ppm | axes µrad | triad µrad | linearity ppm "
        "| step µg | limit g"
    )
    first = (MICRO_G, MICRO_G, MICRO_G, 1e3 * MICRO_G)
    return grade_table("accelerometer", headings, first, (MICRO_G, STANDARD_GRAVITY))


def gyros() -> str:
    headings = (
        "noise deg/√h | flicker deg/h | in-run deg/h | bias deg/h | scale ppm | axes µrad | triad µrad "
        "| linearity ppm | g-sensitivity (deg/h)/g | step deg/h | limit deg/s"
    )
    first = (PER_ROOT_HOUR, PER_HOUR, PER_HOUR, PER_HOUR)
    return grade_table("gyroscope", headings, first, (PER_HOUR, DEGREE))


# --- the keys and messages of the page of protocols

Keys = dict[str, dict[str, object]]
SCHEMA = protocol_schema()
KINDS: dict[str, Keys] = {kind: step["properties"] for kind, step in SCHEMA["$defs"].items()}
# Keys that every step has stand in one table.
SHARED = {
    name for name, key in KINDS["hold"].items() if all(keys.get(name) == key for keys in KINDS.values())
}


def blocks(language: str) -> list[re.Match[str]]:
    return list(re.finditer(rf"^```{language}\n(.*?)^```$", page("protocols"), re.M | re.S))


def examples(folder: Path) -> list[Path]:
    """The YAML of the page, each as the file that the page calls it."""
    paths = [folder / "plate.yaml", folder / "six.yaml"]
    for path, block in zip(paths, blocks("yaml"), strict=True):
        path.write_text(block[1], encoding="utf-8")
    return paths


def key_table(keys: Keys) -> str:
    rows: list[str] = []
    for name, key in keys.items():
        words, _, default = str(key["description"]).partition("; without it: ")
        words = re.sub(r" \[(.*)\]$", r" (\1)", words)
        rows.append(f"| `{name}` | {words} | {default} |")
    return "\n".join(["| key | is (unit) | without it |", "|---|---|---|", *rows])


TABLES: dict[tuple[str, str], Callable[[], str]] = {
    ("simulation", "accelerometers"): accelerometers,
    ("simulation", "gyros"): gyros,
    ("protocols", "file"): lambda: key_table(SCHEMA["properties"]),
    ("protocols", "site"): lambda: key_table(SCHEMA["properties"]["site"]["properties"]),
    ("protocols", "step"): lambda: key_table({n: k for n, k in KINDS["hold"].items() if n in SHARED}),
    **{
        ("protocols", kind): lambda kind=kind: key_table(
            {name: key for name, key in KINDS[kind].items() if name not in SHARED}
        )
        for kind in KINDS
    },
}


@pytest.mark.parametrize(("name", "mark"), TABLES)
def test_a_table_of_a_page_is_that_of_the_code(name: str, mark: str) -> None:
    assert between(name, mark) == TABLES[name, mark](), "run python tests/docs/test_tables.py"


def test_the_named_protocols_of_the_page_are_those_of_the_library() -> None:
    section = page("protocols").partition("\n## Named protocols")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `([\w-]+)` \| (\d+) \| (\d+|–) \| ([\d.]+) \|", section, re.M)
    assert [row[0] for row in rows] == list(PROTOCOLS)
    for name, poses, spins, minutes in rows:
        protocol = named_protocol(name)
        held = [s.pose for s in protocol.steps if isinstance(s, HoldStep) and s.pose is not None]
        assert len({(*pose.up_b, pose.heading) for pose in held}) == int(poses)
        assert sum(isinstance(s, SpinStep) for s in protocol.steps) == (0 if spins == "–" else int(spins))
        assert float(minutes) == pytest.approx(protocol.duration / 60.0, abs=0.051)  # one decimal


def test_the_examples_of_the_page_of_protocols_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its assertions are worked out by hand on the page, or follow from what the page says."""
    paths = examples(tmp_path)
    monkeypatch.chdir(tmp_path)
    text, names = page("protocols"), dict[str, object]()
    assert sum(block[1].count("assert ") for block in blocks("python")) >= 9
    for block in blocks("python"):
        line = text.count("\n", 0, block.start(1))
        exec(compile("\n" * line + block[1], "protocols.md", "exec"), names)
    for path in paths:
        play_protocol(read_protocol(path), np.random.default_rng(1))


# --- what planning prints, which poses are the worst


def test_the_example_of_planning_is_what_the_command_prints(tmp_path) -> None:
    example = r"```console\n\$ tumble (plan multi-position [^\n]*--time[^\n]*)\n(.*?)```"
    shown = re.search(example, page("plan"), re.S)
    printed = Bench(tmp_path).apart(shown[1], COLUMNS="100", NO_COLOR="1").stdout.decode()
    lines = {" ".join(line.split()) for line in printed.splitlines()}
    wanted = [" ".join(line.split()) for line in shown[2].splitlines()]
    assert len(wanted) > 25
    assert not [line for line in wanted if line and line not in lines]


def test_the_worst_poses_after_a_calibration_are_as_the_page_says() -> None:
    """2.2 σ towards the corner opposite to the nine's edges."""
    rows = norm_rows(paper_nine())
    cofactor = np.linalg.inv(rows.T @ rows)
    opposite = norm_rows(-np.ones((1, 3)) / np.sqrt(3.0))[0]
    sigma = float(np.sqrt(opposite @ cofactor @ opposite))
    assert sigma == pytest.approx(2.23, abs=0.01)
    drawn = np.random.default_rng(1).standard_normal((5000, 3))
    anywhere = norm_rows(drawn / np.linalg.norm(drawn, axis=1)[:, None])
    assert np.sqrt(np.einsum("ni,ij,nj->n", anywhere, cofactor, anywhere)).max() <= sigma + 1e-9


# --- the page of Zhang et al. (2010) says what the command says at 500 repetitions

SAID = dict(
    re.findall(r"^    (zhang-\S+): (\d+ of \d+ rows inside|not judged)$", page("papers/zhang-2010"), re.M)
)
# Their own page is that of poses; and what navigates has tests of its own, as it takes a minute.
ELSEWHERE = {"zhang-sensitivity", "zhang-designs", "zhang-figure-7", "zhang-figure-10"}


def test_the_page_has_every_item() -> None:
    assert list(SAID) == [name for name in ITEMS if name.startswith("zhang")]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SAID) - ELSEWHERE))
def test_as_many_rows_are_inside_as_the_page_says(name: str) -> None:
    inside, judged = run_item(ITEMS[name], 500, 0).counts
    assert (f"{inside} of {judged} rows inside" if judged else "not judged") == SAID[name]


if __name__ == "__main__":
    for (place, mark), make in TABLES.items():
        head, opening, rest = page(place).partition(
            f"<!-- {mark}: printed by tests/docs/test_tables.py -->\n"
        )
        _, closing, after = rest.partition(f"<!-- /{mark} -->")
        (DOCS / f"{place}.md").write_text(f"{head}{opening}{make()}\n{closing}{after}", encoding="utf-8")
