"""The figures of a page as files for a paper: one column wide, fonts embedded, the numbers those of the page."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest

from tumble.errors import UsageError
from tumble.report.figures import paper
from tumble.report.figures.plot import BLUE, base_layout, packed, scatter, text_axis
from tumble.report.html import render_page
from tumble.report.page import Figure, Figures, Page

TIMES, LEVELS = np.array([0.0, 1.0, 2.5]), np.array([3.0, np.nan, -4.0])


def figures() -> list[Figure]:
    axes = {"xaxis": text_axis("time / s"), "yaxis": text_axis("a / (m/s²)", domain=[0.0, 0.5])}
    lines = [
        {"type": "scatter", "mode": "lines", "x": packed(TIMES), "y": packed(LEVELS), "name": "a"},
        scatter(TIMES, LEVELS, "markers+text", text=["1", "2", "3"], name="b", yaxis="y2"),
    ]
    upper = base_layout(380, **axes, yaxis2=text_axis("σ, $ & %", domain=[0.6, 1.0]))
    bars = [
        {"type": "bar", "orientation": "h", "x": [10.0, 30.0], "y": ["x", "y"], "name": "one"},
        {"type": "bar", "orientation": "h", "x": [90.0, 70.0], "y": ["x", "y"], "name": "two"},
    ]
    across = {"type": "category", "autorange": "reversed"}
    return [
        Figure("lines", "lines", lines, upper),
        Figure("bars", "bars", bars, base_layout(300, barmode="stack", yaxis=across)),
        Figure("map", "map", [_map()], base_layout(300)),
    ]


def _map() -> dict[str, Any]:
    stops = [[0, "#c8394d"], [0.5, "rgba(139,145,156,0.1)"], [1, BLUE]]
    rows = [[1.0, -0.5], [None, 1.0]]
    return {"type": "heatmap", "x": ["u", "v"], "y": ["u", "v"], "z": rows, "zmin": -1, "colorscale": stops}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("matplotlib")
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(render_page(Page("a page", [Figures(figures(), "what to see")])), encoding="utf-8")
    return path


def test_pdf_is_one_column_wide_and_has_its_fonts_in_it(page: Path) -> None:
    made = paper.draw_page(page, "pdf")
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
    page = render_page(Page("a page", [Figures(figures()[1:2], "what to see")]))
    for form, head in (("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")):
        first, second = (paper.draw_figures(page, form)[f"bars.{form}"] for _ in range(2))
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
        paper._drawn(figure.as_dict(), "pdf")
    above, below = seen[0].axes
    assert (above.get_ylabel(), below.get_ylabel()) == (r"σ, \$ & %", "a / (m/s²)")
    drawn = below.lines[0].get_xydata()
    assert np.array_equal(drawn[:, 0], TIMES)
    assert np.array_equal(drawn[:, 1], LEVELS, equal_nan=True)
    ends = [(patch.get_x(), patch.get_width()) for patch in seen[1].axes[0].patches]
    assert ends == [(0.0, 10.0), (0.0, 30.0), (10.0, 90.0), (30.0, 70.0)]
    assert seen[2].axes[0].images[0].get_array()[0].tolist() == [1.0, -0.5]


def test_packed_numbers_are_read_as_they_were_written() -> None:
    data = base64.b64encode(np.array([1.5, -2.0], dtype="<f4").tobytes()).decode()
    assert paper._values({"dtype": "f4", "bdata": data}).tolist() == [1.5, -2.0]
    assert paper._values(["<b>x</b>", "y &amp; z"]).tolist() == ["x", "y & z"]


def test_wrong_forms_and_a_missing_library_are_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match="give one of pdf, svg, png"):
        paper.draw_page(tmp_path / "a.html", "bmp")
    monkeypatch.setattr(paper, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"pip install matplotlib"):
        paper.require_library()
