"""The server of the page: one socket a viewer, the first of whom leads; on this machine alone."""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
import threading
import time
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

from tumble.errors import UsageError, install
from tumble.web.hub import Hub

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
