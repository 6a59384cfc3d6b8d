"""What the figures draw on the page, and as files for a paper: one column wide, fonts embedded, the same numbers."""

import base64
import io
from typing import Any

import numpy as np
import pypdf
import pytest

from tumble.attitude import twenty_six_directions
from tumble.errors import UsageError
from tumble.report.evidence.residuals import nominal_hold_norms, nominal_turn_angles
from tumble.report.figures import on_paper
from tumble.report.figures.on_page import packed, plot
from tumble.report.figures.parameters import missing_directions, poses
from tumble.report.figures.record import Axis, Bars, Curve, Figure, Map, Points, plain
from tumble.report.figures.timeline import envelope, timeline
from tumble.report.page import Figures, Sentences
from tumble.report.subject import Subject, pose_words
from tumble.segmentation import MatchedSpin, Matching


def drawn(blocks):
    """The figures among the blocks of a section."""
    (figures,) = [block for block in blocks if isinstance(block, Figures)]
    return figures


def test_a_spike_of_one_sample_survives_decimation():
    time = np.arange(50_000) / 100.0
    signal = np.zeros((50_000, 3))
    signal[23_456, 1] = 7.0
    signal[34_567, 2] = -3.0
    drawn = envelope(time, signal, bins=1000)
    assert drawn.values.shape == (2000, 3)
    assert np.array_equal(np.nanmax(drawn.values, axis=0), [0.0, 7.0, 0.0])
    assert np.array_equal(np.nanmin(drawn.values, axis=0), [0.0, 0.0, -3.0])
    at = drawn.start + drawn.step * int(np.argmax(drawn.values[:, 1]))
    # A bin is half a second long here.
    assert at == pytest.approx(234.56, abs=0.5)


def test_a_gap_is_drawn_as_a_gap():
    time = np.concatenate([np.arange(100), np.arange(900, 1000)]) / 10.0
    drawn = envelope(time, np.ones((200, 3)), bins=10)
    empty = np.isnan(drawn.values[:, 0])
    # Ten bins of 9.99 s: the middle eight hold no sample, but that the second holds sample 100 at 9.99 s.
    assert empty.tolist() == [False] * 2 + [True] * 16 + [False] * 2


@pytest.mark.parametrize("samples", [1, 2, 3, 7])
def test_a_few_samples_are_drawn_too(samples):
    signal = np.arange(3.0 * samples).reshape(samples, 3)
    drawn = envelope(np.arange(samples) / 10.0, signal)
    assert np.nanmin(drawn.values) == 0.0
    assert np.nanmax(drawn.values) == 3.0 * samples - 1.0


def test_every_stretch_of_the_timeline_can_be_pointed_at(hand_held):
    found = hand_held["timeline"]
    figure = drawn(timeline(Subject(**hand_held))).figures[0]
    bars = {mark.name: mark for mark in figure.marks if isinstance(mark, Bars)}
    assert len(bars["holds"].words) == len(found.holds)
    assert len(bars["turns"].words) == len(found.turns)
    # The legend has a name for every colour of the strip, and the caption's words.
    legend = legend_of(figure)
    assert {c for bar in bars.values() for c in bar.colour} == set(legend.values())
    assert "rejected, swaying or not used" in legend
    for rejection, text in zip(found.rejections, bars["rejected"].words, strict=True):
        assert rejection.reason.split("<")[0] in text


def legend_of(figure):
    return {mark.name: mark.colour for mark in figure.marks if getattr(mark, "symbol", "") == "square"}


def test_nominal_norms_of_si_values_are_their_norms(hand_held):
    means = hand_held["means"]
    before = nominal_hold_norms(hand_held["recording"], means, 9.81)
    expected = np.sqrt((means.specific_force**2).sum(axis=1)) - 9.81
    np.testing.assert_allclose(before.residuals, expected, atol=1e-12)  # arithmetic


def test_counts_are_compared_with_rough_values(in_counts, hand_held):
    """Rough values of bias and scale leave less than the raw values of the same holds, but more than nothing."""
    rough = nominal_hold_norms(in_counts["recording"], in_counts["means"], 9.81)
    raw = nominal_hold_norms(hand_held["recording"], hand_held["means"], 9.81)
    assert 0.0 < np.std(rough.residuals) < np.std(raw.residuals)
    assert "counts" in rough.words


def test_turns_are_worse_before_than_after(hand_held):
    """The unit's gyro has 14 mrad of non-orthogonality: 0.8° on a turn, against 0.1° after."""
    estimate = hand_held["estimate"]
    before = nominal_turn_angles(
        hand_held["recording"], hand_held["timeline"], hand_held["means"], estimate.model
    )
    assert np.array_equal(np.isnan(before.residuals), np.isnan(estimate.turns.angles))
    rms_before = np.sqrt(np.nanmean(before.residuals**2))
    rms_after = np.sqrt(np.nanmean(estimate.turns.angles**2))
    assert rms_after < rms_before < np.radians(3.0)


def test_spins_have_a_colour_and_a_legend_of_their_own(hand_held):
    first, _, third, *_ = hand_held["timeline"].turns
    spun = tuple(MatchedSpin(step, turn.start, turn.stop) for step, turn in ((1, first), (5, third)))
    shown = drawn(timeline(Subject(**hand_held, matching=Matching((), spun, (), ()))))
    bars = {mark.name: mark for mark in shown.figures[0].marks if isinstance(mark, Bars)}
    assert len(bars["spins"].words) == 2
    assert bars["spins"].words[0].startswith("spin 1")
    (colour,) = set(bars["spins"].colour)
    assert legend_of(shown.figures[0])["spins"] == colour
    assert colour not in {c for name in ("holds", "turns") for c in bars[name].colour}
    assert "teal a spin" in shown.caption
    assert "spin" not in drawn(timeline(Subject(**hand_held))).caption


TIMES, LEVELS = np.array([0.0, 1.0, 2.5]), np.array([3.0, np.nan, -4.0])


def examples():
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


def test_pdf_is_one_column_wide_and_has_its_fonts_in_it(tmp_path):
    pytest.importorskip("matplotlib")
    made = on_paper.write_figures(examples(), tmp_path / "examples", "pdf")
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


def test_each_form_is_itself_and_twice_the_same_bytes():
    pytest.importorskip("matplotlib")
    for form, head in (("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")):
        first, second = (on_paper.draw(examples()[1], form) for _ in range(2))
        assert first == second
        assert first.startswith(head)
        # A journal's editor has not the page's fonts: texts are outlines.
        assert form != "svg" or b"<text" not in first


def test_what_is_drawn_is_what_the_page_carries(monkeypatch):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure as Drawn

    seen: list[Any] = []
    monkeypatch.setattr(Drawn, "savefig", lambda self, *_, **__: seen.append(self))
    for figure in examples():
        on_paper.draw(figure, "pdf")
    above, below = seen[0].axes
    assert (above.get_ylabel(), below.get_ylabel()) == (r"σ, \$ & %", "a / (m/s²)")
    drawn = below.lines[0].get_xydata()
    assert np.array_equal(drawn[:, 0], TIMES)
    assert np.array_equal(drawn[:, 1], LEVELS, equal_nan=True)
    ends = [(patch.get_x(), patch.get_width()) for patch in seen[1].axes[0].patches]
    assert ends == [(0.0, 10.0), (0.0, 30.0), (10.0, 90.0), (30.0, 70.0)]
    assert seen[2].axes[0].images[0].get_array()[0].tolist() == [1.0, -0.5]
    lines, bars, cells = (plot(figure) for figure in examples())
    assert [trace["yaxis"] for trace in lines["data"][1:]] == ["y2"]
    assert lines["data"][0]["y"] == [3.0, None, -4.0]
    assert lines["layout"]["xaxis"]["anchor"] == "y"
    assert [trace["name"] for trace in bars["data"]] == ["one &amp; [10.0, 30.0]", "one &amp; [90.0, 70.0]"]
    assert bars["layout"]["barmode"] == "stack"
    assert cells["data"][0]["z"] == [[1.0, -0.5], [None, 1.0]]


def test_wrong_forms_and_a_missing_library_are_one_sentence(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match="give one of pdf, svg, png"):
        on_paper.write_figures(examples(), tmp_path, "bmp")
    monkeypatch.setattr(on_paper, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"pip install matplotlib"):
        on_paper.require_library()


def test_numbers_are_packed_as_little_endian_float32_and_what_is_not_finite_becomes_null():
    bytes_of = base64.b64encode(b"\x00\x00\xc0\x3f\x00\x00\x00\xc0").decode()
    assert packed(np.array([1.5, -2.0])) == {"dtype": "f4", "bdata": bytes_of}
    assert plain([1.23456789, float("nan"), float("inf")], 4) == [1.235, None, None]


def test_holds_of_one_pose_share_a_label_and_poses_that_no_hold_is_nearest_to_are_named():
    standard = twenty_six_directions()
    tilted = standard[[0, 5, 20]] + [0.1, -0.05, 0.02]
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    assert np.array_equal(missing_directions(tilted), np.delete(standard, [0, 5, 20], axis=0))
    notes = poses(np.delete(standard, 2, axis=0) * 9.81, set())[-1]
    assert isinstance(notes, Sentences)
    assert notes.sentences[-1] == f"Missing: {pose_words(standard[2])}."
    assert "−" in pose_words(np.array([-1.0, 0.0, 0.0]))
    up = np.array([[0.0, 0.0, 9.8], [0.0, 9.8, 0.0], [0.1, 0.0, 9.8]])
    holds: Any = drawn(poses(up, {1})).figures[0].marks[-1]
    assert holds.labels == ["1, 3", "2", ""]
    assert len(set(holds.colour)) == 2  # the one left out is marked
