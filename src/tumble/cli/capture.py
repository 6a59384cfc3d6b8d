"""`tumble capture`: record a unit while it is in the hand, with a guide.

The live view of a capture in a terminal of 80 columns.
"""

from __future__ import annotations

import signal
import sys
import time
from collections import deque
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import typer
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from tumble.capture import BELLS, Event, groups_of
from tumble.cli.options import NoteOption, PrintOptions, RegistryName, SiteOptions, UnitOptions
from tumble.cli.terminal import plain, results_stand, say, say_aside, say_json_text, say_written, table
from tumble.records import dataclass
from tumble.sample_rates import sample_rate
from tumble.workflows import ADVANCED, FIRST, StreamRequest, UnitRequest, argument, option, shared

if TYPE_CHECKING:
    from tumble.capture import Capture, CaptureOrder, CaptureRun, Listener
    from tumble.web import Hub


# Hz, signs of a bar, and lines of what was said last.
RATE, BAR, LINES = 10.0, 24, 6
_STYLES = {
    "hold_refused": "red",
    "caution": "yellow",
    "silence": "bold red",
    "enough": "bold green",
    "calibrated": "bold green",
}


class LiveView:
    """Redraws some lines as a capture goes on, and rings.

    Parameters
    ----------
    targets : wished-for standard uncertainties, SI, by group.
    """

    def __init__(self, targets: dict[str, float]) -> None:
        self._targets = targets
        self._said: deque[Event] = deque(maxlen=LINES)
        self._next = ""
        self._drawn = 0.0
        self._live = Live(console=Console(), auto_refresh=False, transient=False)

    def __enter__(self) -> LiveView:
        self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.__exit__(kind, error, trace)

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        """Take what happened; a listener of `run_capture`."""
        for event in events:
            if event.kind == "next_pose":
                self._next = event.words
            elif event.kind != "sigma":
                self._said.append(event)
            if event.kind in BELLS:
                sys.stdout.write("\a" * BELLS[event.kind])
        now = time.monotonic()
        if events or now - self._drawn > 1.0 / RATE:
            self._drawn = now
            self._live.update(self.drawn(capture), refresh=True)

    def drawn(self, capture: Capture) -> Group:
        """Return the view of a capture.

        Parameters
        ----------
        capture : that goes on.
        """
        resting, still = capture.search.resting, capture.search.stillness
        parts: list[object] = [
            Text(
                f"{capture.time:7.1f} s   {len(capture.holds)} holds   {capture.channels.rate:.4g} Hz", "bold"
            ),
            _bar(
                "movement",
                min(still, 2.0) / 2.0,
                "still" if still < 1.0 else "moving",
                "green" if still < 1 else "red",
            ),
        ]
        held = 0.0 if resting is None else resting.duration
        words = "turn, then keep still" if resting is None else _held_words(held, capture.hold_seconds)
        parts.append(_bar("this hold", min(held / capture.hold_seconds, 1.0), words, "cyan"))
        parts += [Text(plain(self._next), "bold yellow"), self._table(capture)]
        parts += [Text(f"{e.time:7.1f} s  {plain(e.words)}", _STYLES.get(e.kind, "")) for e in self._said]
        return Group(*parts)  # type: ignore[arg-type]  # rich's own union of what can be drawn

    def _table(self, capture: Capture) -> object:
        """The worst uncertainty of each group of parameters, against its target."""
        rows: list[list[str]] = []
        for one in groups_of(capture.progress.sigmas, self._targets):
            rows.append([one.group, one.sigma, f"{one.target} reached" if one.reached else one.target])
        return table(("parameters", "uncertainty", "target"), rows, right=(1, 2), box=None)


def _bar(name: str, share: float, words: str, style: str) -> Text:
    full = round(BAR * max(min(share, 1.0), 0.0))
    return Text.assemble(f"{name:<10}", ("█" * full + "░" * (BAR - full), style), f"  {words}")


def _held_words(held: float, wanted: float) -> str:
    return f"{held:.1f} of {wanted:g} s" if wanted < float("inf") else f"{held:.0f} s"


@dataclass(frozen=True)
class CaptureOptions:
    """What is captured, and how well.

    Attributes
    ----------
    hold : How long each pose is to be held, seconds.
    target : Standard uncertainty to reach, as accelerometer.bias=2mg or gyro.scale=500ppm; once for each.
    protocol : Go through the steps of a protocol; `rest` is a unit that lies still for its noise.
    resume : Go on with the capture that is in DIR.
    web : Show it in a browser on this machine.
    """

    hold: float = option(ADVANCED, "S", default=3.0, show_default=True)
    target: list[str] | None = option(ADVANCED, "NAME=NUMBER")
    imu: str = shared(UnitRequest, "grade")
    protocol: str | None = option(ADVANCED, "FILE|NAME", complete="protocol")
    resume: bool = option(ADVANCED, "", "--resume", default=False)
    web: bool = option(FIRST, "", "--web", default=False)


def capture_command(
    what: CaptureOptions,
    file: StreamRequest,
    place: SiteOptions,
    unit: UnitOptions,
    printed: PrintOptions,
    source: str | None = argument("[SOURCE]", default=None),
    notes: NoteOption = None,
    registry: RegistryName = None,
    output: Path = option(FIRST, "DIR", "--output", "-o", default=Path("capture")),
) -> None:
    """Record a unit while it is in the hand: which poses count, which is next, how good it is, when to stop.

    Parameters
    ----------
    source : Where samples come from: serial:PORT, tcp:HOST:PORT, udp:PORT, follow:FILE, replay:FILE, - for standard
        input, …; none: say what is connected.
    output : Folder for the recording, the events, calibration.json and report.html.
    """
    if source is None:
        _list_sources()
        return
    from tumble.workflows import notes_of

    order = replace(_order(source, what, file, place, output), unit=unit.imu, notes=notes_of(notes))
    if registry is not None:
        from tumble.workflows import require_registry

        require_registry(registry, unit.imu_serial)
    # A request to end (SIGTERM) ends a capture as Ctrl-C does: with its results.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        status = _run(order, what, printed, registry)
    except KeyboardInterrupt:
        say_aside(f"Stopped; what was recorded is kept in {order.folder}.")
        raise typer.Exit(130) from None
    results_stand()
    raise typer.Exit(status)


def _run(order: CaptureOrder, what: CaptureOptions, printed: PrintOptions, registry: str | None) -> int:
    """Capture, print what came of it, and return the exit status."""
    from tumble.capture import run_capture

    with _page(order, what, quiet=printed.as_json) as hub, _terminal(order, printed) as listener:
        if hub is None:
            run = run_capture(order, [listener])
        else:
            run = run_capture(order, [listener, hub], lambda: hub.stop_wanted, [hub.tap])
        if registry is not None and run.calibration is not None:
            from tumble.workflows import add_calibration

            add_calibration(registry, run.calibration.calibration)
        status = _print_end(run, printed)
        if hub is not None:
            _wait_for_viewers(quiet=printed.as_json)
    return status


@contextmanager
def _page(order: CaptureOrder, what: CaptureOptions, *, quiet: bool) -> Generator[Hub | None, None, None]:
    """Serve the page while a capture goes on, if it was asked for."""
    if not what.web:
        yield None
        return
    from tumble.web import Hub, PageServer

    hub = Hub(order.targets)
    server = PageServer(hub, order.folder)
    server.start()
    if not quiet:
        say(f"Open {server.address}")
        sys.stdout.flush()
    try:
        yield hub
    finally:
        server.stop()


def _wait_for_viewers(*, quiet: bool) -> None:
    """Leave the page open, with its report, until Ctrl-C."""
    if not quiet:
        say("The page stays open: Ctrl-C ends it.")
        sys.stdout.flush()
    with suppress(KeyboardInterrupt):
        while True:
            time.sleep(0.5)


@contextmanager
def _terminal(order: CaptureOrder, printed: PrintOptions) -> Generator[Listener, None, None]:
    """Show what happens: as a live view where somebody looks at a terminal, else as lines."""
    if sys.stdout.isatty() and not (printed.as_json or printed.quiet):
        with LiveView(order.targets) as view:
            yield view
    else:
        yield _Lines(as_json=printed.as_json, quiet=printed.quiet)


def _order(
    source: str, what: CaptureOptions, file: StreamRequest, place: SiteOptions, output: Path
) -> CaptureOrder:
    from tumble.capture import CaptureOrder, SourceOptions, find_source, read_targets, require_hold
    from tumble.protocol import REST
    from tumble.simulation import find_grade
    from tumble.workflows import read_given_protocol

    require_hold(what.hold)
    if what.protocol not in (None, REST):
        read_given_protocol(what.protocol)
    find_grade(what.imu)
    kind, address = find_source(source)
    options = SourceOptions(
        file.columns,
        file.units,
        None if file.rate is None else sample_rate(file.rate),
    )
    return CaptureOrder(
        kind,
        address,
        options,
        output,
        site=place.place,
        hold=what.hold,
        targets=read_targets(what.target or ()),
        imu=what.imu,
        protocol=what.protocol,
        resume=what.resume,
    )


def _list_sources() -> None:
    """Say what is connected, and what a source may be."""
    from tumble.capture import found_ports, known_sources

    there = found_ports()
    say("Connected now:" if there else "No port is connected.")
    say(*(f"  tumble capture {address}   {words}" for address, words in there))
    say("", "Sources:")
    say(*(f"  {one.example:<34} {one.title}" for one in known_sources().values()))


class _Lines:
    """Prints each event as a line, and rings."""

    def __init__(self, *, as_json: bool, quiet: bool) -> None:
        self._as_json, self._quiet = as_json, quiet
        self._bell = sys.stdout.isatty() and not as_json

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        for event in events:
            if self._as_json:
                say_json_text(event.to_json() + "\n")
            elif not self._quiet:
                say(f"{event.time:8.1f} s  {event.words}")
            if self._bell and event.kind in BELLS:
                sys.stdout.write("\a" * BELLS[event.kind])
        if events:
            sys.stdout.flush()


def _print_end(run: CaptureRun, printed: PrintOptions) -> int:
    """Print what came of it, and return the exit status."""
    done = run.calibration
    if run.noise is not None:
        if not printed.as_json:
            say(*run.noise.noise.sentences)
            say_written([*run.noise.files, run.folder / "recording.csv", run.folder / "session.jsonl"])
        return 0
    if done is None:
        if not printed.as_json:
            say(
                f"No calibration yet: {run.refusal}",
                f"The recording is kept: go on with --resume -o {run.folder}.",
            )
        return 1
    fit = done.calibration.verdict.fit
    if not printed.as_json:
        reasons = [] if printed.quiet else [f"- {words}" for words in done.calibration.verdict.reasons]
        say("Fit for use." if fit else "Not fit for use.", *reasons)
        say_written([*done.files, run.folder / "recording.csv", run.folder / "session.jsonl"])
    return 0 if fit else 1
