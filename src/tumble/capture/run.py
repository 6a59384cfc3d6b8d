"""A capture from its source to its results: what comes in goes to the disk first, then to the state machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tumble.capture.coach import Coach, Event
from tumble.capture.machine import Capture
from tumble.capture.source import Channels, Notice, Piece, Source, SourceOptions
from tumble.capture.sources.replay import replay, split_speed
from tumble.capture.stamps import ENOUGH, ForwardClock, kept_beside
from tumble.earth import Site
from tumble.errors import (
    ConvergenceError,
    ObservabilityError,
    OutputError,
    RecordingError,
    SegmentationError,
    UsageError,
)
from tumble.files import GrowingFile, make_folder, write_text
from tumble.parameters import plain_unit
from tumble.protocol import REST
from tumble.recording import NOMINAL, Recording, Samples, column_names, joined
from tumble.records import dataclass
from tumble.sample_rates import SampleRate
from tumble.units import COUNTS

if TYPE_CHECKING:
    from tumble.workflows import CalibrationRun, NoiseAnalysis


RECORDING, JOURNAL = "recording.csv", "session.jsonl"
# Holds that count, as `tumble calibrate --intervals` takes them, where a person dropped some.
HOLDS = "holds.csv"
RESULTS = ("calibration.json", "report.html", "noise.json", "noise.html")


class CaptureFolder:
    """Where a capture is written.

    Parameters
    ----------
    folder : made if it is not there.
    channels : what the columns of ``recording.csv`` are.
    resume : go on with what is there.

    Raises
    ------
    UsageError
        If a capture or its results are there already, and `resume` was not asked for, or the columns differ.
    OutputError
        If it cannot be written to.
    """

    def __init__(self, folder: Path, channels: Channels, *, resume: bool = False) -> None:
        check_folder(folder, resume=resume)
        make_folder(folder)
        self.folder = folder
        header = header_of(channels)
        self._recording = GrowingFile(folder / RECORDING, resume=resume)
        if self._recording.size == 0:
            self._recording.append(header)
        else:
            _check_header(folder / RECORDING, header)
        self._journal = GrowingFile(folder / JOURNAL, resume=resume)
        self.flush()

    @property
    def recording(self) -> Path:
        """The file of raw samples."""
        return self.folder / RECORDING

    def add(self, samples: Samples) -> None:
        """Keep samples for the next `flush`.

        Parameters
        ----------
        samples : of the channels.
        """
        self._recording.append(lines_of(samples))

    def say(self, events: Sequence[Event]) -> None:
        """Keep events for the next `flush`.

        Parameters
        ----------
        events : in order.
        """
        for event in events:
            self._journal.append(event.to_json().encode() + b"\n")

    def flush(self) -> None:
        """Hand everything to the system, samples first.

        Raises
        ------
        OutputError
            If it cannot be written; whole lines before are kept.
        """
        self._recording.flush()
        self._journal.flush()

    def close_recording(self) -> None:
        """Write the last samples down to the disk.

        Raises
        ------
        OutputError
            If they cannot be written.
        """
        self._recording.close()

    def close(self) -> None:
        """Write the last events down to the disk.

        Raises
        ------
        OutputError
            If they cannot be written.
        """
        self._journal.close()


def _digits(value: float) -> str:
    """All digits of a number; nothing for what is no number, as of a temperature that was not sent."""
    return "" if value != value else repr(value)


def check_folder(folder: Path, *, resume: bool) -> None:
    """Refuse a folder in which something would be lost.

    Parameters
    ----------
    folder : for a capture.
    resume : whether it is to go on with what is there.

    Raises
    ------
    UsageError
        If a capture or results are there and `resume` is false, or the folder is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-o {folder} is a file: give a folder.")
    there = [name for name in (RECORDING, JOURNAL, *RESULTS) if (folder / name).exists()]
    if there and not resume:
        raise UsageError(
            f"{folder} holds {', '.join(there)} already, and nothing is written over: go on with it (--resume), or "
            "give another folder with -o."
        )


def lines_of(samples: Samples) -> bytes:
    """Return samples as lines of ``recording.csv``.

    Parameters
    ----------
    samples : of the channels of its header.
    """
    parts = [samples.time[:, None], samples.specific_force, samples.angular_rate]
    if samples.temperature is not None:
        parts.append(samples.temperature[:, None])
    parts.append(samples.magnetic_field)
    rows = np.hstack([part for part in parts if part is not None]).tolist()
    return "".join([",".join(map(_digits, row)) + "\n" for row in rows]).encode()


def header_of(channels: Channels) -> bytes:
    """Return the first line of ``recording.csv``.

    Parameters
    ----------
    channels : which triads there are, and in which units.
    """
    nothing, empty = np.zeros(0), np.zeros((0, 3))
    shape = Recording(
        nothing,
        None if channels.specific_force_unit is None else empty,
        None if channels.angular_rate_unit is None else empty,
        channels.specific_force_unit or COUNTS,
        channels.angular_rate_unit or COUNTS,
        channels.rate,
        nothing if channels.temperature else None,
    )
    names = column_names(shape, all_units=True)
    if (unit := channels.magnetic_field_unit) is not None:
        names += [f"m{axis} [{unit}]" if unit else f"m{axis}" for axis in "xyz"]
    return (",".join(names) + "\n").encode()


def _check_header(path: Path, header: bytes) -> None:
    with path.open("rb") as file:
        found = file.readline()
    if found != header:
        raise UsageError(
            f"{path} has the columns {found.decode(errors='replace').strip()}, and now come "
            f"{header.decode().strip()}: give another folder with -o."
        )


# s between flushes, and s without samples after which it is said.
FLUSH, SILENT = 1.0, 1.5
# s of samples that are looked at together, and how many looks there are at what comes at once.
LOOK, LOOKS = 0.25, 8
# s of what was recorded before that are looked at together: nobody waits for what is said of them.
AT_ONCE = 60.0

Listener = Callable[[Sequence[Event], Capture], None]


@dataclass(frozen=True)
class CaptureOrder:
    """What is to be captured.

    Attributes
    ----------
    source, address, options : where samples come from.
    folder : for the recording, the events and the results.
    site : gravity and latitude; None if nobody said.
    hold : s that each pose is to be held.
    targets : wished-for standard uncertainties, SI, by group.
    imu : grade of the unit; None for holds alone, without what they are worth.
    protocol : a protocol's file or name, whose steps are gone through in order; "rest" is a unit that lies still, for
        its noise.
    resume : go on with what the folder holds.
    unit : (model, serial number) to note in the calibration.
    notes : what else to note in it, by name.
    """

    source: Source
    address: str
    options: SourceOptions
    folder: Path
    site: Site | None = None
    hold: float = 3.0
    targets: dict[str, float] = field(default_factory=dict[str, float])
    imu: str | None = "consumer-mems"
    protocol: str | None = None
    resume: bool = False
    unit: tuple[str | None, str | None] = (None, None)
    notes: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass
class CaptureRun:
    """What came of a capture.

    Attributes
    ----------
    folder : where everything is.
    capture : the state machine as it ended; None if no sample came.
    calibration : of the whole recording; None if it does not determine one.
    noise : of a unit that was at rest for it.
    refusal : why there is none, as a sentence.
    """

    folder: Path
    capture: Capture | None
    calibration: CalibrationRun | None = None
    noise: NoiseAnalysis | None = None
    refusal: str = ""


class _Stop(Exception):
    """It is enough."""


def run_capture(
    order: CaptureOrder,
    listeners: Sequence[Listener] = (),
    stopped: Callable[[], bool] = lambda: False,
    taps: Sequence[Callable[[Samples], None]] = (),
) -> CaptureRun:
    """Capture until the source ends, it is enough, or somebody stops it; then calibrate what was recorded.

    Ctrl-C ends a capture as its own end does: the results are made of what is there.

    Parameters
    ----------
    order : what, from where, to where.
    listeners : are told of each batch of samples' events, which may be none.
    stopped : asked often whether to end.
    taps : are given the samples as they were recorded.

    Raises
    ------
    UsageError
        If the folder holds something already, or the source cannot be opened.
    RecordingError
        If no samples come that can be a recording.
    OutputError
        If the disk is full: what was written before is kept, and is no less a recording.
    """
    check_folder(order.folder, resume=order.resume)
    file = split_speed(order.address)[0]
    if not order.source.live and Path(file).resolve() == (order.folder / RECORDING).resolve():
        raise UsageError(f"{file} is what is written to: give another folder with -o.")
    guide = _guide_of(order)
    before = _catch_up(order, guide) if order.resume else None
    source = order.source.open(order.address, order.options)
    if callable(source):
        # A simulated person hears what is said.
        listeners = [*listeners, source]
    under_way = _UnderWay(order, listeners, taps, guide, before)
    with closing(piece for piece in source) as pieces:
        try:
            for piece in pieces:
                under_way.take(piece)
                if stopped():
                    break
        except (_Stop, KeyboardInterrupt):
            pass
        except BaseException:
            under_way.let_go()
            raise
    return under_way.end()


def _catch_up(order: CaptureOrder, guide: Coach | None) -> Capture | None:
    """Feed what was recorded before to the state machine; None where that is too little for a recording.

    It takes its time, in which a port that is open loses samples: so it comes before the source is opened.
    """
    path = order.folder / RECORDING
    if not path.is_file():
        return None
    # Cuts off half a last line.
    GrowingFile(path, resume=True).close()
    capture: Capture | None = None
    waiting: list[Samples] = []
    try:
        for piece in replay(f"{path}@0", SourceOptions()):
            if isinstance(piece, Channels):
                capture = Capture(piece, guide, order.hold)
            elif isinstance(piece, Samples) and len(piece):
                waiting.append(piece.finite())
                if capture is not None and piece.time[-1] - waiting[0].time[0] > AT_ONCE:
                    capture.feed(joined(waiting))
                    waiting = []
    except RecordingError:
        # What comes goes behind it all the same.
        return None
    if capture is not None and waiting:
        capture.feed(joined(waiting))
    return capture


class _UnderWay:
    """A capture between its first piece and its last."""

    def __init__(
        self,
        order: CaptureOrder,
        listeners: Sequence[Listener],
        taps: Sequence[Callable[[Samples], None]],
        guide: Coach | None,
        before: Capture | None,
    ) -> None:
        self._order, self._listeners, self._taps = order, listeners, taps
        self._files: CaptureFolder | None = None
        self._guide = guide
        self._capture = before
        self._clock = ForwardClock(leaps=order.source.live)
        self._from: float | None = None
        self._beside: list[tuple[float, float]] = []
        self._flushed = self._heard = time.monotonic()
        self._silent = False

    def take(self, piece: Piece) -> None:
        """Take what the source yields."""
        now = time.monotonic()
        if isinstance(piece, Channels):
            self._begin(piece)
        elif isinstance(piece, Notice):
            self._say([self._event(piece.kind, piece.words)])
        elif isinstance(piece, Samples) and len(piece):
            self._samples(piece, now)
        elif self._order.source.live and self._files is not None:
            self._quiet(now)
        self._flush(now)

    def _flush(self, now: float) -> None:
        if self._files is not None and now - self._flushed > FLUSH:
            self._flushed = now
            self._files.flush()

    def _begin(self, channels: Channels) -> None:
        if self._files is not None:
            return
        order = self._order
        self._files = CaptureFolder(order.folder, channels, resume=order.resume)
        first = [Event("started", 0.0, _channel_words(channels), _channel_facts(channels, order))]
        first += [Event("remark", 0.0, words) for words in channels.remarks]
        if self._capture is None:
            self._capture = Capture(channels, self._guide, order.hold)
        else:
            first.append(self._resumed(self._capture))
        self._say(first)

    def _resumed(self, capture: Capture) -> Event:
        """Go on behind what was recorded before, and say so."""
        last = capture.time
        if self._order.source.live:
            self._clock = ForwardClock(last)
        else:
            self._from = last
        holds = len(capture.search.holds)
        return Event("resumed", last, f"Resumed after {last:.1f} s with {holds} holds.", {"holds": holds})

    def _samples(self, samples: Samples, now: float) -> None:
        if self._capture is None or self._files is None:
            return
        waited, self._heard = now - self._heard, now
        events: list[Event] = []
        if self._silent:
            self._silent = False
            events.append(self._event("back", f"Samples come again, after {waited:.1f} s."))
        samples = samples.finite()
        if self._from is not None:
            samples = samples.cut(samples.time > self._from)
        samples, jumps = self._clock.carry_on(samples, waited)
        for before, after in jumps:
            self._beside.clear()
            words = (
                f"The unit's clock jumped from {before:.3f} to {after:.3f} s: a turn across that is not used."
            )
            events.append(self._event("clock_jumped", words, before=before, after=after))
        if len(samples):
            self._files.add(samples)
            self._beside.append((now, float(samples.time[-1])))
            # Before anything is computed of them, which may take a moment.
            self._flush(now)
            for tap in self._taps:
                tap(samples)
            # Of what had to wait, some looks must do: else the next samples wait as long.
            for part in samples.parts(max(LOOK, float(samples.time[-1] - samples.time[0]) / LOOKS)):
                events += self._capture.feed(part)
        self._say(events)
        if any(e.kind == "enough" for e in events) and self._order.source.live:
            raise _Stop

    def _quiet(self, now: float) -> None:
        if now - self._heard > SILENT and not self._silent:
            self._silent = True
            words = (
                "No samples come any more: see to the cable and the unit. It goes on when they come again."
            )
            self._say([self._event("silence", words)])
        else:
            self._tell([])

    def _say(self, events: list[Event]) -> None:
        if self._files is not None:
            self._files.say(events)
            if events:
                self._files.flush()
        self._tell(events)

    def _tell(self, events: list[Event]) -> None:
        if self._capture is not None:
            for listener in self._listeners:
                listener(events, self._capture)

    def _event(self, kind: str, words: str, /, **facts: object) -> Event:
        return Event(kind, 0.0 if self._capture is None else self._capture.time, words, facts)

    def let_go(self) -> None:
        """Close the files after a fault, with everything that can still be written."""
        if self._files is not None:
            with suppress(OutputError):
                self._files.close_recording()
            with suppress(OutputError):
                self._files.close()

    def end(self) -> CaptureRun:
        """Calibrate what was recorded, and say what came of it."""
        if self._capture is None or self._files is None or self._capture.blocks.samples == 0:
            self.let_go()
            raise RecordingError("No samples came: see to the cable and the unit's output.")
        capture, files = self._capture, self._files
        self._say(capture.finish())
        ended = f"{capture.blocks.samples} samples are in {files.recording}. {capture.outlook()}"
        self._say([self._event("ended", ended.strip())])
        files.close_recording()
        run = CaptureRun(self._order.folder, capture)
        try:
            if self._order.protocol == REST:
                run.noise = _noise(self._order, files.recording)
                self._say([self._event("characterised", " ".join(run.noise.noise.sentences))])
            else:
                run.calibration = _calibrate(self._order, files.recording, capture, self._rate())
                self._say([_outcome(run.calibration, capture)])
        except (ObservabilityError, SegmentationError, ConvergenceError, RecordingError) as error:
            run.refusal = str(error)
            self._say([self._event("not_calibrated", run.refusal)])
        finally:
            files.close()
        return run

    def _rate(self) -> float | str | None:
        """What is known of the rate: as stated with its uncertainty, or as the unit's clock runs beside this one."""
        stated = self._order.options.rate
        # How sure a stated rate is belongs to the calibration; the rate itself is in the stamps by now.
        if isinstance(stated, SampleRate) and stated.uncertainty is not None:
            return stated
        told = self._order.source.live and len(self._beside) >= ENOUGH
        share = kept_beside(self._beside) if told else NOMINAL
        if share >= NOMINAL:
            return None
        rate = f"±{1e6 * share:.0f}ppm"
        words = f"The stamps keep to this computer's clock: to calibrate them again say --rate {rate}."
        self._say([self._event("remark", words)])
        return rate


def _noise(order: CaptureOrder, recording: Path) -> NoiseAnalysis:
    from tumble.workflows import analyse_noise

    return analyse_noise(recording, output=order.folder)


def _calibrate(order: CaptureOrder, path: Path, capture: Capture, rate: float | str | None) -> CalibrationRun:
    """Calibrate the file; where a person dropped holds, with the list of those that count."""
    from tumble.workflows import calibrate

    intervals: Path | None = None
    if capture.dropped:
        intervals = order.folder / HOLDS
        lines = [f"{told.hold.start!r},{told.hold.stop!r}\n" for told in capture.holds]
        write_text(intervals, "".join(lines))
    return calibrate(
        path,
        output=order.folder,
        site=order.site,
        intervals=intervals,
        protocol=order.protocol,
        rate=rate,
        imu=order.unit,
        notes=order.notes,
    )


def _guide_of(order: CaptureOrder) -> Coach | None:
    if order.protocol == REST:
        from tumble.capture.coach import RestCoach

        return RestCoach(patient=not order.source.live)
    if order.protocol is not None:
        from tumble.capture.coach import StepsCoach
        from tumble.workflows import read_given_protocol

        return StepsCoach(read_given_protocol(order.protocol).protocol)
    if order.imu is None:
        return None
    from tumble.capture.guide import Guide
    from tumble.simulation import find_grade

    site = order.site or Site.unknown()
    stated, patient = order.options.rate, not order.source.live
    return Guide(find_grade(order.imu), site, order.hold, order.targets, rate=stated, patient=patient)


def _channel_words(channels: Channels) -> str:
    force, rate = (
        f"no {name}" if unit is None else f"{name} in {plain_unit(unit)}"
        for name, unit in (
            ("accelerometer", channels.specific_force_unit),
            ("gyro", channels.angular_rate_unit),
        )
    )
    return f"Samples come at {channels.rate:.4g} Hz: {force}, {rate}. Put the unit down for a moment."


def _channel_facts(channels: Channels, order: CaptureOrder) -> dict[str, object]:
    return {
        "source": order.source.name,
        "rate": channels.rate,
        "specific_force_unit": channels.specific_force_unit,
        "angular_rate_unit": channels.angular_rate_unit,
        "hold_seconds": order.hold,
        "targets": order.targets,
    }


def _outcome(run: CalibrationRun, capture: Capture) -> Event:
    """What calibrate made of the file, beside what was said while it grew, in the units that people say."""
    from tumble.report import achieved_beside, parameter_rows

    verdict, quality = run.calibration.verdict, run.calibration.quality
    foreseen = {name: sigma for name, sigma in capture.progress.sigmas.items() if sigma is not None}
    beside = achieved_beside(run.calibration, foreseen)
    stated = {row.name: row.said for row in parameter_rows(run.calibration)}
    stated |= {row.name: one for row, _, one in beside}
    words = f"{'Fit' if verdict.fit else 'Not fit'} for use: {quality.holds} holds."
    facts = {
        "fit": verdict.fit,
        "procedure": run.calibration.procedure,
        "holds": quality.holds,
        "holds_live": len(capture.search.holds),
        "predicted": {row.name: predicted.sigma for row, predicted, _ in beside},
        "stated": {name: one.sigma for name, one in stated.items()},
        "units": {name: one.unit for name, one in stated.items()},
    }
    return Event("calibrated", capture.time, words, facts)


def require_hold(seconds: float) -> None:
    """Refuse a time to hold a pose that is none.

    Parameters
    ----------
    seconds : as the user wrote it.

    Raises
    ------
    UsageError
        If it is shorter than what is a hold at all, or longer than anybody holds.
    """
    if not 1.0 <= seconds <= 600.0:
        raise UsageError(f"--hold {seconds:g}: give from 1 to 600 seconds.")
