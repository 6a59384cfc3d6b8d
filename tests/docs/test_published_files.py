"""What the documentation publishes is what the code gives: schema, keys, figures, tables, messages."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tumble.workflows.calibrate import RECORDING, calibrate

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def script(path: Path) -> ModuleType:
    """The module of a script that lies outside the package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def keys_of(section: str) -> set[str]:
    """The keys in the first column of the first table after a heading of the page of the file format."""
    text = (DOCS / "file-format.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", text.partition(section)[2].partition("\n## ")[0], re.M)
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


SCHEMA = json.loads((DOCS / "schema" / "calibration.schema.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["calibration", "noise", "filter"])
def test_the_published_schema_is_the_code_s(name: str) -> None:
    published = (DOCS / "schema" / f"{name}.schema.json").read_text(encoding="utf-8")
    assert published == script(DOCS / "schema" / "write_schema.py").schema_text(name), "run make schema"


@pytest.mark.parametrize(
    ("section", "properties"),
    [
        ("# calibration.json, key by key", SCHEMA["properties"]),
        ("## accelerometer, gyroscope", SCHEMA["$defs"]["TriadBlock"]["properties"]),
        ("## thermal", SCHEMA["$defs"]["ThermalBlock"]["properties"]),
        ("## quality", SCHEMA["$defs"]["QualityBlock"]["properties"]),
    ],
)
def test_every_key_is_documented_and_every_documented_key_exists(
    section: str, properties: dict[str, object]
) -> None:
    assert keys_of(section) == set(properties)


def scores_on_the_page() -> dict[tuple[str, str], tuple[float, float]]:
    """(recording, set of parameters) -> mm/s² and degrees, from the first table of the page."""
    page = (DOCS / "real-recordings.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\|([^|]*)\| \**([^|*]*)\** \| \**([\d.]+)\** \| \**([\d.]+)\** \|$", page, re.M)
    found: dict[tuple[str, str], tuple[float, float]] = {}
    recording = ""
    for first, what, norm, angle in rows:
        recording = first.split(",")[0].strip() or recording
        found[recording, what] = float(norm), float(angle)
    return found


REFERENCE = ROOT / "tests" / "reference"
MPU = {"columns": "ax,ay,az,gx,gy,gz", "units": "m/s^2,rad/s", "rate": 100.0}


@pytest.mark.parametrize(
    ("recording", "paths", "gravity", "options"),
    [
        (
            "Xsens MTi",
            [REFERENCE / "xsens_mti_hand" / f"xsens_{triad}.txt.gz" for triad in ("acc", "gyro")],
            9.81744,
            {},
        ),
        ("MPU-9150 imu0", [ROOT / "src" / "tumble" / "data" / RECORDING], 9.81, MPU),
        ("MPU-9150 imu1", [REFERENCE / "mpu9150" / "imu1.log.gz"], 9.81, MPU),
    ],
)
@pytest.mark.parametrize(("what", "terms"), [("tumble", True), ("tumble, without optional terms", False)])
def test_the_scores_on_the_page_of_real_recordings_are_those_of_today(
    recording: str, paths: list[Path], gravity: float, options: dict[str, object], what: str, terms: bool
) -> None:
    """5 %: another machine's arithmetic moves the third figure; a change of the method moves the first."""
    from tumble.calibration.checks.scores import hold_norm_errors, score_turns
    from tumble.calibration.equations.gathering import gather
    from tumble.earth import Site

    stated = scores_on_the_page().get((recording, what))
    if stated is None:
        assert not terms
        assert recording != "Xsens MTi"  # the others want no terms, so that both rows would be one
        return
    site = Site.from_gravity(gravity)
    run = calibrate(paths, site=site, procedure="hand-held", optional_terms=terms, **options)  # type: ignore[arg-type]
    data = gather(run.recording, run.timeline, run.means)
    norms = 1e3 * np.sqrt(np.mean(hold_norm_errors(run.estimate.model, data.force_mean, gravity) ** 2))
    angle = np.degrees(np.sqrt(np.nanmean(score_turns(run.estimate.model, data).angle ** 2)))
    assert norms == pytest.approx(stated[0], rel=0.05)
    assert angle == pytest.approx(stated[1], rel=0.05)
