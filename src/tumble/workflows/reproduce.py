"""The papers' tables and figures made anew, printed and written beside the printed numbers."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tumble.errors import OutputError, UsageError

if TYPE_CHECKING:
    from tumble.reproduction.outcome import Outcome

# More than this takes hours, and tells no more.
MOST_REPETITIONS = 100_000


def reproduce(
    name: str,
    *,
    repetitions: int | None = None,
    seed: int = 0,
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[Outcome], list[Path]]:
    """Make an item, or all of a paper, anew; return the outcomes and the files that were written.

    Parameters
    ----------
    name : of an item, or of a paper ("hayal", "zhang", "savage").
    repetitions : how many runs; None for each item's own number, which items that take hours do not exceed where
        all of a paper is asked for.
    seed : of all random numbers; the same seed gives the same numbers.
    output : folder for a page, data and pictures of each item; None writes nothing.
    progress : is told in words what is being done.

    Raises
    ------
    UsageError
        If there is no such item, or a number is wrong.
    OutputError
        If the files cannot be written; earlier ones are intact.
    """
    from tumble.reproduction.items import find_items, run_item

    if repetitions is not None and not 1 <= repetitions <= MOST_REPETITIONS:
        raise UsageError(f"--repetitions {repetitions}: give a number from 1 to {MOST_REPETITIONS}.")
    if seed < 0:
        raise UsageError(f"--seed {seed}: a seed is a whole number from 0 on.")
    folder = None if output is None else Path(output)
    if folder is not None and folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder.")
    outcomes: list[Outcome] = []
    items = find_items(name)
    for item in items:
        if progress is not None:
            progress(item.title)
        runs = repetitions if len(items) == 1 else item.runs_among_others(repetitions)
        outcomes.append(run_item(item, runs, seed))
    return outcomes, [] if folder is None else _write(folder, outcomes)


def _write(folder: Path, outcomes: list[Outcome]) -> list[Path]:
    """Write everything into a folder inside the folder, then rename it all into place."""
    from tumble.files import filled_folder, put_text
    from tumble.report.reproduction import outcome_csv, outcome_json, outcome_lines, outcome_pictures
    from tumble.report.reproduction_page import render_outcome

    files: dict[str, str] = {}
    for outcome in outcomes:
        files[f"{outcome.item}.html"] = render_outcome(outcome)
        files[f"{outcome.item}.json"] = outcome_json(outcome)
        files[f"{outcome.item}.csv"] = outcome_csv(outcome)
        files[f"{outcome.item}.txt"] = "\n".join(outcome_lines(outcome)) + "\n"
        files |= outcome_pictures(outcome)
    try:
        with filled_folder(folder) as beside:
            for name, text in files.items():
                put_text(beside / name, text)
    except OSError as error:
        raise OutputError(
            f"The results could not be written to {folder}: {error.strerror or error}."
        ) from error
    return [folder / name for name in files]
