"""What every kind of evidence owes to whoever reads about it: all three forms of a page, run on each kind."""

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from rich.console import Console
from tests.unit.calibration.evidence import EXAMPLES, HOSTILE, holds, thermal_curves
from tests.unit.report.test_calibration import Page as ReadPage

from tumble.calibration import Evidence, Magnetometer, ThermalCurves, TurnOns
from tumble.document import calibration_from_estimate, turn_ons_block
from tumble.earth import Site
from tumble.report.evidence import RENDERERS, render_evidence
from tumble.report.evidence.residuals import restless
from tumble.report.html import render_page
from tumble.report.page import Figures, Page, Sentences, Table, print_blocks
from tumble.report.subject import Subject


@pytest.fixture(scope="module")
def demo(hand_held: dict[str, Any]) -> Subject:
    """The demo recording by hand: holds and turns of its own, and parameters for the others to be about."""
    return Subject(**hand_held)


def test_every_kind_of_evidence_has_a_renderer_and_an_example() -> None:
    def kinds(of: type[Evidence]) -> set[type[Evidence]]:
        return {kind for own in of.__subclasses__() for kind in (own, *kinds(own))}

    assert kinds(Evidence) == set(RENDERERS) == set(EXAMPLES)


@pytest.mark.parametrize("kind", list(RENDERERS), ids=lambda kind: kind.__name__)
class TestEvidence:
    @pytest.fixture
    def page(self, kind: type[Evidence], demo: Subject) -> Page:
        """The evidence alone, in a report whose unit has a hostile name."""
        record = EXAMPLES[kind](demo)
        block = turn_ons_block(record) if isinstance(record, TurnOns) else None
        field = None
        if isinstance(record, Magnetometer):
            whole = replace(demo.estimate, evidence=[*demo.estimate.evidence, record])
            field = calibration_from_estimate(whole, demo.recording, Site.unknown()).magnetometer
        calibration = structs.replace(demo.calibration, turn_ons=block, magnetometer=field)
        estimate = replace(demo.estimate, evidence=[record])
        subject = replace(demo, calibration=calibration, estimate=estimate)
        return Page(f"Of {HOSTILE}", render_evidence(subject, kind))

    def test_it_says_something_and_html_escapes_what_came_from_outside(self, page: Page) -> None:
        assert any(isinstance(block, Figures | Table) for block in page.blocks)
        text = render_page(page)
        assert HOSTILE not in text
        assert "b" not in dict(ReadPage(text).tags)
        assert HOSTILE in ReadPage(text).text

    def test_the_terminal_shows_every_cell_and_every_sentence(self, page: Page) -> None:
        screen = Console(file=io.StringIO(), width=1000, highlight=False)
        print_blocks(page.blocks, screen)
        text = " ".join(screen.file.getvalue().split())
        told = [
            cell for block in page.blocks if isinstance(block, Table) for row in block.rows for cell in row
        ]
        told += [one for block in page.blocks if isinstance(block, Sentences) for one in block.sentences]
        assert [words for words in told if " ".join(words.split()) not in text] == []

    def test_its_figures_have_labels_captions_and_names_of_their_own(self, page: Page) -> None:
        names = [figure.name for figure in page.figures]
        assert len(set(names)) == len(names)
        assert all(figure.label and figure.marks and figure.height > 0 for figure in page.figures)
        assert all(block.caption for block in page.blocks if isinstance(block, Figures))


def test_a_restless_hold_is_told_by_its_number_and_its_time(demo: Subject) -> None:
    (table,) = (block for block in restless(holds(demo)) if isinstance(block, Table))
    assert table.rows[0][:2] == ["4", "12.5 to 17.3"]


def test_stamps_since_1970_are_drawn_from_the_recordings_start(demo: Subject) -> None:
    late = replace(demo, recording=replace(demo.recording, time=demo.recording.time + 1.7e9))
    late = replace(late, estimate=replace(late.estimate, evidence=[thermal_curves(late)]))
    figures = Page("Late", render_evidence(late, ThermalCurves)).figures
    (span,) = [figure for figure in figures if figure.name == "span"]
    # Rests of half a minute each minute: their middles.
    np.testing.assert_allclose(span.marks[1].x, 0.25 + np.arange(7), atol=1e-5)
