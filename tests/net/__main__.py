"""Run the net: ``python -m tests.net check|update|list [PART[:ENTRY]]… [--processes N]``."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

BASELINE = Path(__file__).parent / "baseline"
sys.path.append(str(Path(__file__).parents[1]))  # as the tests are imported
SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "COLUMNS": "110",
    "TERM": "dumb",
    "NO_COLOR": "1",
    "TZ": "UTC",
    "LC_ALL": "C.UTF-8",
    "POLARS_MAX_THREADS": "1",
}
UNSET = ("FORCE_COLOR", "PYTHONWARNINGS", "TUMBLE_CHECK_SHAPES")
Job = tuple[str, str]
ENTRIES: dict[str, dict[str, Any]] = {}


def file_of(job: Job) -> Path:
    """Return where an entry's baseline stands."""
    part, entry = job
    return BASELINE / part / f"{entry.replace('/', '_').replace(' ', '_')}.json"


def made(job: Job) -> tuple[Job, str, float]:
    """Make one entry in a folder of its own, in a process of its own; JSON, or what went wrong."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory(prefix="tumble-net-") as folder:
        os.chdir(folder)
        try:
            result = ENTRIES[job[0]][job[1]]()
        except BaseException:  # noqa: BLE001 - said, not thrown: the other entries go on
            result = {"failed": traceback.format_exc().replace(folder, "HERE").splitlines()}
        os.chdir("/")
    text = json.dumps(result, indent=1, sort_keys=True, ensure_ascii=False)
    return job, text + "\n", time.process_time() - begun


def results(jobs: list[Job], processes: int) -> Iterator[tuple[Job, str, float]]:
    """Make all entries, each in a fork of this process, so that none sees what another left."""
    import tumble
    import tumble.cli

    # Imported once, before the forks.
    assert tumble.cli.app
    for name in tumble.__all__:
        getattr(tumble, name)
    with multiprocessing.get_context("fork").Pool(processes, maxtasksperchild=1) as pool:
        yield from pool.imap_unordered(made, jobs, chunksize=1)


def _found(parts: list[str]) -> dict[str, dict[str, Any]]:
    """Return the entries of parts that the program has today."""
    from tests.net.parts import PARTS

    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        entries = {part: PARTS[part]() for part in parts}
        os.chdir("/")
    return entries


def main() -> int:
    """Run what is asked for; 0 if nothing differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.net", description=__doc__)
    parser.add_argument("do", choices=("check", "update", "list"))
    parser.add_argument("which", nargs="*", metavar="PART[:ENTRY]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--times", action="store_true", help="say what each entry takes")
    given = parser.parse_args()
    from tests.net.parts import PARTS

    asked: dict[str, set[str]] = {}
    for word in given.which or PARTS:
        part, _, entry = word.partition(":")
        if part not in PARTS:
            parser.error(f"there is no part {part}: {', '.join(PARTS)}")
        asked.setdefault(part, set()).update({entry} if entry else ())
    # In a fork: the makers of samples leave threads behind, which no fork survives.
    with multiprocessing.get_context("fork").Pool(1) as pool:
        ENTRIES.update(pool.apply(_found, (list(asked),)))
    names = {part: list(entries) for part, entries in ENTRIES.items()}
    if given.do == "list":
        print("\n".join(f"{part}:{entry}" for part, entries in names.items() for entry in entries))
        return 0
    for part, entries in asked.items():
        if unknown := entries - set(names[part]) - {path.stem for path in (BASELINE / part).glob("*.json")}:
            parser.error(f"{part} has no entry {', '.join(sorted(unknown))}")
    jobs = [(p, e) for p, entries in names.items() for e in entries if not asked[p] or e in asked[p]]
    bad = 0
    kept = {file_of(job) for job in jobs}
    for part, entries in asked.items():
        files = (BASELINE / part).glob("*.json")
        for path in sorted(set(files) - kept):
            if entries and path.stem not in entries:
                continue
            bad += given.do == "check"
            _say([f"{part}:{path.stem} is gone" + ("" if given.do == "check" else ", and its baseline too")])
            if given.do == "update":
                path.unlink()
    begun = time.monotonic()
    for job, text, seconds in results(jobs, given.processes):
        if given.times:
            print(f"{seconds:6.1f} s  {':'.join(job)}", flush=True)
        bad += _kept(job, text) if given.do == "update" else _compared(job, text)
    print(f"{len(jobs)} entries in {time.monotonic() - begun:.0f} s: {bad or 'none'} differ(s)")
    return int(bad > 0)


def _kept(job: Job, text: str) -> int:
    """Write a baseline, if it differs by more than is compared."""
    from tests.net.pins import differences

    path = file_of(job)
    if not path.is_file() or any(differences(json.loads(path.read_text("utf-8")), json.loads(text))):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        print(f"{':'.join(job)} is written")
    if "failed" in json.loads(text):
        _say([f"{':'.join(job)} FAILED:", *json.loads(text)["failed"]])
        return 1
    return 0


def _compared(job: Job, text: str) -> int:
    """Say what differs from the baseline, at most 20 lines."""
    from tests.net.pins import LINES, differences

    path = file_of(job)
    if not path.is_file():
        _say([f"{':'.join(job)} has no baseline"])
        return 1
    now = json.loads(text)
    lines = now["failed"] if "failed" in now else list(differences(json.loads(path.read_text("utf-8")), now))
    if not lines:
        return 0
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], f"... and {len(lines) - LINES + 1} more"]
    _say([f"{':'.join(job)} differs:", *(f"  {line}" for line in lines)])
    return 1


def _say(lines: list[str]) -> None:
    print("\n".join(lines), flush=True)


if __name__ == "__main__":
    for name in UNSET:
        os.environ.pop(name, None)
    if any(os.environ.get(name) != value for name, value in SETTINGS.items()):
        os.environ.update(SETTINGS)
        os.execv(sys.executable, [sys.executable, "-m", "tests.net", *sys.argv[1:]])
    sys.exit(main())
