"""The program as the net runs it: in this process, in a folder of its own, and what it left behind."""

from __future__ import annotations

import io
import json
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from tests.net.pins import page, pinned, sha256

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
REFERENCE = ROOT / "tests" / "reference"
PACKAGED = ROOT / "src" / "tumble" / "data"
SITE = ("--site", "48.1,520")


def tumble(*arguments: object) -> dict[str, Any]:
    """Run `tumble ARGUMENTS`; return its status and what it printed, without the folder that it ran in."""
    from tumble.cli import main

    out, err = io.StringIO(), io.StringIO()
    before, status = sys.argv, 0
    sys.argv = ["tumble", *(str(argument) for argument in arguments)]
    try:
        with redirect_stdout(out), redirect_stderr(err):
            main()
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    finally:
        sys.argv = before
    return {"status": status, "out": said(out.getvalue()), "err": said(err.getvalue())}


def said(text: str) -> list[str]:
    """Return lines without what another folder or another hour changes; blank ends are nothing."""
    for folder, name in ((Path.cwd(), "HERE"), (ROOT, "ROOT")):
        text = text.replace(str(folder), name)
    text = re.sub(r"\S*/site-packages/(\S+?):\d+:", r"\1:", text)
    text = re.sub(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(\+00:00|Z)", "TIME", text)
    return [line.rstrip() for line in text.split("\n") if line.strip()]


def simulated(folder: str, *arguments: object) -> dict[str, Any]:
    """Play a protocol, with what is wrong as a mapping; return its files' checksums: a change there is told apart."""
    for errors in (one for one in arguments if isinstance(one, dict)):
        Path("errors.yaml").write_text(json.dumps(errors), encoding="utf-8")
        arguments = (*(one for one in arguments if one is not errors), "--errors", "errors.yaml")
    answer = tumble("simulate", *arguments, "-o", folder, "-q")
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    # The protocol and the truth are pinned as documents where they are used: their words may change.
    recordings = {path.name: sha256(path) for path in files if path.suffix == ".csv"}
    return recordings if not answer["status"] else {"simulate": answer}


def document(path: str | Path) -> Any:
    """Return what is kept of a JSON document; None where there is no such file."""
    path = Path(path)
    return pinned(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def calibrated(*arguments: object, output: str = "out") -> dict[str, Any]:
    """Calibrate; return what was printed and the document."""
    answer = tumble("calibrate", *arguments, "-o", output)
    return {"calibrate": answer, "calibration.json": document(Path(output) / "calibration.json")}


def shown(path: str) -> Any:
    """Return what is kept of a page."""
    return page(Path(path)) if Path(path).is_file() else None
