"""A reproduced table for people: cells, lines, JSON with all digits, a page that works offline."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from tumble.report import reproduction
from tumble.report.figures.on_page import plot
from tumble.reproduction import INSIDE, OUTSIDE, Curve, Marks, Outcome, Plot, Row

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
def test_a_cell_has_three_digits(value, text):
    assert reproduction.cell_text(value) == text


def test_lines_are_aligned_and_say_verdict_and_reason():
    lines = reproduction.outcome_lines(OUTCOME)
    head, first, second = lines[3], lines[4], lines[5]
    assert head.index("thesis") == first.index("1.23e-09") == second.index("20912")
    assert second.endswith("outside: 1 < 2")
    assert first.endswith("inside")
    assert "500 runs, seed 7, 1.2 s." in lines
    assert "1 of 2 rows inside. Inside: as it says." in lines
    assert lines[-2:] == ["- A note.", "Again: tumble reproduce paper-1.1 --repetitions 500 --seed 7"]


def test_json_has_all_digits_and_no_nan():
    document = json.loads(reproduction.outcome_json(OUTCOME), parse_constant=lambda word: pytest.fail(word))
    assert document["rows"][0]["cells"] == ["1: none", 1.23456789e-9]
    assert document["rows"][2]["cells"] == [None, None]
    assert document["rows"][1]["verdict"] == "outside"
    assert document["plots"][0]["curves"][0]["y"] == list(Y)
    assert (document["repetitions"], document["seed"]) == (500, 7)
    assert document["command"] == "tumble reproduce paper-1.1 --repetitions 500 --seed 7"


def test_csv_has_all_digits_and_a_column_for_every_cell():
    rows = list(csv.reader(reproduction.outcome_csv(OUTCOME).splitlines()))
    assert rows[0] == ["parameter", "unit", "case", "thesis", "verdict", "reason"]
    assert rows[1] == ["b x", "m/s²", "1: none", "1.23456789e-09", "inside", ""]
    assert rows[2] == ["s y", "ppm", "2: noise", "20912.4", "outside", "1 < 2"]
    assert rows[3] == ["θ zy", "µrad", "", "", "", ""]


def test_the_page_stands_alone_and_escapes_words():
    page = reproduction.render_outcome(OUTCOME)
    assert "Table &lt;1.1&gt;: it" in page
    assert "A. Paper &amp; Co" in page
    assert "Gyro &lt;scale&gt;" in page
    flat = re.sub(r">\s+<", "><", page)
    row = re.search(r'<tr class="outside has-why">(.*?)</tr><tr class="why">(.*?)</tr>', flat)
    words = [re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row[1])]
    assert words == ["s y", "ppm", "outside", "2: noise", "20912"]
    # the reason stands below, across all columns
    assert row[2] == '<td colspan="5">1 &lt; 2</td>'
    assert len(re.findall(r"<tr(?! class=\"why\")", page)) == 1 + len(OUTCOME.rows)
    # nothing is fetched when it is opened: addresses stand inside the drawing program alone
    outside = re.sub(r"<script[^>]*>.*?</script>", "", page, flags=re.S)
    assert not re.search(r"""(?:src|href)=|url\(""", outside)
    assert not re.search(r"<script[^>]+src=", page[: page.index("</head>")])


def test_a_figure_has_curves_in_their_bands_and_the_papers_numbers():
    marks = Marks("thesis", np.array([1.0, 100.0]), np.array([3e-6, 1e-3]))
    outcome = replace(OUTCOME, plots=[replace(PLOT, marks=marks)])
    page = reproduction.render_outcome(outcome)
    figure = plot(reproduction.figure_of(outcome.plots[0]))
    low, high, line, other_low, _, _, crosses = figure["data"]
    assert (line["x"], line["y"]) == (list(X), list(Y))
    assert (low["y"], high["y"]) == ([1.5e-6, 1.5e-7, 1.5e-8], [6e-6, 6e-7, 6e-8])
    # A zero has no logarithm: the band ends a hundredth of the line above it.
    np.testing.assert_allclose(other_low["y"], 2e-2 * Y, rtol=1e-5)
    assert (crosses["name"], crosses["y"]) == ("thesis", [3e-6, 1e-3])
    assert figure["layout"]["xaxis"]["type"] == figure["layout"]["yaxis"]["type"] == "log"
    assert "line: mean, band: 5 % to 95 %; crosses: thesis" in page


def test_axes_are_linear_where_asked_and_few_places_have_a_tick_each():
    straight = plot(reproduction.figure_of(replace(PLOT, linear=True)))
    assert "type" not in straight["layout"]["xaxis"]
    assert straight["data"][3]["y"] == [0.0, 0.0, 0.0]
    few = np.array([1.0, 4.0, 16.0])
    near = replace(PLOT, curves=(Curve("one", few, Y, Y, Y),))
    assert plot(reproduction.figure_of(near))["layout"]["xaxis"]["tickvals"] == [1, 4, 16]


def test_an_outcome_of_words_brings_no_drawing_program_and_is_asked_for_without_a_seed():
    bare = Outcome("x-1", "X", "Y", ("n",), [Row("a", "", (-1.5,))])
    page, lines = reproduction.render_outcome(bare), reproduction.outcome_lines(bare)
    assert "<script" not in page
    assert "<figure>" not in page
    assert len(page) < 20_000
    assert ">−1.5</td>" in page
    assert "rows inside" not in "\n".join(lines)
    assert "1 run, seed 0" in "\n".join(lines)
    still = replace(bare, simulated=False)
    assert still.command == "tumble reproduce x-1"
    assert "Nothing is simulated." in reproduction.outcome_lines(still)
