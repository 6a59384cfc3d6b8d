"""The page of a capture: what it has to show, and a server of one socket a viewer, the first of whom leads."""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

import numpy as np

from tumble.capture import Capture, Event, groups_of
from tumble.errors import UsageError, install
from tumble.recording import Samples

# What a capture ends with: of a calibration, or of noise.
REPORTS = ("report.html", "noise.html")
# Hz at which a viewer's news are looked for, twice for each column of the traces; each so many times the state is sent,
# too; most viewers; bytes of a message from one.
RATE, STATE_BEAT, MOST_VIEWERS, LONGEST = 60.0, 6, 64, 1024
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# The report is one file with everything in it, and asks nobody for anything.
_REPORT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; "
    "font-src data:; worker-src blob:; frame-ancestors 'none'"
)
HOST = "127.0.0.1"


class PageServer:
    """Serves the page of one capture from a thread of its own.

    Parameters
    ----------
    hub : what is shown.
    folder : of the capture, whose report is shown at the end.

    Raises
    ------
    UsageError
        If the extra is not installed, or nothing can be served.
    """

    def __init__(self, hub: Hub, folder: Path) -> None:
        try:
            import starlette  # noqa: F401  # pyright: ignore[reportUnusedImport]
            import uvicorn
            import websockets  # noqa: F401  # pyright: ignore[reportUnusedImport]
        except ImportError:
            raise UsageError(f"--web needs the extra `web`: {install('web')}.") from None
        self._hub, self._folder = hub, folder
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._socket.bind((HOST, 0))
        except OSError as error:
            self._socket.close()
            raise UsageError(f"--web cannot serve at {HOST}: {error.strerror or error}.") from error
        self.port = int(self._socket.getsockname()[1])
        self._viewers: list[object] = []
        config = uvicorn.Config(
            self._application(), log_level="critical", lifespan="off", ws="websockets-sansio", ws_max_size=LONGEST,
            access_log=False,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self.port}/"

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()
        end = time.monotonic() + 5.0
        while not self._server.started and time.monotonic() < end:
            time.sleep(0.01)

    def stop(self) -> None:
        """End."""
        self._server.should_exit = True
        self._thread.join(5.0)
        self._socket.close()

    def _run(self) -> None:
        # The capture's own thread hears Ctrl-C.
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def _application(self) -> Any:
        from starlette.applications import Starlette
        from starlette.requests import Request
        from starlette.responses import PlainTextResponse, Response
        from starlette.routing import Route, WebSocketRoute
        from starlette.websockets import WebSocket

        async def page(request: Request) -> Response:
            name = request.path_params.get("name", "index.html")
            if refusal := _refusal(request.headers.get("host", ""), None):
                return PlainTextResponse(refusal, 403)
            if name == "favicon.ico":
                return Response(status_code=204)
            policy, content = _POLICY, _page_files().get(name)
            if name == "report":
                places = [self._folder / one for one in REPORTS]
                file = next((place for place in places if place.is_file()), None)
                policy, content = _REPORT_POLICY, file and await asyncio.to_thread(file.read_bytes)
            if content is None:
                return PlainTextResponse(
                    f"There is no {'report yet' if name == 'report' else 'such page'}.", 404
                )
            kind = _TYPES[Path(name).suffix or ".html"]
            return Response(content, media_type=kind, headers=_headers(policy))

        async def watch(viewer: WebSocket) -> None:
            refused = _refusal(viewer.headers.get("host", ""), viewer.headers.get("origin", ""))
            if refused or len(self._viewers) >= MOST_VIEWERS:
                await viewer.close(1008)
                return
            await self._serve(viewer)

        return Starlette(
            routes=[
                Route("/", page),
                WebSocketRoute("/watch", watch),
                Route("/{name}", page),
            ]
        )

    async def _serve(self, viewer: Any) -> None:
        await viewer.accept()
        me = object()
        self._viewers.append(me)
        # Whichever ends first, because the viewer has gone, ends the other.
        tasks = [asyncio.create_task(self._listen(viewer, me)), asyncio.create_task(self._show(viewer, me))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._viewers.remove(me)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _show(self, viewer: Any, me: object) -> None:
        columns = events = beat = 0
        state, leads = "", None
        due = time.monotonic()
        while True:
            columns, frame = self._hub.columns_since(columns)
            if frame:
                await viewer.send_bytes(frame)
            events, lines = self._hub.events_since(events)
            for line in lines:
                await viewer.send_text(f'{{"event":{line}}}')
            beat += 1
            now = self._hub.state if beat % STATE_BEAT == 0 else state
            if now != state:
                state = now
                await viewer.send_text(f'{{"state":{state}}}')
            if leads != (self._viewers[0] is me):
                leads = self._viewers[0] is me
                await viewer.send_text(json.dumps({"leads": leads}))
            # By the clock: what it took to send is not added to each frame.
            due = max(due + 1.0 / RATE, time.monotonic())
            await asyncio.sleep(due - time.monotonic())

    async def _listen(self, viewer: Any, me: object) -> None:
        from starlette.websockets import WebSocketDisconnect

        try:
            while True:
                text = await viewer.receive_text()
                try:
                    wish = json.loads(text)
                except (ValueError, RecursionError):
                    continue
                if isinstance(wish, dict) and self._viewers[0] is me:
                    self._hub.wish(cast("dict[str, Any]", wish))
        except (WebSocketDisconnect, RuntimeError, KeyError):
            return


def _headers(policy: str) -> dict[str, str]:
    return {
        "Content-Security-Policy": policy,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
        "Cross-Origin-Resource-Policy": "same-origin",
    }


def _page_files() -> dict[str, bytes]:
    """The page's files by name: there are these and no others."""
    room = files("tumble.web") / "page"
    return {file.name: file.read_bytes() for file in room.iterdir() if Path(file.name).suffix in _TYPES}


def _refusal(host: str, origin: str | None) -> str:
    """Why a request is not served; nothing if it is. `origin` is None for a page, which has none."""
    if not _is_here(host):
        return "This address is not the page's: open the one that tumble printed."
    if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
        return "Another page may not ask."
    return ""


def _is_here(host: str) -> bool:
    """Whether a request names this machine by number: a name could be anybody's (DNS rebinding)."""
    name = host.rsplit(":", 1)[0].strip("[]") if not host.endswith("]") else host.strip("[]")
    try:
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


# s of samples in one column of the traces; columns and events that are kept for who comes late.
COLUMN, KEPT, MOST_EVENTS = 1.0 / 30.0, 600, 2000
# A column on the wire: its time, then least and greatest of three forces and three rates.
_FRAME = struct.Struct("<d12f")


class Hub:
    """A capture's state for viewers.

    Parameters
    ----------
    targets : wished-for standard uncertainties, SI, by group.
    """

    def __init__(self, targets: dict[str, float]) -> None:
        self._lock = threading.Lock()
        self._targets = targets
        self._columns: deque[bytes] = deque(maxlen=KEPT)
        self._column_count = 0
        self._events: list[str] = []
        self._first_event = 0
        self._state = ""
        self._wishes: list[dict[str, Any]] = []
        self._open: tuple[int, np.ndarray, np.ndarray] | None = None
        self.stop_wanted = False

    def tap(self, samples: Samples) -> None:
        """Take samples for the traces.

        Parameters
        ----------
        samples : as they were recorded.
        """
        nothing = np.full((len(samples), 3), np.nan)
        force = nothing if samples.specific_force is None else samples.specific_force
        rate = nothing if samples.angular_rate is None else samples.angular_rate
        values = np.hstack([force, rate])
        numbers = np.floor(samples.time / COLUMN).astype(np.int64)
        for number in np.unique(numbers).tolist():
            part = values[numbers == number]
            self._put(int(number), part.min(axis=0), part.max(axis=0))

    def _put(self, number: int, low: np.ndarray, high: np.ndarray) -> None:
        if self._open is not None and self._open[0] == number:
            self._open = number, np.minimum(low, self._open[1]), np.maximum(high, self._open[2])
            return
        if self._open is not None:
            at, least, greatest = self._open
            frame = _FRAME.pack(at * COLUMN, *np.column_stack([least, greatest]).ravel().tolist())
            with self._lock:
                self._columns.append(frame)
                self._column_count += 1
        self._open = number, low, high

    def __call__(self, events: Sequence[Event], capture: Capture) -> None:
        """Take what happened; a listener of `run_capture`."""
        for wish in self._taken():
            if wish.get("do") == "drop" and isinstance(wish.get("hold"), int):
                capture.drop(wish["hold"])
        state = json.dumps(_state_of(capture, self._targets), allow_nan=False)
        lines = [event.to_json() for event in events]
        with self._lock:
            self._state = state
            self._events += lines
            if len(self._events) > MOST_EVENTS:
                self._first_event += len(self._events) - MOST_EVENTS
                del self._events[:-MOST_EVENTS]

    def _taken(self) -> list[dict[str, Any]]:
        with self._lock:
            wishes, self._wishes = self._wishes, []
        return wishes

    def wish(self, wish: dict[str, Any]) -> None:
        """Take what the leading viewer asks: to drop a hold, or to stop.

        Parameters
        ----------
        wish : ``{"do": "drop", "hold": 3}`` or ``{"do": "stop"}``; anything else is passed over.
        """
        if wish.get("do") == "stop":
            self.stop_wanted = True
        elif wish.get("do") == "drop":
            with self._lock:
                self._wishes = [*self._wishes[-50:], wish]

    def columns_since(self, number: int) -> tuple[int, bytes]:
        """Return the columns that came after a number of them, and the number now.

        Parameters
        ----------
        number : of columns that a viewer has.
        """
        with self._lock:
            new = min(self._column_count - number, len(self._columns))
            content = b"".join(list(self._columns)[len(self._columns) - new :]) if new > 0 else b""
            return self._column_count, content

    def events_since(self, number: int) -> tuple[int, list[str]]:
        """Return the events, as JSON, that came after a number of them, and the number now.

        Parameters
        ----------
        number : of events that a viewer has.
        """
        with self._lock:
            total = self._first_event + len(self._events)
            return total, self._events[max(number - self._first_event, 0) :]

    @property
    def state(self) -> str:
        """The present state as JSON; nothing before the first samples."""
        with self._lock:
            return self._state


def _state_of(capture: Capture, targets: dict[str, float]) -> dict[str, Any]:
    resting = capture.search.resting
    up_b = capture.direction
    stillness = capture.search.stillness
    return {
        "time": round(capture.time, 2),
        "rate": capture.channels.rate,
        "units": [capture.channels.specific_force_unit, capture.channels.angular_rate_unit],
        "stillness": round(min(stillness, 99.0), 3) if np.isfinite(stillness) else None,
        "up": None if up_b is None else [round(float(v), 4) for v in up_b],
        "resting": None
        if resting is None
        else {"hold": resting.number, "seconds": round(resting.duration, 2)},
        # A unit at rest for its noise has no hold that is long enough.
        "hold_seconds": capture.hold_seconds if np.isfinite(capture.hold_seconds) else None,
        "holds": [
            {
                "hold": told.hold.number,
                "seconds": round(told.hold.duration, 1),
                "pose": told.pose,
                "note": told.note,
                "up": None if told.up_b is None else [round(float(v), 4) for v in told.up_b],
            }
            for told in capture.holds
        ],
        "groups": [asdict(row) for row in groups_of(capture.progress.sigmas, targets)],
    }
