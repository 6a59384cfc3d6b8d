"""The papers' tables and figures made anew, printed and written beside the printed numbers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.counting import counted
from tumble.errors import OutputError, UsageError
from tumble.files import results_folder
from tumble.records import dataclass
from tumble.workflows.executors import Hands, hands
from tumble.workflows.request import ReproduceRequest, asked, silent

if TYPE_CHECKING:
    from tumble.reproduction import Outcome

# More than this takes hours, and determines no more.
MOST_REPETITIONS = 100_000


@asked(ReproduceRequest)
def reproduce(request: ReproduceRequest) -> tuple[list[Outcome], list[Path]]:
    """Make an item, or all of a paper, anew; return the outcomes and the files that were written.

    Raises
    ------
    UsageError
        If there is no such item, or a number is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.reproduction import find_items

    repetitions, seed = request.repetitions, request.seed
    if repetitions is not None and not 1 <= repetitions <= MOST_REPETITIONS:
        raise UsageError(f"--repetitions {repetitions}: give a number from 1 to {MOST_REPETITIONS}.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: a seed is a whole number from 0 on.")
    folder = results_folder(request.output)
    items = find_items(request.name or "")
    runs = [repetitions if len(items) == 1 else item.runs_among_others(repetitions) for item in items]
    tasks = [
        _Task(item.name, item.title, number, seed, item.seconds(number))
        for item, number in zip(items, runs, strict=True)
    ]
    say = request.progress or silent
    if request.workers == 1 and request.scheduler is None and request.executor is None:
        outcomes: list[Outcome] = []
        for task in (
            counted(tasks, sum(t.seconds for t in tasks), lambda t: t.seconds) if len(tasks) > 1 else tasks
        ):
            say(task.title)
            outcomes.append(_make(task))
    else:
        crew = hands(request.workers, request.scheduler, request.executor)
        outcomes = _side_by_side(tasks, crew, say)
    return outcomes, [] if folder is None else _write(folder, outcomes)


@dataclass(frozen=True)
class _Task:
    """An item by name, which its worker finds again, with its runs."""

    name: str
    title: str
    repetitions: int | None
    seed: int
    seconds: float


def _make(task: _Task) -> Outcome:
    from tumble.reproduction import find_items, run_item

    (item,) = find_items(task.name)
    return run_item(item, task.repetitions, task.seed)


def _side_by_side(
    tasks: list[_Task], crew: AbstractContextManager[Hands], say: Callable[[str], None]
) -> list[Outcome]:
    made: dict[str, Outcome] = {}
    with crew as hands_at_work:
        say(f"{len(tasks)} items side by side")
        for outcome in counted(hands_at_work.run(_make, tasks, _lost), len(tasks)):
            made[outcome.item] = outcome
    return [made[task.name] for task in tasks]


def _lost(task: _Task, reason: str) -> Outcome:
    raise UsageError(f"{task.name} could not be made: {reason}.")


def _write(folder: Path, outcomes: list[Outcome]) -> list[Path]:
    """Write everything into a folder inside the folder, then rename it all into place."""
    from tumble.files import filled_folder, put_text
    from tumble.report import outcome_files

    files = {name: text for outcome in outcomes for name, text in outcome_files(outcome).items()}
    try:
        with filled_folder(folder) as beside:
            for name, text in files.items():
                put_text(beside / name, text)
    except OSError as error:
        raise OutputError(
            f"The results could not be written to {folder}: {error.strerror or error}."
        ) from error
    return [folder / name for name in files]
