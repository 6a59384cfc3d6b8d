"""Pages and terminals: escaped, offline, folded, every number and sentence once, and nothing that a terminal obeys."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from rich.console import Console
from tests.unit.export.a_unit import compass

from tumble.noise import characterise
from tumble.parameters import TEMPERATURE
from tumble.recording import Recording, Source
from tumble.report.html import render_page
from tumble.report.noise import noise_lines, noise_page, noise_rows, practical_unit, si_unit
from tumble.report.page import Figures, Page, Sentences, Table, Verdict, aligned, print_blocks, section
from tumble.report.parameters import parameter_rows
from tumble.report.summary import print_calibration, verdict_line


def cells(table):
    return re.findall(r"<td[^>]*>(.*?)</td>", render_page(Page("Cells", [table])))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-0.5 ± 0.1", "−0.5 ± 0.1"),
        ("[-0.5, -.25]", "[−0.5, −.25]"),
        ("3.2e-05", "3.2e−05"),
        ("(1.2 ± 0.3)e-4", "(1.2 ± 0.3)e−4"),
        ("edge of -x and +y", "edge of −x and +y"),
        ("non-orthogonality yz", "non-orthogonality yz"),
        ("step-003.csv of 2026-01-02", "step-003.csv of 2026-01-02"),
        ("--turn-on-bias", "--turn-on-bias"),
    ],
)
def test_a_minus_is_a_minus_and_a_hyphen_a_hyphen(text, shown):
    assert cells(Table(["what"], [[text]])) == [shown]
    assert cells(Table(["what"], [[text]], verbatim=True)) == [text]


def test_what_stands_between_backticks_is_code_and_a_single_one_is_itself():
    page = render_page(Page("Code", [Sentences(["Say `tumble <x>` twice.", "A ` alone."])]))
    assert "Say <code>tumble &lt;x&gt;</code> twice." in page
    assert "A ` alone." in page
    # A page without figures brings no script and may run none, and no sentence leaves no empty list.
    assert "<script" not in page
    assert "script-src" not in page
    assert len(section("Nothing", Sentences([]), Figures([], "none"))) == 2


def test_many_columns_may_be_broader_than_the_text_and_long_words_fold():
    """At 1280 pixels no table has to be moved sideways: fourteen columns are the most that a report has."""
    many = render_page(Page("Many", [Table([f"source {k}" for k in range(14)], [["1.2e-05"] * 14])]))
    assert '<div class="scroll broad"><table class="dense">' in many
    words = "accelerometer bias 77 %, accelerometer scale and angles 17 %"
    few = render_page(Page("Few", [Table(["after", "most of it from"], [["10 s", words]])]))
    assert f'<td class="words">{words}</td>' in few
    assert "broad" not in few.split("</style>")[1]


class Harmless(Console):
    """Shows what a terminal would obey."""

    def render_str(self, text, **options):
        return super().render_str(text.replace("\x1b", "<ESC>"), **options)


def shown_of(*blocks, width=120):
    screen = Harmless(file=io.StringIO(), width=width, highlight=False)
    print_blocks(blocks, screen)
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue()


def test_nothing_of_a_table_reaches_the_terminal_past_the_console():
    rows = [["\x1b[2Jgroup"], ["\x1b[2Jcell", "[red]1[/red]", ":smile:"]]
    text = shown_of(Table(["\x1b[2Jhead", "b", "c"], rows, {0: "group"}))
    assert "\x1b" not in text
    assert text.count("<ESC>[2J") == 3
    assert "[red]1[/red]" in text
    assert ":smile:" in text


@pytest.mark.parametrize(("width", "shown"), [(120, True), (80, False)])
def test_a_narrow_terminal_leaves_out_the_spare_columns(width, shown):
    text = shown_of(Table(["a", "b", "c"], [["first", "second", "third"]], spare=1), width=width)
    assert "second" in text
    assert ("third" in text) == shown


def test_a_verdict_is_in_capitals_and_its_reasons_stand_below():
    text = shown_of(Sentences(["One.", "Two."]), Verdict(False, "Does not serve", ["It drifts [a lot]."]))
    assert text == "- One.\n- Two.\n\nDOES NOT SERVE\n- It drifts [a lot].\n"


def test_lines_are_aligned_and_a_row_of_one_cell_stands_alone():
    rows = [["name", "value"], ["group"], ["long name", "1"]]
    assert aligned(rows) == ["name       value", "", "group", "long name  1"]


def printed(calibration, *, width=200, verbose=True):
    console = Console(file=io.StringIO(), width=width, highlight=False)
    print_calibration(calibration, console, verbose=verbose)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("use", ["fit", "fit with reservations", "not fit"])
def test_one_line_says_the_verdict_and_the_magnetometers_where_it_is_not_plainly_fit(calibration, use):
    block = compass(verdict={"use": use, "reasons": ["Its axes are mirrored.", "And more."]})
    plain = "NOT FIT FOR USE. Too [red]few[/red] holds. Written: /made/calibration.json"
    assert verdict_line(calibration, [Path("/made/calibration.json")]) == plain
    line = verdict_line(structs.replace(calibration, magnetometer=block), [])
    said = f" Magnetometer: {use}. Its axes are mirrored."
    assert line == verdict_line(calibration, []) + ("" if use == "fit" else said)


@pytest.mark.parametrize("verbose", [True, False])
@pytest.mark.parametrize("width", [40, 60, 80])
def test_a_narrow_terminal_folds_and_cuts_nothing_off(calibration, width, verbose):
    text = printed(calibration, width=width, verbose=verbose)
    assert "…" not in text
    assert all(len(line) <= width for line in text.splitlines())


def test_wide_numbers_stand_a_family_a_line_and_no_number_is_torn_apart():
    from tumble.report.summary import _joined

    cells: list[tuple[str, ...]] = [
        ("± one sigma", "x", "y", "z", ""),
        ("acc. scale factor", "847.069 ± 0.061", "826.574 ± 0.060", "836.137 ± 0.063", "counts/(m/s²)"),
    ]
    assert _joined(cells, [], 90)[1:] == [
        "acc. scale factor: 847.069 ± 0.061, 826.574 ± 0.060, 836.137 ± 0.063 counts/(m/s²)"
    ]
    narrow = _joined(cells, [], 50)[1:]
    assert max(map(len, narrow)) <= 50
    assert "826.574 ± 0.060" in " ".join(narrow)


RATE = 100.0


@pytest.fixture(scope="module")
def noise():
    rng = np.random.default_rng(4)
    force, turn = rng.standard_normal((2, 20_000, 3))
    time = np.arange(20_000) / RATE
    return characterise(Recording(time, 0.02 * force + 9.8, 0.001 * turn, "m/s^2", "rad/s", RATE))


@pytest.mark.parametrize(
    ("index", "letter", "value", "expected", "unit"),
    [
        # 1 rad/s/√Hz is 57.2958 °/√s, sixty times that by the root of an hour.
        (3, "N", 1.0, 57.29577951 * 60.0, "°/√h"),
        (3, "B", 1.0, 57.29577951 * 3600.0, "°/h"),
        (3, "K", 1.0, 57.29577951 * 3600.0 * 60.0, "°/h/√h"),
        (3, "R", 1.0, 57.29577951 * 3600.0 * 3600.0, "°/h/h"),
        (3, "Q", 1.0, 57.29577951 * 3600.0, "″"),
        (0, "N", 9.80665e-6, 1.0, "µg/√Hz"),
        (0, "B", 9.80665e-6, 1.0, "µg"),
        (0, "K", 9.80665e-6, 60.0, "µg/√h"),
        (0, "R", 9.80665e-6, 3600.0, "µg/h"),
        (0, "Q", 0.002, 2.0, "mm/s"),
    ],
)
def test_units_that_people_use(noise, index, letter, value, expected, unit):
    factor, name = practical_unit(noise.channels[index], letter)
    assert name == unit
    assert factor * value == pytest.approx(expected, rel=1e-9)
    counts = replace(noise.channels[index], unit="counts")
    assert practical_unit(counts, "N") == (1.0, "counts/√Hz")
    assert si_unit(counts, "B") == "counts"


def test_rows_say_what_is_seen_and_how_large_the_rest_may_be(noise):
    assert any("not seen" in line for line in noise_lines(noise.channels))
    assert not any("not seen" in line for line in noise_lines(noise.channels, seen_only=True))
    rows = {row.letter: row for row in noise_rows(noise.channels[3])}
    assert rows["N"].seen
    # 0.001 rad/s a sample at 100 Hz is 1e-4 rad/s/√Hz, 0.344 °/√h.
    assert float(rows["N"].practical.split(" ±")[0]) == pytest.approx(0.3438, rel=0.03)
    assert not rows["B"].seen
    assert rows["B"].practical.startswith("not seen, < ")
    assert "e+" not in rows["K"].practical


def test_a_files_name_cannot_write_into_the_page(noise):
    named = replace(noise, sources=(Source("<script>alert(1)</script>.csv", "0" * 64),))
    page = render_page(noise_page(named, "tumble noise <b>"))
    assert "<script>alert" not in page
    assert "tumble noise &lt;b&gt;" in page


def test_stamps_since_1970_leave_the_seconds_their_digits(noise):
    """Time is drawn from the first instant on: each second of the levels has a place of its own."""
    late = replace(noise, level_time=noise.level_time + 1.7e9)
    drawn = [
        {figure.name: figure for figure in noise_page(one, "tumble noise").figures} for one in (noise, late)
    ]
    early, epoch = (figures["level-g"].marks[0].x for figures in drawn)
    assert epoch[0] == 0.0
    assert len(set(epoch)) == len(epoch)
    np.testing.assert_allclose(epoch, early, atol=1e-5)  # stamps of 1.7e9 s have 2e-7 s of round-off


def test_a_terminal_shows_every_parameter_with_its_interval_and_all_sentences_as_written(
    calibration, write_calibration
):
    text, short = printed(calibration), printed(calibration, verbose=False, width=80)
    for row in parameter_rows(calibration):
        line = next(
            line for line in text.splitlines() if line.startswith(row.label) and row.shown.text in line
        )
        assert row.shown.interval(2.0) in line
        assert row.other is None or row.other.text in line
        assert row.said.number in short or row.group == TEMPERATURE, row.name
    groups = ["Accelerometer", "Gyro", "Between the triads", "Optional terms"]
    assert [line for line in map(str.strip, text.splitlines()) if line in groups] == groups
    assert "NOT FIT FOR USE" in text
    assert "Too [red]few[/red] holds." in text  # square brackets in a sentence are no markup
    assert "Left out: hold 7: it was knocked." in text
    assert short.startswith("NOT FIT FOR USE\n")
    assert "interval" not in short
    for one in (text, short):
        assert "Not determined: What [bold]this[/bold] cannot tell." in one
    fit = printed(write_calibration(verdict={"fit": True, "reasons": ["Residuals are small."]}))
    assert "FIT FOR USE" in fit
    assert "NOT FIT" not in fit
