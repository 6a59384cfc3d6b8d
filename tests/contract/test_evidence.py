"""What every kind of evidence owes to whoever reads about it: all three forms of a page, run on each kind."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import as_file, files

import numpy as np
import pytest
from msgspec import structs
from rich.console import Console
from tests.unit.report.test_calibration import Page as ReadPage

from tumble.calibration import (
    Agreement,
    Beside,
    BiasCurve,
    BiasScatter,
    Budget,
    Candidate,
    Detectable,
    Evidence,
    FieldHold,
    GivenField,
    GlobalTest,
    Holds,
    LeftOut,
    Magnetometer,
    ModelChoice,
    RecordingOfUnit,
    RestlessHold,
    Spins,
    ThermalCurves,
    TurnOns,
    Turns,
    UncertaintyStatement,
    judge_magnetometer,
    magnetometer_alone,
)
from tumble.document import block_of_magnetometer, turn_ons_block
from tumble.earth import Site
from tumble.recording import MagneticField
from tumble.report import (
    RENDERERS,
    Figures,
    Page,
    Sentences,
    Subject,
    Table,
    print_blocks,
    render_evidence,
    render_page,
)

HOSTILE = "</script><b>&\"'`[red]"


@pytest.fixture(scope="module")
def demo() -> Subject:
    """The demo recording by hand: holds and turns of its own, and parameters for the others to be about."""
    from tumble.workflows import GRAVITY, RATE, RECORDING, calibrate

    with as_file(files("tumble") / "data" / RECORDING) as path:
        run = calibrate(
            path,
            procedure="hand-held",
            site=Site.from_gravity(GRAVITY),
            columns="ax,ay,az,gx,gy,gz",
            units="m/s^2,rad/s",
            rate=RATE,
            imu=(HOSTILE, None),
        )
    return Subject(run.calibration, run.estimate, run.recording, run.timeline, run.means)


def holds(demo: Subject) -> Evidence:
    return replace(demo.estimate.holds, restless=(RestlessHold(3, 12.5, 17.25, 4.1e-3, 2.3e-4),))


def turns(demo: Subject) -> Evidence:
    return demo.estimate.turns


def spins(demo: Subject) -> Evidence:
    rates = np.array([0.7, -1.4])
    residuals = np.array([[1e-4, -2e-4, 3e-5], [4e-5, 5e-4, np.nan]])
    return Spins(rates, residuals, np.full((2, 3), 1.5e-5), (f"up {HOSTILE}", "down"))


def thermal_curves(demo: Subject) -> Evidence:
    celsius = np.linspace(-10.0, 50.0, 7)
    state = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0, -1.0])
    seen = 1e-3 * np.sin(celsius)[:, None] * [1.0, -2.0, 0.5]
    curve = BiasCurve(celsius, seen, np.full((7, 3), 2e-4), seen + 1e-4, seen - 1e-4)
    time = demo.recording.time[0] + 60.0 * np.arange(7)
    return ThermalCurves(
        kind="soak",
        basis="lines",
        start=time,
        stop=time + 30.0,
        celsius=celsius,
        celsius_rate=np.zeros(7),
        hysteresis=state,
        force=seen,
        rate=seen,
        rate_sigma=np.full((7, 3), 1e-4),
        residuals=np.full((7, 6), 0.5),
        curves={"accelerometer": curve, "gyroscope": curve},
        path_time=time,
        path_celsius=celsius,
        candidates=[Candidate(HOSTILE, 12, 1.07, 0.11, chosen=True)],
        rejected=[(float(time[0]), float(time[1]), f"not settled {HOSTILE}")],
    )


def turn_ons(demo: Subject) -> Evidence:
    values, sigmas = np.array([0.12, 0.17, np.nan]), np.array([0.011, 0.013, np.nan])
    names = [HOSTILE, "second", "third"]
    recordings = [RecordingOfUnit(name, 26, 25, 0, 1.04, {}, 180.0, 100.0) for name in names]
    first, scale = (demo.estimate.parameters[k] for k in (0, 3))
    bias = BiasScatter(
        first.name, first.unit, values, sigmas, 0.145, 0.008, 0.035, 0.012, 1, 8.6, 0.0034, 12.7
    )
    agreement = Agreement(scale.name, scale.unit, values, sigmas, 0.14, 0.008, 8.6, 1, 0.0034, 0.01)
    return TurnOns(recordings, [bias], [agreement], 8.6, 1, 0.0034)


def beside(demo: Subject) -> Evidence:
    ours = demo.estimate.parameters
    other = [replace(p, value=1.01 * p.value, standard_uncertainty=2 * p.standard_uncertainty) for p in ours]
    return Beside(replace(demo.estimate, procedure=HOSTILE, parameters=other, evidence=[]), HOSTILE)


def budget(demo: Subject) -> Evidence:
    sigmas = np.array([p.standard_uncertainty for p in demo.estimate.parameters])
    statement = UncertaintyStatement(
        effective_degrees=np.full(len(sigmas), 41.0),
        coverage_factors=np.full(len(sigmas), 2.02),
        source_degrees={HOSTILE: 40.0},
        test=GlobalTest(123.0, 110, 0.19, 0.003, 1),
        detectable=[
            Detectable("force", 4, 3, 0.7, 0.013, 2, 5.5),
            Detectable("turn", 5, 3, 0.0, np.inf, 1, np.inf),
        ],
        model_choice=[ModelChoice("g_sensitivity", True, 0.008, 0.01, 0.4 * sigmas)],
        not_included=[f"What {HOSTILE} does."],
    )
    return Budget({HOSTILE: 0.8 * sigmas, "wander": 0.6 * sigmas}, statement)


def magnetometer(demo: Subject) -> Evidence:
    rng = np.random.default_rng(5)
    directions = rng.standard_normal((600, 3))
    field = 49e-6 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    matrix = 1e6 * np.array([[1.1, 0.02, 0.03], [-0.04, 0.9, 0.05], [0.01, -0.06, 1.2]])
    values = field @ matrix.T + [3, -8, 20]
    noisy = MagneticField(np.arange(600.0), values + 0.3 * rng.standard_normal((600, 3)), "uT")
    made = magnetometer_alone(noisy, GivenField(49e-6, 2e-7, 1.1, f"from {HOSTILE}"))
    holds = tuple(FieldHold(k, 10.0 * k, 49e-6 + 1e-8 * k, 1.1 + 1e-3 * k, k == 2) for k in range(4))
    out = LeftOut("hold", 2, f"its field {HOSTILE}")
    return replace(made, holds=holds, left_out=(out,), dip=1.1, dip_sigma=2e-3, not_determined=(HOSTILE,))


EXAMPLES: dict[type[Evidence], Callable[[Subject], Evidence]] = {
    Holds: holds,
    Turns: turns,
    Spins: spins,
    ThermalCurves: thermal_curves,
    TurnOns: turn_ons,
    Beside: beside,
    Budget: budget,
    Magnetometer: magnetometer,
}


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
            field = block_of_magnetometer(record, judge_magnetometer(record))
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


def test_stamps_since_1970_are_drawn_from_the_recordings_start(demo: Subject) -> None:
    late = replace(demo, recording=replace(demo.recording, time=demo.recording.time + 1.7e9))
    late = replace(late, estimate=replace(late.estimate, evidence=[thermal_curves(late)]))
    figures = Page("Late", render_evidence(late, ThermalCurves)).figures
    (span,) = [figure for figure in figures if figure.name == "span"]
    # Rests of half a minute each minute: their middles.
    np.testing.assert_allclose(span.marks[1].x, 0.25 + np.arange(7), atol=1e-5)
