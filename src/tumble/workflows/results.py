"""What a calibration leaves: the run with everything behind it, its files, and its report."""

from __future__ import annotations

import time
from dataclasses import field
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.document import calibration_html
from tumble.errors import CalibrationFileError, OutputError
from tumble.recording import Recording
from tumble.records import dataclass

if TYPE_CHECKING:
    from tumble.calibration import Estimate
    from tumble.document import Calibration
    from tumble.protocol import Protocol
    from tumble.report import Page, Subject
    from tumble.segmentation import HoldMeans, Matching, Timeline

OF_A_PAPER = "The estimator {} as its paper has it, not tumble's own."


@dataclass
class CalibrationRun:
    """What `calibrate` made: the calibration, everything behind it, and where the files are.

    `reason` says why the procedure was chosen; `matching` which hold is which step of the `protocol`, where
    one was given; `seconds` what each stage took; `predicted` the standard uncertainties (SI) of a plan.json beside the
    protocol; `papers` by file name what a paper's own estimator makes of the recording.
    """

    calibration: Calibration
    estimate: Estimate
    recording: Recording
    timeline: Timeline
    means: HoldMeans
    reason: str
    protocol: Protocol | None = None
    matching: Matching | None = None
    files: list[Path] = field(default_factory=list[Path])
    seconds: dict[str, float] = field(default_factory=dict[str, float])
    predicted: dict[str, float] = field(default_factory=dict[str, float])
    papers: dict[str, Calibration] = field(default_factory=dict[str, "Calibration"])

    @property
    def accepted(self) -> bool:
        """Whether the calibration is fit for use, and within its limits if it was held against any."""
        limits = self.calibration.limits
        return self.calibration.verdict.fit and (limits is None or limits.decision == "passed")

    def __repr__(self) -> str:
        holds, turns = len(self.timeline.holds), len(self.timeline.turns)
        where = f"; files: {', '.join(map(str, self.files))}" if self.files else ""
        return f"<CalibrationRun of {holds} holds and {turns} turns: {self.calibration!r}{where}>"

    def to_frame(self) -> Any:
        """Return the parameters as a data frame of polars, see `Calibration.to_frame`."""
        return self.calibration.to_frame()

    def figures(self) -> dict[str, Any]:
        """Return the report's figures by name, as a notebook shows them: each a `plotly.graph_objects.Figure`."""
        from plotly import graph_objects

        from tumble.report import plot

        plots = map(plot, self.page().figures)
        return {
            plot["name"]: graph_objects.Figure(data=plot["data"], layout=plot["layout"]) for plot in plots
        }

    def page(self) -> Page:
        """Return the report, before it is a file."""
        from tumble.report import calibration_page

        return calibration_page(self.subject)

    @property
    def subject(self) -> Subject:
        """What the report is made from."""
        from tumble.report import Subject

        made = (self.calibration, self.estimate, self.recording, self.timeline, self.means)
        return Subject(*made, self.protocol, self.matching, self.predicted)

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the calibration, and where its files are."""
        return calibration_html(self.calibration, self.reason, self.files)


def write_run(run: CalibrationRun, folder: Path) -> None:
    """Write both files beside their places, then rename both.

    Earlier calibrations there, of other recordings or such as cannot be read, papers' too, are kept as
    ``calibration-before-IDENTITY.json``.

    Parameters
    ----------
    run, folder : what was made, and where it goes; the run is told its files.

    Raises
    ------
    OutputError
        If the folder cannot be made or written to.
    """
    from tumble.files import check_target, write_texts

    made = {"calibration.json": run.calibration, **run.papers}
    texts = {folder / name: one.to_json() for name, one in made.items()}
    kept = {
        place: copy
        for place in sorted({*texts, *folder.glob("calibration-*.json")})
        if place.is_file() and (copy := _of_other_recordings(place, run.calibration, place in texts))
    }
    for place in kept:
        check_target(place)
    run.files = write_texts(texts | {folder / "report.html": report_of(run)} | dict(kept.values()))
    for place in kept.keys() - texts.keys():
        place.unlink()


def _of_other_recordings(place: Path, made: Calibration, written: bool) -> tuple[Path, bytes] | None:
    """What is to be kept of a file, and where; None if it is of the same recordings, or not tumble's and left there."""
    from tumble.document import read_calibration

    try:
        text = place.read_bytes()
    except OSError as error:
        raise OutputError(
            f"{place} cannot be read, and so not be kept: give another folder with -o."
        ) from error
    try:
        earlier = read_calibration(place)
    except CalibrationFileError:
        identity, other = sha256(text).hexdigest()[:12], written
    else:
        before, now = ({one.sha256 for one in of.recordings} for of in (earlier, made))
        paper = OF_A_PAPER.format(place.stem.removeprefix("calibration-")) in earlier.remarks
        identity, other = earlier.identity, before != now and (written or paper)
    return (place.with_name(f"calibration-before-{identity}.json"), text) if other else None


def report_of(run: CalibrationRun, library: str | None = None) -> str:
    """Return the report of a run as HTML.

    Parameters
    ----------
    run : what was made.
    library : where the plotting library lies, seen from the page; None puts it into the page.
    """
    from tumble.report import render_report

    return render_report(run.subject, library)


class Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
