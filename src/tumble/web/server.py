"""The server of the page: one socket a viewer, the first of whom leads; on this machine unless asked otherwise."""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import json
import secrets
import socket
import threading
import time
from collections.abc import Awaitable, Callable
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
Send = Callable[[dict[str, Any]], Awaitable[None]]


class PageServer:
    """Serves the page of one capture from a thread of its own.

    Parameters
    ----------
    hub : what is shown.
    folder : of the capture, whose report is shown at the end.
    host, port : where to listen; port 0 takes a free one.

    Raises
    ------
    UsageError
        If the extra is not installed, or the port is taken.
    """

    def __init__(self, hub: Hub, folder: Path, host: str = "127.0.0.1", port: int = 0) -> None:
        try:
            import starlette  # noqa: F401  # pyright: ignore[reportUnusedImport]
            import uvicorn
            import websockets  # noqa: F401  # pyright: ignore[reportUnusedImport]
        except ImportError:
            raise UsageError(f"--web needs the extra `web`: {install('web')}.") from None
        self._hub, self._folder = hub, folder
        self._local = _is_local(host)
        self.token = "" if self._local else secrets.token_urlsafe(18)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise UsageError(f"--web {host}:{port} cannot be opened: {error.strerror or error}.") from error
        self.port = int(self._socket.getsockname()[1])
        self._host = host
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
        host = "127.0.0.1" if self._local else _reachable(self._host)
        shown = f"[{host}]" if ":" in host else host
        return f"http://{shown}:{self.port}/" + (f"?token={self.token}" if self.token else "")

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
            host, token = request.headers.get("host", ""), request.query_params.get("token", "")
            name = request.path_params.get("name", "index.html")
            # What the page itself asks for has no token.
            if refusal := self._refusal(host, token, None, open_to_all=name not in ("index.html", "report")):
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
            host, token = viewer.headers.get("host", ""), viewer.query_params.get("token", "")
            refused = self._refusal(host, token, viewer.headers.get("origin", ""))
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

    def _refusal(self, host: str, token: str, origin: str | None, *, open_to_all: bool = False) -> str:
        """Why a request is not served; nothing if it is. `origin` is None for a page, which has none."""
        if not self._host_is_ours(host):
            return "This address is not the page's: open the one that tumble printed."
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return "Another page may not ask."
        if self.token and not open_to_all and not hmac.compare_digest(token.encode(), self.token.encode()):
            return "The address lacks its token: open the one that tumble printed."
        return ""

    def _host_is_ours(self, host: str) -> bool:
        """Whether a request names this machine by number: a name could be anybody's (DNS rebinding)."""
        name = host.rsplit(":", 1)[0].strip("[]") if not host.endswith("]") else host.strip("[]")
        if name == "localhost":
            return True
        try:
            number = ipaddress.ip_address(name)
        except ValueError:
            return False
        return number.is_loopback if self._local else True

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


def _is_local(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _reachable(host: str) -> str:
    """A number of this machine that others can reach, where all of them are listened to."""
    if host not in ("0.0.0.0", "::"):
        return host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def read_web_address(text: str) -> tuple[str, int]:
    """Return host and port of ``--web``: nothing or a port is this machine alone.

    Parameters
    ----------
    text : "", "8080", or "0.0.0.0:8080".

    Raises
    ------
    UsageError
        If it is none.
    """
    host, _, port = text.rpartition(":")
    if not text:
        return "127.0.0.1", 0
    if not port.isdigit() or not 0 <= int(port) < 65536:
        raise UsageError(
            f"--web {text}: give a port, or HOST:PORT with the number of an interface, as 0.0.0.0:8080."
        )
    return host.strip("[]") or "127.0.0.1", int(port)
