"""Recordings that are read block by block, and what the document holds, through the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble.document.part import read_part
from tumble.noise.deviation import allan_deviation
from tumble.report.noise_document import NoiseDocument

RATE = 200.0


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    """150 s of a gyro with white noise, a random walk and a vibration at 31 Hz in gx, and a temperature."""
    rng = np.random.default_rng(12)
    count = 30_000
    time = np.arange(count) / RATE
    celsius = 25.0 + np.sin(time / 150.0)
    turn = 1e-3 * rng.standard_normal((count, 3)) + np.cumsum(2e-6 * rng.standard_normal((count, 3)), axis=0)
    turn[:, 0] += 4e-4 * np.sin(2.0 * np.pi * 31.0 * time)
    turn[:, 1] += 5e-4 * (celsius - 25.0)
    return np.column_stack([time, turn, celsius])


NAMES = ["t", "gx", "gy", "gz", "temperature"]


@pytest.fixture(scope="module")
def files(rows: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    import polars as pl

    folder = tmp_path_factory.mktemp("formats")
    frame = pl.DataFrame(rows, schema=NAMES)
    frame.write_csv(folder / "still.csv")
    frame.write_parquet(folder / "still.parquet")
    np.save(folder / "still.npy", rows)
    return {path.suffix[1:]: path for path in folder.iterdir()}


_FOUND: dict[tuple[object, ...], dict[str, Any]] = {}


WHOLE, BLOCKS = "whole", "block by block"


def document(tumble: Any, how: str, *arguments: object) -> dict[str, Any]:
    """What `tumble noise` finds in a file that is read so; the same question is asked once."""
    asked = (how, *arguments)
    if asked not in _FOUND:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tumble.workflows.noise.STREAMED_ABOVE", 2**60 if how == WHOLE else -1)
            answer = tumble("noise", *arguments, "--json")
        assert (answer.status, answer.err) == (0, "")
        _FOUND[asked] = json.loads(answer.out)
    return _FOUND[asked]


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of 7001 rows or 200 kB, so that a small file has many."""
    from tumble.recording.formats import arrays, frames, text

    for read in (arrays.read_npy, frames.read_tables):
        monkeypatch.setattr(read, "__defaults__", (7001,))
    monkeypatch.setattr(text, "_CHUNK", 200_000)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(
    ("kind", "option"), [("csv", []), ("parquet", []), ("npy", ["--remove-temperature"])]
)
def test_block_by_block_is_what_it_is_whole(
    tumble: Any, files: dict[str, Path], kind: str, option: list[str]
) -> None:
    if kind == "npy":
        option = [*option, "--columns", ",".join(NAMES)]
    whole = document(tumble, WHOLE, files[kind], *option)
    blocks = document(tumble, BLOCKS, files[kind], *option)
    assert (whole["read"], blocks["read"]) == ("whole", "block by block")
    assert blocks["samples_at_rest"] == whole["samples_at_rest"] == 30_000
    assert blocks["recordings"] == whole["recordings"]
    assert blocks["rate_hz"] == pytest.approx(whole["rate_hz"], rel=1e-9)
    for name, expected in whole["channels"].items():
        found = blocks["channels"][name]
        for key in ("curve", "allan_deviation"):
            # Averaging times are taken to the next multiple, within 0.8 %.
            count = min(len(found[key]["tau_s"]), len(expected[key]["tau_s"]))
            assert found[key]["tau_s"][:count] == pytest.approx(expected[key]["tau_s"][:count], rel=0.008)
            short = [k for k, tau in enumerate(expected[key]["tau_s"][:count]) if tau * RATE <= 100.5]
            # Temperature is taken off by means over a second there, which differs in the fourth digit of the slope.
            tolerance = 1e-5 if "--remove-temperature" in option else 1e-9
            for k in short:
                assert found[key]["deviation"][k] == pytest.approx(
                    expected[key]["deviation"][k], rel=tolerance
                )
        white = expected["terms"]["N"]
        assert found["terms"]["N"]["value"] == pytest.approx(
            white["value"], abs=0.1 * white["standard_uncertainty"]
        )


def test_the_line_is_found_with_its_frequency_and_amplitude(tumble: Any, files: dict[str, Path]) -> None:
    for how in (WHOLE, BLOCKS):
        [line] = document(tumble, how, files["parquet"])["channels"]["gx"]["lines"]
        assert line["frequency_hz"] == pytest.approx(
            31.0, abs=5.0 * line["frequency_standard_uncertainty"] + 1e-4
        )
        assert line["amplitude"] == pytest.approx(4e-4, abs=5.0 * line["amplitude_standard_uncertainty"])


def test_lost_samples_at_the_border_of_blocks_are_filled_in_there_too(
    tumble: Any, rows: np.ndarray, tmp_path: Path, small_blocks: None
) -> None:
    import polars as pl

    keep = np.ones(len(rows), dtype=bool)
    keep[[7001, 7002, 20_000]] = False
    path = tmp_path / "lost.parquet"
    # Rows before the second border of blocks and after it suffice.
    pl.DataFrame(rows[keep][:25_000], schema=NAMES).write_parquet(path)
    whole, blocks = (document(tumble, how, path) for how in (WHOLE, BLOCKS))
    for found in (whole, blocks):
        assert any("3 lost sample(s) in 2 place(s) are filled in" in text for text in found["remarks"])
        assert found["pieces"] == [[0, 25_003]]
    deviations = [d["channels"]["gz"]["allan_deviation"]["deviation"][:7] for d in (whole, blocks)]
    assert deviations[1] == pytest.approx(deviations[0], rel=1e-9)


def test_the_curve_is_in_table_page_and_document(
    tumble: Any, files: dict[str, Path], rows: np.ndarray, tmp_path: Path
) -> None:
    answer = tumble("noise", files["parquet"], "-o", tmp_path)
    assert answer.status == 0
    assert "\nAllan deviation:" in answer.out
    assert "Allan deviation" in (tmp_path / "noise.html").read_text(encoding="utf-8")
    written = json.loads((tmp_path / "noise.json").read_text(encoding="utf-8"))
    read_part(NoiseDocument, written)
    curve = written["channels"]["gz"]["curve"]
    base = allan_deviation(rows[:, 3], RATE, taus="log")
    assert curve["kind"] == "overlapping"
    assert curve["tau_s"] == pytest.approx(base.tau.tolist(), rel=1e-12)
    assert curve["deviation"] == pytest.approx(base.deviation[:, 0].tolist(), rel=1e-9)


def test_every_number_has_letter_unit_and_definition_and_the_covariance_is_whole(
    tumble: Any, files: dict[str, Path]
) -> None:
    found = document(tumble, WHOLE, files["parquet"])
    for name, channel in found["channels"].items():
        for letter, term in channel["terms"].items():
            assert term["letter"] == letter
            assert term["definition"]
            assert term["unit"]
        covariance = channel["fit"]["covariance"]
        assert covariance["terms"] == list(channel["terms"])
        sigma = np.sqrt(np.diag(np.array(covariance["matrix"])))
        assert sigma.tolist() == pytest.approx(
            [term["standard_uncertainty"] for term in channel["terms"].values()], rel=1e-9
        ), name
    triad = found["triads"]["gyroscope"]["terms"]["N"]
    each = np.array([found["channels"][axis]["terms"]["N"]["value"] for axis in ("gx", "gy", "gz")])
    assert triad["mean_of_variances"] == pytest.approx(np.sqrt(np.mean(each**2)), rel=1e-12)
    assert triad["worst_axis"] == each.max()
    assert triad["worst_axis_name"] == ("gx", "gy", "gz")[int(np.argmax(each))]
