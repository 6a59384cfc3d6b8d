"""The page of a guided capture in a real browser: a session from the first rest to the report, looked at and timed.

    pip install playwright
    python benchmarks/capture_page.py FOLDER [/usr/bin/chromium]
    python benchmarks/capture_page.py frames [/usr/bin/chromium]

``frames`` is the page alone: samples at 200 Hz and 2 kHz as they come, with 1 and with 20 viewers, how many frames a
second it draws, and what a frame costs the browser in processor time.
A simulated person follows the guide, lets the unit creep at times, and pulls the cable once. The page is watched as
on a desktop, on a phone and in the dark, and by 17 viewers more. FOLDER has the pictures.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tumble.capture.folder import header_of, lines_of
from tumble.capture.samples import Channels
from tumble.capture.serve import GuideFolder
from tumble.capture.simulated_person import Flaws, SimulatedPerson
from tumble.recording.samples import Samples
from tumble.simulation.grades import find_grade
from tumble.web.hub import Hub
from tumble.web.server import PageServer

RUN = "import sys; from tumble.cli import program; program()"
TARGETS = ("accelerometer.bias=3mg", "gyro.bias=30deg/h", "gyro.scale=8000ppm")
# s of the unit's clock after which the cable is pulled, and for how long; how much faster than life it goes.
PULLED, AWAY, SPEED = 30.0, 4.0, 1.0
VIEWERS = 17


def device(server: socket.socket, folder: Path) -> None:
    """Be a unit that sends lines, and lose the line once."""
    person = SimulatedPerson(find_grade("consumer-mems"), 11, flaws=Flaws(creeping=0.25), speed=SPEED)
    guide, pulled = GuideFolder(folder), False
    line, _ = server.accept()
    head = b""
    for piece in person:
        if isinstance(piece, Channels):
            head = header_of(piece)
            line.sendall(head)
        elif isinstance(piece, Samples):
            if not pulled and piece.time[-1] > PULLED:
                pulled = True
                line.close()
                time.sleep(AWAY)
                line, _ = server.accept()
                line.sendall(head)
            try:
                # As a unit does: some samples at a time, and not those of a tenth of a second at once.
                for part in piece.parts(0.02):
                    line.sendall(lines_of(part))
                    time.sleep(0.018)
            except OSError:
                return
        person.hear(guide.events())


def said(page: Any) -> list[str]:
    """The kinds of events that the page shows, the oldest first."""
    return list(reversed(page.eval_on_selector_all("#said li", "lines => lines.map(one => one.className)")))


def wait_for(page: Any, kind: str, count: int = 1, seconds: float = 240.0) -> None:
    """Wait until the page has shown so many events of a kind."""
    end = time.monotonic() + seconds
    while said(page).count(kind) < count:
        if time.monotonic() > end:
            raise SystemExit(f"{kind} was not shown in {seconds:.0f} s; the page shows {said(page)}")
        page.wait_for_timeout(200)


def journey(browser: Any, address: str, folder: Path) -> None:
    """Go through a session, with pictures."""
    desk = browser.new_page(viewport={"width": 1280, "height": 900})
    errors: list[str] = []
    desk.on("pageerror", lambda error: errors.append(str(error)))
    desk.on("console", lambda one: errors.append(one.text) if one.type == "error" else None)
    desk.goto(address)
    wait_for(desk, "hold_accepted")
    alone = frames(desk)
    phone = browser.new_page(viewport={"width": 390, "height": 844}, device_scale_factor=2, is_mobile=True)
    dark = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme="dark")
    phone.goto(address)
    dark.goto(address)
    wait_for(desk, "hold_accepted", 3)
    for name, page in (("desktop", desk), ("phone", phone), ("dark", dark)):
        page.screenshot(path=folder / f"{name}.png", full_page=name == "phone")
    assert "you lead" in desk.inner_text("#link")
    assert "another viewer leads" in phone.inner_text("#link")
    ended = threading.Event()
    for _ in range(VIEWERS):
        threading.Thread(target=watch, args=(address, ended), daemon=True).start()
    desk.wait_for_timeout(3000)
    print(
        f"{alone:.0f} frames a second alone, {frames(desk):.0f} with 2 other pages and {VIEWERS} other viewers"
    )
    ended.set()
    wait_for(desk, "silence")
    desk.screenshot(path=folder / "pulled.png")
    wait_for(desk, "back")
    wait_for(desk, "hold_refused")
    desk.screenshot(path=folder / "refused.png")
    wait_for(desk, "enough")
    wait_for(desk, "calibrated")
    desk.wait_for_timeout(500)
    desk.screenshot(path=folder / "end.png")
    desk.click("#next a")
    desk.wait_for_load_state()
    assert "tumble" in desk.title().lower() or desk.inner_text("h1")
    desk.screenshot(path=folder / "report.png")
    print(f"{len(errors)} errors in the console", *errors[:5], sep="\n")


def watch(address: str, ended: threading.Event) -> None:
    """Be a viewer without a page."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    with (
        suppress(ConnectionClosed),
        connect(address.replace("http", "ws") + "watch", origin=address.rstrip("/")) as own,
    ):  # type: ignore[arg-type]  # an origin is a string there
        while not ended.is_set():
            own.recv(timeout=10.0)


def frames(page: Any, seconds: float = 2.5) -> float:
    """How many times a second the page has drawn, by its own count."""
    page.wait_for_timeout(1e3 * seconds)
    found = re.search(r"[0-9]+", page.inner_text("#frames"))
    return float(found[0]) if found else 0.0


def stream(hub: Hub, rate: float, ended: threading.Event) -> None:
    """Be a unit that sends, in real time."""
    begun, sent, chance = time.monotonic(), 0, np.random.default_rng(1)
    while not ended.wait(0.004):
        stamps = np.arange(sent, int((time.monotonic() - begun) * rate)) / rate
        if len(stamps):
            swing = np.column_stack([np.sin(stamps), np.cos(stamps), 0.0 * stamps])
            noise = chance.standard_normal((2, len(stamps), 3))
            hub.tap(Samples(stamps, 9.8 * swing + 0.05 * noise[0], swing + 0.02 * noise[1]))
            sent += len(stamps)


def processor_seconds() -> float:
    """Of the browser: of all that descend from this process."""
    known: dict[int, tuple[int, float]] = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = file.read_text().rpartition(")")[2].split()
            known[int(file.parent.name)] = (
                int(words[1]),
                (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK"),
            )
    family = {os.getpid()}
    while more := {one for one, (parent, _) in known.items() if parent in family} - family:
        family |= more
    return sum(known[one][1] for one in family - {os.getpid()})


def drawn(chromium: str, rate: float, viewers: int, seconds: float = 10.0) -> None:
    """Print how often the page draws, and what that costs."""
    from playwright.sync_api import sync_playwright

    hub, ended = Hub({}), threading.Event()
    server = PageServer(hub, Path())
    server.start()
    threading.Thread(target=stream, args=(hub, rate, ended), daemon=True).start()
    with sync_playwright() as play:
        page = play.chromium.launch(executable_path=chromium).new_page(
            viewport={"width": 1280, "height": 900}
        )
        page.goto(server.address)
        for _ in range(viewers - 1):
            threading.Thread(target=watch, args=(server.address, ended), daemon=True).start()
        # So long until the traces are full, and the frames of a second have been counted.
        page.wait_for_timeout(22_000)
        before, counted, end = processor_seconds(), list[float](), time.monotonic() + seconds
        begun = time.monotonic()
        while time.monotonic() < end:
            counted.append(frames(page, 1.0))
        shares = (processor_seconds() - before) / (time.monotonic() - begun)
        rate_drawn = sum(counted) / len(counted)
        print(
            f"{rate:.0f} Hz, {viewers} viewers: {rate_drawn:.0f} frames a second, "
            f"{1e3 * shares / rate_drawn:.1f} ms of processor time each",
            flush=True,
        )
    ended.set()
    server.stop()


def main(folder: Path, chromium: str) -> None:
    """Capture, watch, and print what was seen."""
    from playwright.sync_api import sync_playwright

    folder.mkdir(parents=True, exist_ok=True)
    capture = folder / f"captured-{time.time():.0f}"
    server = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=device, args=(server, capture), daemon=True).start()
    wishes = [word for target in TARGETS for word in ("--target", target)]
    command = [
        sys.executable,
        "-c",
        RUN,
        "capture",
        f"tcp:127.0.0.1:{server.getsockname()[1]}",
        "--web",
        "--plain",
    ]
    running = subprocess.Popen([*command, "-o", str(capture), *wishes], stdout=subprocess.PIPE, text=True)
    assert running.stdout is not None
    try:
        address = next(line for line in running.stdout if "http://" in line).split()[-1]
        threading.Thread(target=lambda: [*running.stdout], daemon=True).start()  # type: ignore[misc]  # read away
        with sync_playwright() as play:
            journey(play.chromium.launch(executable_path=chromium), address, folder)
    finally:
        running.terminate()
        running.wait(20.0)


if __name__ == "__main__":
    browser_path = sys.argv[2] if len(sys.argv) > 2 else "/usr/bin/chromium"
    if sys.argv[1] == "frames":
        for hertz, count in ((200.0, 1), (2000.0, 1), (200.0, 20)):
            drawn(browser_path, hertz, count)
    else:
        main(Path(sys.argv[1]), browser_path)
