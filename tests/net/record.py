"""Play runs of the net and store what they leave behind, or tell what moved.

    python tests/net/record.py                   # every run anew
    python tests/net/record.py demo noise        # these two
    python tests/net/record.py --check demo      # store nothing, say what differs
    python tests/net/record.py --list            # names

With ``--serve`` it reads names from its input and answers each by a line of JSON: its differences.
"""

# ruff: noqa: T201

from __future__ import annotations

import contextlib
import gzip
import io
import json
import os
import shlex
import shutil
import sys
import tempfile
import time
import traceback
from pathlib import Path

HERE = Path(__file__).resolve().parent
EXPECTED = HERE / "expected"
SETTINGS = {
    "COLUMNS": "160",
    "LINES": "50",
    "NO_COLOR": "1",
    "TERM": "dumb",
    "TZ": "UTC",
    "OPENBLAS_NUM_THREADS": "1",
    "MPLBACKEND": "agg",
}
# Before anything of tumble is imported: its own source, and a terminal that is the same everywhere.
os.environ.update(SETTINGS)
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "src")]

from outcome import differences, file_outcome, reduced, stream  # noqa: E402
from runs import RUNS, Step  # noqa: E402


def play(name: str) -> dict[str, object]:
    """Return what each step of a run leaves behind: status, both streams and the files that are new."""
    before = Path.cwd()
    folder = Path(tempfile.mkdtemp(prefix="net_"))
    os.chdir(folder)
    outcome: dict[str, object] = {}
    seen: dict[Path, int] = {}
    try:
        for number, step in enumerate(RUNS[name], 1):
            told = _played(step)
            files = sorted(path for path in Path().rglob("*") if path.is_file())
            new = [path for path in files if seen.get(path) != path.stat().st_mtime_ns]
            seen = {path: path.stat().st_mtime_ns for path in files}
            if told is None:
                continue  # a step that lays files out
            told["files"] = {path.as_posix(): file_outcome(path) for path in new}
            label = step if isinstance(step, str) else "code"
            outcome[f"{number}: {label}"] = told
        # As it is stored: what JSON makes of it.
        return json.loads(json.dumps(outcome).replace(str(folder), "FOLDER"))
    finally:
        os.chdir(before)
        shutil.rmtree(folder, ignore_errors=True)


def _played(step: Step) -> dict[str, object] | None:
    out, err = io.StringIO(), io.StringIO()
    if not isinstance(step, str):
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            returned = step()
        return (
            None
            if returned is None
            else {"returned": reduced(json.loads(json.dumps(returned, default=_plain)))}
        )
    from tumble.cli.main import main

    arguments, sys.argv = sys.argv, ["tumble", *shlex.split(step)]
    status: object = None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as end:
        status = end.code
    finally:
        sys.argv = arguments
    return {"status": status, "out": stream(out.getvalue()), "err": stream(err.getvalue())}


def _plain(value: object) -> object:
    return value.tolist() if hasattr(value, "tolist") else str(value)


def stored(name: str) -> object:
    """Return the stored outcome of a run, or None."""
    path = EXPECTED / f"{name}.json.gz"
    return json.loads(gzip.decompress(path.read_bytes())) if path.exists() else None


def store(name: str, outcome: object) -> None:
    """Store an outcome: the same outcome is the same file."""
    text = json.dumps(outcome, ensure_ascii=False, indent=0)
    EXPECTED.mkdir(exist_ok=True)
    (EXPECTED / f"{name}.json.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))


def check(name: str) -> list[str]:
    """Return the differences of a run from what is stored."""
    expected = stored(name)
    return ["nothing is stored"] if expected is None else list(differences(expected, play(name)))


def _serve() -> None:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        try:
            told = sorted(RUNS) if line.strip() == "names" else check(line.strip())
        except Exception:  # noqa: BLE001 (whatever it is, it is the answer)
            told = traceback.format_exc().splitlines()
        print(json.dumps(told), file=answers, flush=True)


def _main(arguments: list[str]) -> int:
    options = {one for one in arguments if one.startswith("--")}
    names = [one for one in arguments if one not in options] or list(RUNS)
    if unknown := [name for name in names if name not in RUNS] or sorted(
        options - {"--serve", "--check", "--list"}
    ):
        print(f"Not known: {', '.join(unknown)}; --list lists the runs.", file=sys.stderr)
        return 2
    if "--serve" in options:
        _serve()
        return 0
    if "--list" in options:
        print("\n".join(RUNS))
        return 0
    moved = 0
    for name in names:
        started, expected = time.process_time(), stored(name)
        outcome = play(name)
        told = ["stored for the first time"] if expected is None else list(differences(expected, outcome))
        print(f"{name}: {time.process_time() - started:.1f} s, {len(told)} differences", flush=True)
        for line in told[:10]:
            print(f"    {line}")
        moved += bool(told)
        if "--check" not in options and told:
            store(name, outcome)
    return int(moved > 0 and "--check" in options)


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
