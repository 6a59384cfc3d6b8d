"""A batch: what its source says, who does the work, and that nothing that is done gets lost."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tumble.errors import UsageError
from tumble.workflows.batch import read_source
from tumble.workflows.executors import hands


def put(folder: Path, *names: str) -> None:
    """Empty files."""
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("")


def manifest(folder: Path, text: str) -> str:
    (folder / "lot.csv").write_text(text, encoding="utf-8")
    return str(folder / "lot.csv")


def test_a_folder_has_a_unit_for_each_recording_and_each_folder_or_is_its_manifest(tmp_path: Path) -> None:
    put(
        tmp_path,
        "u1.csv",
        "u2.csv.gz",
        "notes.md",
        ".hidden.csv",
        "u3/protocol.yaml",
        "u4/acc.csv",
        "u4/gyro.csv",
    )
    tasks = {task.unit: task for task in read_source([str(tmp_path)])}
    assert list(tasks) == ["u1", "u2", "u3", "u4"]
    assert tasks["u3"].told == {"protocol": str(tmp_path / "u3" / "protocol.yaml")}
    assert [Path(one).name for one in tasks["u4"].files] == ["acc.csv", "gyro.csv"]
    (tmp_path / "manifest.csv").write_text("unit,files\nonly,u1.csv\n")
    assert [task.unit for task in read_source([str(tmp_path)])] == ["only"]


def test_a_pattern_and_what_a_shell_makes_of_it_are_the_same(tmp_path: Path) -> None:
    put(tmp_path, "a1.csv", "a2.csv", "b.csv")
    typed = read_source([str(tmp_path / "a*.csv")])
    assert typed == read_source([str(tmp_path / "a1.csv"), str(tmp_path / "a2.csv")])
    assert [task.unit for task in typed] == ["a1", "a2"]
    for source in ("nowhere", "nothing-*.csv"):
        with pytest.raises(UsageError) as caught:
            read_source([source])
        assert source in str(caught.value)


def test_a_manifest_says_what_holds_for_each_unit(tmp_path: Path) -> None:
    put(tmp_path, "one.csv", "two.csv")
    text = "Unit,Files,Gravity,Temperature,Lot\nU-1,one.csv;two.csv,9.81,25,A\nU-2,gone.csv,,,B\n"
    first, second = read_source([manifest(tmp_path, text)])
    assert first.files == (str(tmp_path / "one.csv"), str(tmp_path / "two.csv"))
    assert first.told == {"gravity": "9.81", "temperature": "25"}
    assert first.more == {"lot": "A"}
    assert first.missing == ()
    assert second.missing == (str(tmp_path / "gone.csv"),)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("unit,files\na,x.csv\na,y.csv\n", "a name that another has: a"),
        ("unit,files\na,x.csv\nA,y.csv\n", "a name that another has"),
        ("unit,files\n,x.csv\n", "line 2: the unit has no name"),
        ("unit,files\na,\n", "unit a has no files"),
        ("unit,files\na,x.csv,y.csv\n", "3 cells and the first line 2"),
        ("unit,files,gravity\na,x.csv,9.81 m/s²\n", "gravity: "),
        ("unit,files\n../a,x.csv\n", "no name for a folder"),
        ("unit,files,lot,lot\na,x.csv,1,2\n", "the column 'lot' twice"),
        ("unit,files,limits\na,x.csv,tight.yaml\n", "give limits for all units by --limits"),
        ("unit,files,gravty\na,x.csv,9.82\n", "is 'gravity' meant?"),
        (f"unit,files\n{'x' * 300},x.csv\n", "longer than 120 bytes"),
        ("unit,files\n", "names no units"),
        ("t,ax,ay\n1,2,3\n", "is no manifest"),
    ],
)
def test_what_is_wrong_with_a_manifest_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UsageError, match=r"^[^\n]+\.$") as caught:
        read_source([manifest(tmp_path, text)])
    assert said in str(caught.value)


# --- who does the work


def work(task: int) -> int:
    """Square; 13 kills its process."""
    if task == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    return task * task


def lost(task: int, why: str) -> int:
    assert "ended" in why
    return -task


def test_a_task_that_kills_its_process_is_lost_alone() -> None:
    tasks = [*range(8), 13, *range(20, 26)]
    with hands(workers=2) as crew:
        found = sorted(crew.run(work, tasks, lost))
    assert found == sorted([-13, *(k * k for k in tasks if k != 13)])


def test_any_executor_does_the_work_and_is_left_open_and_none_is_refused() -> None:
    with ThreadPoolExecutor(2) as executor:
        with hands(executor=executor) as crew:
            assert sorted(crew.run(work, range(5), lost)) == [0, 1, 4, 9, 16]
        assert executor.submit(work, 3).result() == 9
    with pytest.raises(UsageError, match="--workers 0"), hands(workers=0):
        pass


BEGIN = """
import os, time
from tumble.workflows.executors import processes
if __name__ == "__main__":
    pool = processes(1)
    print(pool.submit(os.getpid).result(), flush=True)
    time.sleep(60.0)
"""


def test_workers_of_a_program_that_is_killed_end_too() -> None:
    with subprocess.Popen([sys.executable, "-c", BEGIN], stdout=subprocess.PIPE, text=True) as program:
        worker = int(program.stdout.readline())
        os.kill(worker, 0)
        program.kill()
    for _ in range(300):
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    os.kill(worker, 9)
    raise AssertionError("its worker waits for tasks that nobody will give it")
