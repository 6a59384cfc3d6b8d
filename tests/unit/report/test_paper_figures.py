"""The figures of a page as files for a paper: one column wide, fonts embedded, the numbers those of the page."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest

from tumble.errors import UsageError
from tumble.report.figures import on_paper
from tumble.report.figures.on_page import plot
from tumble.report.figures.record import Axis, Bars, Curve, Figure, Map, Points

TIMES, LEVELS = np.array([0.0, 1.0, 2.5]), np.array([3.0, np.nan, -4.0])


def figures() -> list[Figure]:
    panels = [Axis("a / (m/s²)", share=(0.0, 0.5)), Axis("σ, $ & %", share=(0.6, 1.0))]
    lines = [
        Curve(TIMES, LEVELS, "a"),
        Points(TIMES, LEVELS, "b", panel=1, labels=["1", "2", "3"]),
    ]
    names = Axis(kind="names", downwards=True)
    bars = [Bars(x, ["x", "y"], f"one & {x}", lying=True) for x in ([10.0, 30.0], [90.0, 70.0])]
    cells = Map(["u", "v"], ["u", "v"], values=[[1.0, -0.5], [None, 1.0]])
    return [
        Figure("lines", "lines", lines, Axis("time / s"), panels, 380),
        Figure("bars", "bars", bars, Axis(), names, 300, stacked=True),
        Figure("map", "map", [cells], Axis(kind="names"), names, 300),
    ]


def test_pdf_is_one_column_wide_and_has_its_fonts_in_it(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    made = on_paper.write_figures(figures(), tmp_path / "figures", "pdf")
    assert [file.name for file in made] == ["lines.pdf", "bars.pdf", "map.pdf"]
    for file in made:
        (sheet,) = pypdf.PdfReader(io.BytesIO(file.read_bytes())).pages
        assert float(sheet.mediabox.width) / 72.0 * 25.4 == pytest.approx(88.0, abs=0.5)
        fonts = [font.get_object() for font in sheet["/Resources"]["/Font"].values()]  # type: ignore[index]
        assert fonts
        for font in fonts:
            assert font["/Subtype"] == "/Type0"
            (inner,) = font["/DescendantFonts"]
            assert "/FontFile2" in inner.get_object()["/FontDescriptor"]
    assert "σ, $ & %" in pypdf.PdfReader(made[0]).pages[0].extract_text()


def test_each_form_is_itself_and_twice_the_same_bytes() -> None:
    pytest.importorskip("matplotlib")
    for form, head in (("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")):
        first, second = (on_paper.draw(figures()[1], form) for _ in range(2))
        assert first == second
        assert first.startswith(head)
        # A journal's editor has not the page's fonts: texts are outlines.
        assert form != "svg" or b"<text" not in first


def test_what_is_drawn_is_what_the_page_carries(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure as Drawn

    seen: list[Any] = []
    monkeypatch.setattr(Drawn, "savefig", lambda self, *_, **__: seen.append(self))
    for figure in figures():
        on_paper.draw(figure, "pdf")
    above, below = seen[0].axes
    assert (above.get_ylabel(), below.get_ylabel()) == (r"σ, \$ & %", "a / (m/s²)")
    drawn = below.lines[0].get_xydata()
    assert np.array_equal(drawn[:, 0], TIMES)
    assert np.array_equal(drawn[:, 1], LEVELS, equal_nan=True)
    ends = [(patch.get_x(), patch.get_width()) for patch in seen[1].axes[0].patches]
    assert ends == [(0.0, 10.0), (0.0, 30.0), (10.0, 90.0), (30.0, 70.0)]
    assert seen[2].axes[0].images[0].get_array()[0].tolist() == [1.0, -0.5]


def test_a_page_and_a_file_have_the_same_marks() -> None:
    lines, bars, cells = (plot(figure) for figure in figures())
    assert [trace["yaxis"] for trace in lines["data"][1:]] == ["y2"]
    assert lines["data"][0]["y"] == [3.0, None, -4.0]
    assert lines["layout"]["xaxis"]["anchor"] == "y"
    assert [trace["name"] for trace in bars["data"]] == ["one &amp; [10.0, 30.0]", "one &amp; [90.0, 70.0]"]
    assert bars["layout"]["barmode"] == "stack"
    assert cells["data"][0]["z"] == [[1.0, -0.5], [None, 1.0]]


def test_wrong_forms_and_a_missing_library_are_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match="give one of pdf, svg, png"):
        on_paper.write_figures(figures(), tmp_path, "bmp")
    monkeypatch.setattr(on_paper, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"pip install matplotlib"):
        on_paper.require_library()
