"""`tumble reproduce` as a user meets it."""

import re
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.cli.program import Bench

from tumble.workflows import reproduce
from tumble_papers.catalogue import ITEMS

KINDS = ("csv", "html", "json", "txt")


def test_without_an_item_it_lists_what_there_is(bench: Bench) -> None:
    said = bench("reproduce").out
    assert [one["name"] for one in bench("reproduce --json").json] == list(ITEMS)
    efforts = re.findall(
        r"^(?:hayal|zhang|savage)-\S+ .*  ((?:\d+ runs?|no runs): (?:at once|[\d.]+ (?:s|min|h))(?:; 500: .*)?)$",
        said,
        re.M,
    )
    assert len(efforts) == len(ITEMS)
    assert "of what takes hours then no more than its own number of runs" in said


def test_what_each_item_takes_was_measured() -> None:
    """By `benchmarks/reproduction_costs.py`; an item that is new is measured, too."""
    assert [name for name, item in ITEMS.items() if not sum(item.cost) > 0.0] == []
    dear = ITEMS["hayal-5.7"]
    assert dear.seconds(500) == pytest.approx(dear.cost[0] + 500.0 * dear.cost[1])
    assert dear.seconds() < dear.seconds(500)


def test_an_item_is_printed_beside_the_thesis(bench: Bench) -> None:
    answer = bench("reproduce hayal-4.5 --repetitions 40 --seed 2")
    assert "Table 4.5: 9-parameter solution of the accelerometers" in answer.out
    (row,) = re.findall(r"^θ yz +2: noise.*$", answer.out, re.M)
    assert re.split(r"  +", row)[2:4] == ["32", "27.8"]  # 32.018 and 27.802, printed
    assert re.search(r"^40 runs, seed 2, \S+ s\.$", answer.out, re.M)
    assert re.search(r"^\d+ of 18 rows inside\. Inside: the thesis' sigma", answer.out, re.M)


def test_the_same_seed_prints_the_same(bench: Bench) -> None:
    first, again, other = (
        re.findall(r"^[bsθ] .*$", bench("reproduce hayal-4.4 --repetitions 5 --seed", seed).out, re.M)
        for seed in "112"
    )
    assert first == again != other


def test_quiet_is_a_line_an_item_and_json_a_list_with_all_digits(bench: Bench) -> None:
    assert bench("reproduce hayal-figure-4 --repetitions 20 -q").out.splitlines() == [
        "hayal-figure-4.2: 3 of 3 rows inside",
        "hayal-figure-4.3: 3 of 3 rows inside",
    ]
    quiet = bench("reproduce hayal-convergence --repetitions 2 -q").out
    assert quiet == "hayal-convergence: not judged\n"
    (outcome,) = bench("reproduce hayal-5.2 --repetitions 3 --json").json
    assert (outcome["item"], outcome["repetitions"], outcome["seed"]) == ("hayal-5.2", 3, 0)
    assert len(outcome["rows"]) == 18
    first = dict(zip(outcome["columns"], outcome["rows"][0]["cells"], strict=True))
    assert (first["IMU"], first["thesis"], first["thesis: sigma"]) == ("HG1700", 2.46e-6, 8.79e-7)


def test_a_folder_gets_page_data_text_and_pictures(bench: Bench) -> None:
    stem = "hayal-figure-4.3"
    answer = bench(f"reproduce {stem} --repetitions 5 -o new/made")
    pictures = {f"{stem}-{name}.svg" for name in ("bias", "scale", "non-orthogonality")}
    names = set(bench.contents("new/made"))
    assert names == pictures | {f"{stem}.{kind}" for kind in KINDS}
    (written,) = re.findall(r"^written: (.*)$", answer.out, re.M)
    first = Path(written.split(", ")[0])
    assert first.parent == (bench.folder / "new" / "made").resolve()
    assert {first.name, *written.split(", ")[1:]} == names
    plots = bench.json(f"new/made/{stem}.json")["plots"]
    assert [plot["name"] for plot in plots] == ["bias", "scale", "non-orthogonality"]
    # a row of the text is a row of what was printed
    (row,) = re.findall(r"^bias from .*$", bench.text(f"new/made/{stem}.txt"), re.M)
    assert row in answer.out


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


def test_earlier_results_are_replaced_as_a_whole_and_what_else_is_there_stays(bench: Bench) -> None:
    bench.put("notes.txt", "mine")
    bench("reproduce hayal-4.2 -o . -q")
    names = {"notes.txt", *(f"hayal-4.2.{kind}" for kind in KINDS)}
    assert set(bench.contents()) == names
    bench("reproduce hayal-4.2 -o . -q --seed 5")
    assert set(bench.contents()) == names
    assert bench.text("notes.txt") == "mine"
    assert bench.json("hayal-4.2.json")["seed"] == 5
    process = bench.start("reproduce hayal-4.2 --seed 9 -o .", before=AT_RENAME)
    assert "Traceback" not in process.communicate(timeout=120)[1]
    assert set(bench.contents()) == names
    for suffix in ("html", "txt"):
        assert "seed 9" in bench.text(f"hayal-4.2.{suffix}")
    assert bench.json("hayal-4.2.json")["seed"] == 9


@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_ctrl_c_while_it_simulates_ends_it_without_a_file(bench: Bench, workers: str) -> None:
    """A study of minutes, interrupted after the program said that it began."""
    process = bench.start("reproduce hayal --repetitions 100000 -o new --workers", workers)
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert bench.contents() == {}


def test_items_that_are_made_side_by_side_are_the_same() -> None:
    alone, _ = reproduce("hayal-A", repetitions=3, seed=4)
    with ThreadPoolExecutor(2) as pool:
        beside, _ = reproduce("hayal-A", repetitions=3, seed=4, executor=pool)
    assert len(alone) > 3
    assert [(outcome.item, outcome.rows) for outcome in beside] == [(one.item, one.rows) for one in alone]
