"""`tumble reproduce` as a user meets it."""

from __future__ import annotations

import json
import re
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from tumble.workflows.reproduce import reproduce
from tumble_papers.catalogue import ITEMS

KINDS = ("csv", "html", "json", "txt")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_without_an_item_it_lists_what_there_is(tumble: Any) -> None:
    answer = tumble("reproduce")
    assert answer.status == 0
    listed = json.loads(tumble("reproduce", "--json").out)
    assert [one["name"] for one in listed] == list(ITEMS)
    efforts = re.findall(
        r"^(?:hayal|zhang|savage)-\S+ .*  ((?:\d+ runs?|no runs): (?:at once|[\d.]+ (?:s|min|h))(?:; 500: .*)?)$",
        answer.out,
        re.M,
    )
    assert len(efforts) == len(ITEMS)
    assert "of what takes hours then no more than its own number of runs" in answer.out


def test_what_each_item_takes_was_measured() -> None:
    """By `benchmarks/reproduction_costs.py`; an item that is new is measured, too."""
    assert [name for name, item in ITEMS.items() if not sum(item.cost) > 0.0] == []
    dear = ITEMS["hayal-5.7"]
    assert dear.seconds(500) == pytest.approx(dear.cost[0] + 500.0 * dear.cost[1])
    assert dear.seconds() < dear.seconds(500)


def test_an_item_is_printed_beside_the_thesis(tumble: Any) -> None:
    answer = tumble("reproduce", "hayal-4.5", "--repetitions", 40, "--seed", 2)
    assert answer.status == 0
    assert answer.err == ""
    assert "Table 4.5: 9-parameter solution of the accelerometers" in answer.out
    (row,) = re.findall(r"^θ yz +2: noise.*$", answer.out, re.M)
    assert re.split(r"  +", row)[2:4] == ["32", "27.8"]  # 32.018 and 27.802, printed
    assert re.search(r"^40 runs, seed 2, \S+ s\.$", answer.out, re.M)
    assert re.search(r"^\d+ of 18 rows inside\. Inside: the thesis' sigma", answer.out, re.M)


def test_the_same_seed_prints_the_same(tumble: Any) -> None:
    def rows(seed: int) -> list[str]:
        out = tumble("reproduce", "hayal-4.4", "--repetitions", 5, "--seed", seed).out
        return re.findall(r"^[bsθ] .*$", out, re.M)

    assert rows(1) == rows(1)
    assert rows(1) != rows(2)


def test_quiet_is_a_line_an_item(tumble: Any) -> None:
    answer = tumble("reproduce", "hayal-figure-4", "--repetitions", 20, "-q")
    assert answer.status == 0
    assert answer.out.splitlines() == [
        "hayal-figure-4.2: 3 of 3 rows inside",
        "hayal-figure-4.3: 3 of 3 rows inside",
    ]
    assert tumble("reproduce", "hayal-convergence", "--repetitions", 2, "-q").out == (
        "hayal-convergence: not judged\n"
    )


def test_json_is_a_list_with_all_digits(tumble: Any) -> None:
    answer = tumble("reproduce", "hayal-5.2", "--repetitions", 3, "--json")
    assert answer.status == 0
    (outcome,) = json.loads(answer.out)
    assert (outcome["item"], outcome["repetitions"], outcome["seed"]) == ("hayal-5.2", 3, 0)
    assert len(outcome["rows"]) == 18
    first = dict(zip(outcome["columns"], outcome["rows"][0]["cells"], strict=True))
    assert (first["IMU"], first["thesis"], first["thesis: sigma"]) == ("HG1700", 2.46e-6, 8.79e-7)


def test_a_folder_gets_page_data_text_and_pictures(tumble: Any, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "reproduced"
    answer = tumble("reproduce", "hayal-figure-4.3", "--repetitions", 5, "-o", folder)
    assert answer.status == 0
    stem = "hayal-figure-4.3"
    pictures = {f"{stem}-{name}.svg" for name in ("bias", "scale", "non-orthogonality")}
    assert set(contents(folder)) == pictures | {f"{stem}.{kind}" for kind in KINDS}
    (written,) = re.findall(r"^written: (.*)$", answer.out, re.M)
    first, *others = written.split(", ")
    assert {first, *others} == {
        str(folder.resolve() / Path(first).name),
        *(name for name in contents(folder) if name != Path(first).name),
    }
    document = json.loads((folder / f"{stem}.json").read_text("utf-8"))
    assert [plot["name"] for plot in document["plots"]] == ["bias", "scale", "non-orthogonality"]
    text = (folder / f"{stem}.txt").read_text("utf-8")
    # a row of the text is a row of what was printed
    (row,) = re.findall(r"^bias from .*$", text, re.M)
    assert row in answer.out


def test_what_else_is_in_the_folder_stays_and_earlier_results_are_replaced(
    tumble: Any, tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert tumble("reproduce", "hayal-4.2", "-o", tmp_path, "-q").status == 0
    earlier = contents(tmp_path)
    assert tumble("reproduce", "hayal-4.2", "-o", tmp_path, "-q", "--seed", 5).status == 0
    later = contents(tmp_path)
    assert set(earlier) == set(later) == {"notes.txt", *(f"hayal-4.2.{kind}" for kind in KINDS)}
    assert later["notes.txt"] == b"mine"
    assert json.loads(later["hayal-4.2.json"])["seed"] == 5


def test_an_unknown_item_is_refused_with_a_hint(tumble: Any, tmp_path: Path) -> None:
    answer = tumble("reproduce", "hayal-44", "-o", tmp_path / "out")
    answer.is_told(2, "'hayal-44'", "Did you mean hayal-4.4?", "`tumble reproduce` lists")
    tumble("reproduce", "-o", tmp_path / "out").is_told(2, "--output goes with an ITEM")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--repetitions", 0, "0.*from 1 to 100000"),
        ("--repetitions", 100_001, "100001.*from 1 to 100000"),
        ("--repetitions", "many", "many is no whole number"),
        ("--seed", -1, "-1.*from 0 on"),
        ("--seed", 1.5, "1.5 is no whole number"),
    ],
)
def test_a_wrong_number_is_refused(tumble: Any, option: str, value: object, words: str) -> None:
    tumble("reproduce", "hayal-4.2", option, value).is_told(2, option, words)


# Sends Ctrl-C from inside, in the middle of renaming: it takes effect when all is in place.
AT_RENAME = """
import os, pathlib, signal
real, calls = pathlib.Path.replace, [0]
def replace(*arguments):
    calls[0] += 1
    if calls[0] == 2:
        os.kill(os.getpid(), signal.SIGINT)
    return real(*arguments)
pathlib.Path.replace = replace
"""


def test_ctrl_c_while_renaming_leaves_one_whole_set(tumble: Any, start: Any, tmp_path: Path) -> None:
    assert tumble("reproduce", "hayal-4.2", "-o", tmp_path, "-q").status == 0
    process = start("reproduce", "hayal-4.2", "--seed", 9, "-o", tmp_path, before=AT_RENAME)
    assert "Traceback" not in process.communicate(timeout=120)[1]
    assert set(contents(tmp_path)) == {f"hayal-4.2.{kind}" for kind in KINDS}
    for suffix in ("html", "txt"):
        assert "seed 9" in (tmp_path / f"hayal-4.2.{suffix}").read_text("utf-8")
    assert json.loads((tmp_path / "hayal-4.2.json").read_text("utf-8"))["seed"] == 9


@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_ctrl_c_while_it_simulates_ends_it_without_a_file(start: Any, tmp_path: Path, workers: str) -> None:
    """A study of minutes, interrupted after the program said that it began."""
    call = ("reproduce", "hayal", "--repetitions", 100_000, "--workers", workers, "-o", tmp_path / "new")
    process = start(*call)
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert contents(tmp_path) == {}


def test_items_that_are_made_side_by_side_are_the_same() -> None:
    alone, _ = reproduce("hayal-A", repetitions=3, seed=4)
    with ThreadPoolExecutor(2) as pool:
        beside, _ = reproduce("hayal-A", repetitions=3, seed=4, executor=pool)
    assert [outcome.item for outcome in beside] == [outcome.item for outcome in alone]
    assert len(alone) > 3
    for one, other in zip(alone, beside, strict=True):
        assert one.rows == other.rows
