"""The parts of the net and their entries: each is a function that runs the program in an empty folder."""

from __future__ import annotations

import gzip
import json
import re
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tests.net.pins import checksums, pinned
from tests.net.run import (
    HERE,
    PACKAGED,
    REFERENCE,
    SITE,
    calibrated,
    document,
    said,
    shown,
    simulated,
    tumble,
)

Entry = Callable[[], Any]
Entries = dict[str, Entry]
GIVEN = HERE / "given"

# -- calibrations ------------------------------------------------------------------------------------

SLOW = ("--sample-rate", 20)
PLAYED: dict[str, tuple[Any, ...]] = {
    "six-position": (),
    "multi-position-26": (),
    "multi-position-9": (),
    "rate-table": SLOW,
    "modified-multi-position": ("--sample-rate", 50),
    "turntable-9": SLOW,
    "laboratory": SLOW,
    "strapdown-rotation": (),
    "hand-held": (),
    "thermal-soak": SLOW,
    "thermal-ramp": ("--sample-rate", 5),
    "thermal-fridge": (),
}
DEAR = [(f"thermal-{kind}", "tactical") for kind in ("soak", "ramp", "fridge")]
"""Half a minute each, and nothing that the other grade does not show."""
GRADES = {"consumer": "consumer-mems", "tactical": "tactical"}
MPU = ("--gravity", 9.81, "--rate", 100)


def played(protocol: str, grade: str, *arguments: object, **calibration: Any) -> Any:
    """Simulate a protocol on a unit of a grade, and calibrate from it."""
    files = simulated("played", protocol, "--imu", grade, *SITE, "--seed", 3, *arguments)
    more = calibration.get("more", ())
    return {"simulated": files, **calibrated("--protocol", "played/protocol.yaml", *more)}


def by_hand(*arguments: object, more: tuple[Any, ...] = ()) -> Any:
    """Simulate a unit by hand, and calibrate from the recording alone, without its protocol."""
    files = simulated("played", "hand-held", *SITE, *arguments)
    return {"simulated": files, **calibrated("played/recording.csv", *more)}


def turn_ons() -> Any:
    """Three turn-ons of one unit, told apart by biases."""
    moved = ("--unit-seed", 100, "--turn-on-bias", "2,200", *SITE)
    files = [simulated(f"day-{n}", "hand-held", *moved, "--seed", n) for n in (1, 2, 3)]
    days = [f"day-{n}/recording.csv" for n in (1, 2, 3)]
    return {"simulated": files, **calibrated(*days, "--turn-ons", *SITE)}


def with_prior() -> Any:
    """Six poses of a unit that an earlier calibration knows, with limits on it."""
    simulated("first", "hand-held", "--unit-seed", 100, "--seed", 1, *SITE)
    calibrated("first/recording.csv", *SITE, output="prior")
    files = simulated("played", "six-position", "--unit-seed", 100, "--seed", 2, *SITE)
    limits = "rule: guarded\nlimits: {accelerometer bias: 1 g, gyro scale factor error: 20 %}\n"
    Path("limits.yaml").write_text(limits)
    more = ("--prior", "prior/calibration.json", "--procedure", "multi-position", "--limits", "limits.yaml")
    return {"simulated": files, **calibrated("played/recording.csv", *SITE, *more)}


def with_noise() -> Any:
    """A unit whose own noise was measured."""
    simulated("still", "rest", "--unit-seed", 100, "--seed", 1, "--duration", 200, *SITE)
    tumble("noise", "still/recording.csv", "-o", "noise")
    files = simulated("played", "hand-held", "--unit-seed", 100, "--seed", 2, *SITE)
    return {"simulated": files, **calibrated("played/recording.csv", *SITE, "--noise", "noise/noise.json")}


def calibrations() -> Entries:
    """All protocols by two grades, ways by hand, the real recordings."""
    made: Entries = {
        f"{protocol}-{short}": partial(played, protocol, grade, *arguments)
        for protocol, arguments in PLAYED.items()
        for short, grade in GRADES.items()
        if (protocol, short) not in DEAR
    }
    drawn = ("--monte-carlo", 1000)
    field = ("--field", "49uT,65")
    xsens = REFERENCE / "xsens_mti_hand"
    return made | {
        "hand-held-alone": partial(by_hand, "--seed", 7, more=SITE),
        "hand-held-counts": partial(
            by_hand, "--seed", 8, "--output-units", "counts", more=(*SITE, "--units", "counts")
        ),
        "hand-held-magnetometer": partial(
            by_hand,
            "--seed",
            9,
            "--magnetometer",
            "lis3mdl",
            {"magnetic_field_ut": 49},
            more=(*SITE, *field),
        ),
        "hand-held-wanders": partial(
            by_hand,
            "--seed",
            10,
            {"wander": True, "nonlinear": True, "asymmetry_ppm": 500},
            more=SITE,
        ),
        "hand-held-jitters": partial(
            by_hand, "--seed", 11, {"jitter_ms": 0.5, "dropped_percent": 1, "burst_samples": 3}, more=SITE
        ),
        "hand-held-monte-carlo": partial(by_hand, "--seed", 12, more=(*SITE, *drawn)),
        "hand-held-data-sheet": partial(
            by_hand,
            "--seed",
            13,
            more=(*SITE, "--procedure", "multi-position", "--prior", "consumer-mems"),
        ),
        "multi-position-own": partial(by_hand, "--seed", 14, more=(*SITE, "--procedure", "multi-position")),
        "improved-six-position": partial(
            played, "six-position", "consumer-mems", more=("--procedure", "improved-six-position")
        ),
        "turntable-18": partial(played, "turntable-18", "tactical", *SLOW),
        "turn-ons": turn_ons,
        "prior-and-limits": with_prior,
        "own-noise": with_noise,
        "real-mpu9150-imu0": partial(calibrated, PACKAGED / "mpu9150-imu0.csv.gz", *MPU),
        "real-mpu9150-imu1": partial(calibrated, REFERENCE / "mpu9150" / "imu1.log.gz", *MPU),
        "real-mpu9150-16-s": partial(calibrated, REFERENCE / "mpu9150" / "imu0-first-16-s.log", *MPU),
        "real-xsens": partial(
            calibrated, xsens / "xsens_acc.txt.gz", xsens / "xsens_gyro.txt.gz", "--gravity", 9.81744
        ),
    }


# -- formats -----------------------------------------------------------------------------------------

CHANNELS = ("time", "specific_force", "angular_rate", "temperature", "magnetic_field")
KINDS = ("accel", "gyro")
FACTS = ("specific_force_unit", "angular_rate_unit", "rate")


def read(content: bytes, name: str, *units: object) -> Any:
    """Read a sample from Python, and look at it from the command line."""
    from tumble import TumbleError, read_recording

    made = Path("sample") / name
    made.parent.mkdir()
    made.write_bytes(content)
    kept: dict[str, Any] = {"inspect": tumble("inspect", made, *units)}
    try:
        recording = read_recording(made, **({"units": units[1]} if units else {}))
    except TumbleError as error:
        return kept | {"refused": said(str(error))}
    kept |= {name: pinned(getattr(recording, name, None)) for name in FACTS}
    kept["remarks"] = [line for remark in recording.remarks for line in said(remark.text)]
    for channel in CHANNELS:
        values = getattr(recording, channel, None)
        if values is not None:
            columns = np.atleast_2d(np.asarray(values, dtype=float).T)
            kept[channel] = [checksums(column) for column in columns]
    return kept


def formats() -> Entries:
    """The samples that other tests make, each maker by itself: what cannot be made any more is gone."""
    made: Entries = {}

    def contract(folder: Path) -> None:
        from tests.contract import test_formats as module

        for number, (name, (_, write)) in enumerate(module.MEMBERS.items()):
            path = folder / str(number) / "recording.data"
            path.parent.mkdir()
            write(path, module.example())
            made[f"contract-{name}"] = partial(read, path.read_bytes(), path.name, "--units", "m/s^2,rad/s")

    def logs(folder: Path) -> None:
        from tests.contract import test_flight_logs as module

        raw, slow = (
            [module.raw_sensor(kind, 0, values, step) for kind, values in zip(KINDS, pair, strict=True)]
            for pair, step in (((module.FORCE, module.RATE), 1), ((module.FORCE, module.RATE), 100))
        )
        logs = {"raw": [*raw, module.combined()], "slow": [*slow, module.combined()]}
        for name, messages in (logs | {"relative": [module.combined(-2000)]}).items():
            module.write_ulog(folder / "log.ulg", *messages)
            made[f"ulog-{name}"] = partial(read, (folder / "log.ulg").read_bytes(), "log.ulg")

    def seeds(group: str, folder: Path) -> None:
        from tests.fuzz import seeds as module

        make = getattr(module, group)
        files = make(folder) if make.__code__.co_argcount else make()
        for number, (name, content) in enumerate(files):
            made[f"seed{group}-{number:02d}-{name}"] = partial(read, content, name)

    groups = ("_texts",)
    for make in (contract, logs, *(partial(seeds, group) for group in groups)):
        with tempfile.TemporaryDirectory() as folder, suppress(ImportError, AttributeError):
            make(Path(folder))  # if its maker left, its entries are said to be gone
    return made


# -- targets -----------------------------------------------------------------------------------------

SUBJECTS = {
    "by-hand": GIVEN / "by-hand.json",
    "thermal": GIVEN / "thermal.json",
    "drive": REFERENCE / "drive_rtk" / "calibration.json",
}


def converted(target: str) -> Any:
    """Write each calibration in the target's form: as it stands, and with all that can be given."""
    made: dict[str, Any] = {}
    for name, source in SUBJECTS.items():
        wishes = ("--noise", GIVEN / "noise.json", "--largest-loss", 1e6, "--consumer-rate", 200)
        wishes += ("--at-temperature", 20) if name == "thermal" else ()
        for way, more in (("plain", ()), ("asked", wishes)):
            folder = Path(f"{name}-{way}")
            folder.mkdir()
            made[folder.name] = answer = tumble(
                "convert", source, "--to", target, "-o", folder / "made", *more
            )
            files = sorted(path for path in folder.rglob("*") if path.is_file())
            answer["files"] = {str(path.relative_to(folder)): said(path.read_text("utf-8")) for path in files}
            if way == "asked" and len(files) == 1 and answer["status"] == 0:
                answer["read back"] = tumble("convert", files[0], "--from", target, "-o", "back.json")
                answer["read back"]["document"] = document("back.json")
                Path("back.json").unlink(missing_ok=True)
    return made


def targets() -> Entries:
    """Each target that the program lists."""
    listed = json.loads("\n".join(tumble("convert", "--json")["out"]))
    return {entry["name"]: partial(converted, entry["name"]) for entry in listed}


# -- noise, drives -----------------------------------------------------------------------------------


def noise_of(simulation: tuple[Any, ...], *arguments: object) -> Any:
    """Simulate a unit at rest, and find its noise."""
    files = simulated("still", "rest", "--seed", 5, *SITE, *simulation)
    answer = tumble("noise", "still/recording.csv", "-o", "noise", *arguments)
    return {"simulated": files, "noise": answer, "noise.json": document("noise/noise.json")}


def noise() -> Entries:
    """Six units at rest."""
    wandering = ({"wander": True}, "--duration", 1800, "--sample-rate", 20)
    return {
        "consumer": partial(noise_of, ("--duration", 600)),
        "consumer-wanders": partial(noise_of, wandering),
        "consumer-moments": partial(noise_of, wandering, "--fit", "moments"),
        "consumer-counts": partial(noise_of, ("--output-units", "counts", "--duration", 600), "--skip", 30),
        "tactical": partial(noise_of, ("--imu", "tactical", *wandering)),
        "ring-laser": partial(noise_of, ("--imu", "ring-laser", *wandering)),
    }


def drive() -> Any:
    """Judge a calibration by the short drive."""
    for name in ("imu.csv", "track.pos"):
        Path(name).write_bytes(gzip.decompress((REFERENCE / "drive_rtk" / f"{name}.gz").read_bytes()))
    given = (
        REFERENCE / "drive_rtk" / "calibration.json",
        "imu.csv",
        "--gnss",
        "track.pos",
        "--units",
        "g,deg/s,ms",
    )
    answer = tumble("verify", *given, "-o", "out")
    return {"verify": answer, "verify.json": document("out/verify.json"), "page": shown("out/verify.html")}


def drives() -> Entries:
    """The short drive, and what verifying by holds says of another recording."""
    return {"rtk": drive, "holds": verified}


def verified() -> Any:
    """Calibrate the one unit of the MPU-9150s, and judge the other by it: not fit; and itself: fit."""
    calibrated(PACKAGED / "mpu9150-imu0.csv.gz", *MPU)
    own = tumble("verify", "out", PACKAGED / "mpu9150-imu0.csv.gz", "--rate", 100)
    return {
        "own": own,
        "other": tumble("verify", "out", REFERENCE / "mpu9150" / "imu1.log.gz", "--rate", 100),
    }


# -- captures ----------------------------------------------------------------------------------------


def replayed(simulation: tuple[Any, ...], *arguments: object) -> Any:
    """Play a simulated recording as if it came now."""
    files = simulated("played", *simulation, *SITE)
    return {"simulated": files, **replay("played/recording.csv", *SITE, *arguments)}


def replay(file: object, *arguments: object) -> Any:
    """Play a recording as if it came now: what the guide said, and what came of it."""
    answer = tumble("capture", f"replay:{file}@0", "-o", "out", *arguments)
    events = Path("out/session.jsonl").read_text().splitlines() if Path("out/session.jsonl").is_file() else []
    kept = [pinned(json.loads(line)) for line in events]
    return {
        "capture": answer,
        "events": [said(event["words"]) for event in kept if "words" in event],
        "numbers": [{k: v for k, v in event.items() if k not in ("words", "event")} for event in kept[-12:]],
        "kinds": [event["event"] for event in kept],
        "calibration.json": document("out/calibration.json"),
    }


def captures() -> Entries:
    """Five replays."""
    compass = ("--magnetometer", "lis3mdl")
    return {
        "hand-held": partial(replayed, ("hand-held", "--seed", 21)),
        "hand-held-magnetometer": partial(replayed, ("hand-held", "--seed", 22, *compass)),
        "six-position": partial(replayed, ("six-position", "--seed", 23), "--protocol", "six-position"),
        "rest": partial(replayed, ("rest", "--seed", 24, "--duration", 120), "--protocol", "rest"),
        "real-mpu9150": partial(replay, REFERENCE / "mpu9150" / "imu0-first-16-s.log", *MPU),
    }


# -- pages -------------------------------------------------------------------------------------------


def report_of(*simulation: object, more: tuple[Any, ...] = ()) -> Any:
    """Calibrate what was played, and keep the page."""
    files = simulated("played", *simulation, *SITE)
    calibrated("--protocol", "played/protocol.yaml", *more)
    return {"simulated": files, "page": shown("out/report.html")}


def page_of(*command: object, before: tuple[tuple[Any, ...], ...] = (), path: str) -> Any:
    """Run a command, others before it, and keep the page that it writes."""
    for one in before:
        tumble(*one)
    return {"answer": tumble(*command), "page": shown(path)}


def pages() -> Entries:
    """Reports of eight kinds."""
    compass = ("--magnetometer", "lis3mdl")
    still = ("simulate", "rest", "--seed", 5, "--duration", 300, "-o", "still", *SITE)
    return {
        "hand-held": partial(report_of, "hand-held", "--seed", 31),
        "magnetometer": partial(report_of, "hand-held", "--seed", 32, *compass, more=("--field", "49uT,65")),
        "six-position": partial(report_of, "six-position", "--seed", 33),
        "rate-table": partial(report_of, "rate-table", "--seed", 34, *SLOW, "--imu", "tactical"),
        "strapdown-rotation": partial(report_of, "strapdown-rotation", "--seed", 35, "--imu", "tactical"),
        "turntable": partial(report_of, "turntable-9", "--seed", 36, *SLOW, "--imu", "tactical"),
        "thermal": partial(report_of, "thermal-soak", "--seed", 37, *SLOW),
        "real": partial(
            page_of, "calibrate", PACKAGED / "mpu9150-imu0.csv.gz", *MPU, "-o", "out", path="out/report.html"
        ),
        "noise": partial(
            page_of, "noise", "still/recording.csv", "-o", "noise", before=(still,), path="noise/noise.html"
        ),
    }


# -- reproduction ------------------------------------------------------------------------------------

FEW = 3


def reproduced(item: str, repetitions: int) -> Any:
    """Make an item of the papers anew."""
    answer = tumble("reproduce", item, "--repetitions", repetitions, "--seed", 1, "-o", "out")
    answer["out"] = [re.sub(r"(, seed 1), .* (s|min)\.$", r"\1.", line) for line in answer["out"]]
    return {"answer": answer, "document": document(f"out/{item}.json")}


def reproduction() -> Entries:
    """Every item that the program lists, the dear ones with one run."""
    lines = tumble("reproduce")["out"]
    names = [line.split()[0] for line in lines if line.startswith(("hayal-", "zhang-", "savage-"))]
    dear = ("hayal-5.", "hayal-figure-5.", "zhang-figure-7", "zhang-figure-10")
    few = {name: 1 if name.startswith(dear) else FEW for name in names} | {"hayal-figure-5.7": 2}
    return {name: partial(reproduced, name, few[name]) for name in names}


PARTS: Mapping[str, Callable[[], Entries]] = {
    "calibrations": calibrations,
    "captures": captures,
    "drives": drives,
    "formats": formats,
    "noise": noise,
    "pages": pages,
    "reproduction": reproduction,
    "targets": targets,
}
