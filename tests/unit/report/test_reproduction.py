"""A reproduced table for people: cells, lines, JSON with all digits, pictures, a page that works offline."""

from __future__ import annotations

import csv
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from tumble.report.figures.svg_plot import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, draw_plot
from tumble.report.reproduction import (
    cell_text,
    outcome_csv,
    outcome_json,
    outcome_lines,
    outcome_pictures,
    render_outcome,
)
from tumble.reproduction.outcome import INSIDE, OUTSIDE, Curve, Marks, Outcome, Plot, Row

X = np.array([1.0, 10.0, 100.0])
Y = np.array([3e-6, 3e-7, 3e-8])
PLOT = Plot(
    "scale",
    "Gyro <scale>",
    "rate & more",
    "scale / ppm",
    (Curve("stated", X, Y, 0.5 * Y, 2.0 * Y), Curve("|difference|", X, 2 * Y, 0.0 * Y, 5.0 * Y)),
)
OUTCOME = Outcome(
    "paper-1.1",
    "Table <1.1>: it",
    "A. Paper & Co",
    ("case", "thesis"),
    [
        Row("b x", "m/s²", ("1: none", 1.23456789e-9), INSIDE),
        Row("s y", "ppm", ("2: noise", 20912.4), OUTSIDE, "1 < 2"),
        Row("θ zy", "µrad", (None, float("nan"))),
    ],
    "inside: as it says",
    [PLOT],
    ["A note."],
    500,
    7,
    1.25,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.23456e-9, "1.23e-09"),
        (0.0136, "0.0136"),
        (123.4, "123"),
        (20912.4, "20912"),
        (-1.641, "-1.64"),
        (3, "3"),
        (1.5e9, "1.50e+09"),
        (float("nan"), "none"),
        (float("inf"), "none"),
        ("two", "two"),
        (None, ""),
        (0.0, "0"),
    ],
)
def test_a_cell_has_three_digits(value: float | str | None, text: str) -> None:
    assert cell_text(value) == text


def test_lines_are_aligned_and_say_verdict_and_reason() -> None:
    lines = outcome_lines(OUTCOME)
    head, first, second = lines[3], lines[4], lines[5]
    assert head.index("thesis") == first.index("1.23e-09") == second.index("20912")
    assert second.endswith("outside: 1 < 2")
    assert first.endswith("inside")
    assert "500 runs, seed 7, 1.2 s." in lines
    assert "1 of 2 rows inside. Inside: as it says." in lines
    assert lines[-2:] == ["- A note.", "Again: tumble reproduce paper-1.1 --repetitions 500 --seed 7"]


def test_json_has_all_digits_and_no_nan() -> None:
    document = json.loads(outcome_json(OUTCOME), parse_constant=lambda word: pytest.fail(word))
    assert document["rows"][0]["cells"] == ["1: none", 1.23456789e-9]
    assert document["rows"][2]["cells"] == [None, None]
    assert document["rows"][1]["verdict"] == "outside"
    assert document["plots"][0]["curves"][0]["y"] == list(Y)
    assert (document["repetitions"], document["seed"]) == (500, 7)
    assert document["command"] == "tumble reproduce paper-1.1 --repetitions 500 --seed 7"


def test_csv_has_all_digits_and_a_column_for_every_cell() -> None:
    rows = list(csv.reader(outcome_csv(OUTCOME).splitlines()))
    assert rows[0] == ["parameter", "unit", "case", "thesis", "verdict", "reason"]
    assert rows[1] == ["b x", "m/s²", "1: none", "1.23456789e-09", "inside", ""]
    assert rows[2] == ["s y", "ppm", "2: noise", "20912.4", "outside", "1 < 2"]
    assert rows[3] == ["θ zy", "µrad", "", "", "", ""]


def test_a_picture_is_well_formed_and_its_points_are_where_their_logarithms_say() -> None:
    pictures = outcome_pictures(OUTCOME)
    assert set(pictures) == {"paper-1.1-scale.svg"}
    root = ET.fromstring(pictures["paper-1.1-scale.svg"])
    name = "{http://www.w3.org/2000/svg}"
    lines = root.findall(f".//{name}polyline")
    assert len(lines) == 2
    points = [tuple(map(float, pair.split(","))) for pair in lines[0].attrib["points"].split()]
    # x over two decades, edge to edge
    assert [p[0] for p in points] == pytest.approx([LEFT, (LEFT + WIDTH - RIGHT) / 2, WIDTH - RIGHT], abs=0.1)
    # a decade less is as far down each time
    assert points[1][1] - points[0][1] == pytest.approx(points[2][1] - points[1][1], abs=0.2)
    assert points[1][1] > points[0][1]
    for polygon in root.findall(f".//{name}polygon"):
        for pair in polygon.attrib["points"].split():
            x, y = map(float, pair.split(","))
            assert LEFT - 0.1 <= x <= WIDTH - RIGHT + 0.1
            assert TOP - 0.1 <= y <= HEIGHT - BOTTOM + 0.1
    assert root.find(f"{name}title") is not None
    assert "Gyro <scale>" in "".join(root.itertext())


def test_points_without_a_value_are_left_out() -> None:
    gap = np.array([1e-6, np.nan, 0.0])
    svg = draw_plot(Plot("p", "p", "x", "y", (Curve("a", X, gap, gap, gap), Curve("b", X, Y, Y, Y))))
    assert "nan" not in svg
    assert "inf" not in svg
    assert svg.count("<circle") == 1 + 3


def test_a_plot_without_any_value_is_an_empty_frame() -> None:
    nothing = np.full(3, np.nan)
    svg = draw_plot(Plot("p", "none", "x", "y", (Curve("a", X, nothing, nothing, nothing),)))
    ET.fromstring(svg)
    assert "<circle" not in svg


def test_the_page_stands_alone_and_escapes_words() -> None:
    page = render_outcome(OUTCOME)
    assert "Table &lt;1.1&gt;: it" in page
    assert "A. Paper &amp; Co" in page
    assert "Gyro &lt;scale&gt;" in page
    flat = re.sub(r">\s+<", "><", page)
    row = re.search(r'<tr class="outside has-why">(.*?)</tr><tr class="why">(.*?)</tr>', flat)
    assert row is not None
    words = [re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row[1])]
    assert words == ["s y", "ppm", "outside", "2: noise", "20912"]
    # the reason stands below, across all columns
    assert row[2] == '<td colspan="5">1 &lt; 2</td>'
    assert len(re.findall(r"<tr(?! class=\"why\")", page)) == 1 + len(OUTCOME.rows)
    # nothing is fetched when it is opened: addresses stand inside the drawing program alone
    outside = re.sub(r"<script[^>]*>.*?</script>", "", page, flags=re.S)
    assert not re.search(r"""(?:src|href)=|url\(""", outside)
    assert not re.search(r"<script[^>]+src=", page[: page.index("</head>")])


def test_numbers_of_the_paper_are_crosses_of_their_own() -> None:
    plot = Plot(
        "p", "p", "x", "y", PLOT.curves, Marks("thesis", np.array([1.0, 100.0]), np.array([3e-6, 1e-3]))
    )
    svg = draw_plot(plot)
    ET.fromstring(svg)
    crosses = [tuple(map(float, pair)) for pair in re.findall(r'<path d="M([\d.]+),([\d.]+)l10', svg)]
    # one in the legend; the first on the first point of the line, the second as far right and in the frame
    assert len(crosses) == 3
    assert crosses[0][0] + 5 == pytest.approx(LEFT, abs=0.1)
    first = re.search(r'<polyline points="[\d.]+,([\d.]+)', svg)
    assert first is not None
    assert crosses[0][1] + 5 == pytest.approx(float(first[1]), abs=0.11)
    assert crosses[1][0] + 5 == pytest.approx(WIDTH - RIGHT, abs=0.1)
    assert TOP - 0.1 <= crosses[1][1] + 5 <= HEIGHT - BOTTOM
    assert "thesis" in svg
    page = render_outcome(Outcome("x-1", "X", "Y", (), [], plots=[plot]))
    assert '"thesis"' in page
    assert "crosses: thesis" in page


def test_a_page_of_words_brings_no_drawing_program() -> None:
    page = render_outcome(Outcome("x-1", "X", "Y", ("n",), [Row("a", "", (-1.5,))]))
    assert "<script" not in page
    assert len(page) < 20_000
    assert ">−1.5</td>" in page


def test_what_is_not_simulated_is_asked_for_without_a_seed() -> None:
    outcome = Outcome("x-1", "X", "Y", ("n",), [Row("a", "", (1,))], simulated=False)
    assert outcome.command == "tumble reproduce x-1"
    assert "Nothing is simulated." in outcome_lines(outcome)


def test_an_outcome_without_figures_has_none() -> None:
    bare = Outcome("x-1", "X", "Y", ("n",), [Row("a", "", (1,))])
    assert outcome_pictures(bare) == {}
    assert "<figure>" not in render_outcome(bare)
    assert "rows inside" not in "\n".join(outcome_lines(bare))
    assert "1 run, seed 0" in "\n".join(outcome_lines(bare))


def test_on_linear_axes_points_are_where_their_values_say_and_what_is_negative_is_there() -> None:
    x, y = np.array([1.0, 25.0, 48.0]), np.array([-12.0, 3.0, 38.0])
    curve = Curve("one", x, y, y - 5.0, y + 7.0)
    plot = Plot("norms", "Norms", "position", "µg", (curve,), linear=True, line="one run")
    svg = draw_plot(plot)
    ET.fromstring(svg)
    # 50 over ten steps of five, -20 to 50 of sixty-two values' span over steps of ten
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', svg)
    for (across, up), one, other in zip(circles, x, y, strict=True):
        assert float(across) == pytest.approx(LEFT + (WIDTH - LEFT - RIGHT) * one / 50.0, abs=0.06)
        height = (HEIGHT - TOP - BOTTOM) * (other + 20.0) / 70.0
        assert float(up) == pytest.approx(HEIGHT - BOTTOM - height, abs=0.06)
    ticks = re.findall(r'text-anchor="end">(−?\d+)</text>', svg)
    assert ticks == ["−20", "−10", "0", "10", "20", "30", "40", "50"]
    assert "line: one run; band: 5 % to 95 %" in svg
    page = render_outcome(Outcome("p-1", "t", "s", ("a",), [Row("r", "", (1.0,))], plots=[plot]))
    assert "line: one run, band" in page
    assert '"type":"log"' not in page.replace(" ", "")


def test_a_flat_line_and_nothing_at_all_have_linear_axes_too() -> None:
    flat, nothing = np.full(3, 4.0), np.full(3, np.nan)
    for y in (flat, nothing):
        svg = draw_plot(Plot("p", "p", "x", "y", (Curve("a", X, y, y, y),), linear=True))
        ET.fromstring(svg)
        assert "nan" not in svg
