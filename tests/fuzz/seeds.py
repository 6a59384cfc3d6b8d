"""Sound files of every kind that tumble reads, small, the same every time."""

import bz2
import gzip
import io
import json
import lzma
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

COUNT = 240
HEADER = "t,ax,ay,az,gx,gy,gz"
Seeds = dict[str, list[tuple[str, bytes]]]
"""By kind: names of files and what is in them."""


def rows() -> np.ndarray:
    """Time, specific force and angular rate of a unit that is turned over twice."""
    rng = np.random.default_rng(11)
    time = np.arange(COUNT) / 50.0
    pose = np.minimum(np.arange(COUNT) // 80, 2)
    force = np.array([[0.1, -0.2, 9.8], [9.7, 0.3, -0.1], [0.2, -9.8, 0.2]])[pose]
    rate = np.zeros((COUNT, 3))
    rate[76:84], rate[156:164] = [0.0, 2.0, 0.0], [1.5, 0.0, 0.0]
    return np.column_stack(
        [time, force + rng.normal(0, 0.02, force.shape), rate + rng.normal(0, 0.002, rate.shape)]
    )


def text(numbers: np.ndarray, separator: str = ",") -> str:
    """Rows of numbers as text."""
    return "".join(separator.join(f"{v:.6g}" for v in row) + "\n" for row in numbers.tolist())


@cache
def seeds() -> Seeds:
    """Return all seeds by kind, in a fixed order."""
    with tempfile.TemporaryDirectory(prefix="tumble-fuzz-") as folder:
        place = Path(folder)
        found: Seeds = {
            "text": _texts(),
            "recording": _recordings(place),
            "calibration": calibrations(),
            "foreign": _foreign(),
            "noise": [("noise.json", _noise())],
            "protocol": _protocols(),
            "gnss": _tracks(),
            "intervals": [("holds.csv", b"start,stop\n0.1,1.4\n1.8,3.0\n# last\n3.4 4.7\n")],
            "errors": [("errors.yaml", ERRORS)],
            "call": [("call.json", json.dumps(call.split()).encode()) for call in CALLS],
            "work": [(f"{command}/tumbled.csv", tumbled()) for command in WORK],
        }
    return found


def _texts() -> list[tuple[str, bytes]]:
    body, plain = rows(), f"{HEADER}\n{text(rows())}"
    counts = np.round(body * [50, 1000, 1000, 1000, 5000, 5000, 5000])
    iso = "".join(
        f"2024-03-01T12:00:{r[0]:06.3f}Z," + ",".join(f"{v:.5g}" for v in r[1:]) + "\n" for r in body
    )
    comma = text(body, ";").replace(".", ",")
    return [
        ("hand.csv", plain.encode()),
        ("hand.csv", ("# made by hand\r\n" + plain.replace("\n", "\r\n")).encode()),
        ("hand.csv", f"\ufeff{plain}".encode()),
        ("hand.csv", plain.encode("utf-16")),
        (
            "units.csv",
            plain.replace(
                HEADER, "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx (rad/s),gy (rad/s),gz (rad/s)"
            ).encode(),
        ),
        ("bare.txt", text(body, " ").encode()),
        ("spaces.txt", ("t  ax  ay  az  gx  gy  gz\n" + text(body, "   ")).encode()),
        ("tabs.tsv", (HEADER.replace(",", "\t") + "\n" + text(body, "\t")).encode()),
        ("comma.csv", (HEADER.replace(",", ";") + "\n" + comma).encode()),
        ("quoted.csv", plain.replace(",", '","').replace("\n", '"\n"').encode()),
        ("iso.csv", f"time,ax,ay,az,gx,gy,gz\n{iso}".encode()),
        (
            "counts.csv",
            (HEADER + ",temperature\n" + text(np.column_stack([counts, 25 + body[:, 0]]))).encode(),
        ),
        ("one.csv", ("t,ax,ay,az\n" + text(body[:, :4])).encode()),
        ("hand.csv.gz", gzip.compress(plain.encode(), mtime=0)),
        ("hand.csv.bz2", bz2.compress(plain.encode())),
        ("hand.csv.xz", lzma.compress(plain.encode())),
    ]


def _recordings(place: Path) -> list[tuple[str, bytes]]:
    """A file of every format, and a phone's log in an archive."""
    from contract.test_formats import MEMBERS, example
    from tumble.recording import FORMATS

    made: list[tuple[str, bytes]] = []
    endings = {format_.name: format_.ending for format_ in FORMATS}
    for number, (name, (format_, write)) in enumerate(MEMBERS.items()):
        path = place / str(number) / f"{name}{endings[format_]}"
        path.parent.mkdir()
        with suppress(ImportError, pytest.skip.Exception):  # what writes a sample is not there
            write(path, example()[:COUNT])
            made.append((path.name, path.read_bytes()))
    body, names, log = rows(), "seconds_elapsed,x,y,z\n", io.BytesIO()
    with zipfile.ZipFile(log, "w", zipfile.ZIP_DEFLATED) as archive:
        for sensor, columns in (("Accelerometer", [0, 1, 2, 3]), ("Gyroscope", [0, 4, 5, 6])):
            member = zipfile.ZipInfo(f"{sensor}.csv", (2024, 1, 1, 0, 0, 0))
            archive.writestr(member, names + text(body[:, columns]))
    return [*made, ("phone.zip", log.getvalue())]


def calibrations() -> list[tuple[str, bytes]]:
    from tests.unit.export import a_unit

    from tumble.sensor import ImuModel, TemperatureBasis, ThermalModel, Triad

    matrix = np.array([[1.01, 0.004, -0.007], [-0.009, 0.99, 0.006], [0.003, -0.012, 1.02]])
    triad = Triad(
        matrix, np.array([0.1, -0.2, 0.3]), np.array([1e-4, 0.0, -2e-4]), np.array([1e-5, 0.0, 2e-5])
    )
    model = ImuModel(triad, Triad(matrix.T, np.array([0.01, -0.03, 0.02])), 1e-3 * matrix)
    basis = TemperatureBasis("polynomial", 25.0, np.zeros(0), 2)
    thermal = ThermalModel(
        reference=model,
        basis=basis,
        coefficients={"accelerometer.bias": np.array([[1e-3, 0.0, 0.0], [0.0, 1e-5, 0.0]])},
        rate_coefficients={},
        hysteresis={},
        span_celsius=(0.0, 50.0),
    )
    made: list[tuple[str, bytes]] = []
    for document in (a_unit.document(model), a_unit.thermal_document(thermal)):
        fixed = structs.replace(document, remarks=["x"], created="2024-01-01T00:00:00+00:00")
        made.append(("calibration.json", fixed.to_json().encode()))
    return made


def _foreign() -> list[tuple[str, bytes]]:
    from tests.contract.test_targets import NOISE_NUMBERS, document, model_for

    from tumble.export import Wishes, prepare, targets

    made: list[tuple[str, bytes]] = []
    for name, target in targets().items():
        if "from" not in target.directions:
            continue
        subject = prepare(document(model_for(target)), target, Wishes(), NOISE_NUMBERS)
        for file, content in target.write(subject).items():
            made.append((f"{name}/{Path(file).name}", content.encode()))
    return made


def _noise() -> bytes:
    term = {"value": 1e-3, "standard_uncertainty": 1e-5}
    channel = {
        "unit": "m/s²",
        "terms": {"N": term, "B": term, "K": term, "sigma": term, "correlation time": {"value": 20.0}},
        "random_walk": {"value": 1e-3, "correlation_times_s": [0.1]},
        "upper_limits_of_unseen": {"R": term},
        "lines": [{"amplitude": 1e-4, "frequency_hz": 12.0}],
    }
    channels = {
        name: channel | {"unit": "m/s²" if name[0] == "a" else "rad/s"}
        for name in ("ax", "ay", "az", "gx", "gy", "gz")
    }
    return json.dumps(
        {"format": "tumble noise", "version": 1, "rate_hz": 100.0, "channels": channels}
    ).encode()


def _protocols() -> list[tuple[str, bytes]]:
    from dataclasses import replace

    from tumble.earth import Site
    from tumble.protocol import PROTOCOLS, named_protocol, protocol_to_yaml

    site = Site.from_latitude(0.8, 500.0)
    made = [
        (f"{name}.yaml", protocol_to_yaml(replace(named_protocol(name), site=site)).encode())
        for name in PROTOCOLS
    ]
    hot = (
        "format: tumble protocol\nprocedure: thermal\nsite: {latitude_deg: 48.1, height_m: 520}\nsteps:\n"
        "  - soak: cold\n    temperature_celsius: -10\n    seconds: 600\n  - hold: up\n    up: z\n    seconds: 20\n"
        "  - ramp: warm\n    from_celsius: -10\n    to_celsius: 50\n    rate_k_per_min: 1\n"
    )
    return [
        *made,
        ("thermal.yaml", hot.encode()),
        ("like.yaml", b"format: tumble protocol\nlike: multi-position-26\ngravity: 9.81\n"),
    ]


def _tracks() -> list[tuple[str, bytes]]:
    from tests.unit.navigation import test_gnss as gnss

    table = "time,latitude,longitude,height,sdn,sde,sdu\n" + "".join(
        f"2025-07-08 19:34:{s:02d},40.0966,-105.1474,1601.4,0.01,0.01,0.02\n" for s in range(20)
    )
    fixes = "".join(gnss.ROW.format(s / 2, 40.0966, -105.1474, 1601.4) for s in range(40))
    return [
        ("track.csv", table.encode()),
        ("track.pos", (gnss.HEADER + fixes).encode()),
        ("track.nmea", "".join(gnss.nmea(s) for s in range(20)).encode()),
    ]


ERRORS = b"""jitter_ms: 1
wander: true
table_angle_arcsec: 5
table_stops_percent: {1: 50, 2: 60}
table_lever_arm_cm: [1, 2.5, -3]
"""

CALLS = (
    "calibrate hand.csv -o out --site 48.1,520 --gravity 9.81 --units m/s^2,rad/s,s --json",
    "calibrate hand.csv -o out --procedure multi-position --columns t,ax,ay,az,gx,gy,gz --rate 50",
    "calibrate hand.csv -o out --procedure joint --monte-carlo 100 --data-sheet consumer-mems -v --confirm-scale",
    "calibrate hand.csv -o out --prior calibration.json --noise noise.json --intervals holds.csv --imu-model X",
    "calibrate hand.csv -o out --protocol rate-table --imu-serial 7 -q",
    "calibrate hand.csv -o out --protocol laboratory --site 48.1",
    "calibrate hand.csv -o out --protocol strapdown-rotation --site -33.9,10",
    "calibrate hand.csv hand.csv -o out --turn-ons --topic /imu",
    "inspect hand.csv --save saved.csv --units g,deg/s,ms --columns t,ax,ay,az,gx,gy,gz --rate 100 -v",
    "apply calibration.json hand.csv -o corrected.csv --temperature 25 --outside hold --json",
    "verify calibration.json hand.csv --site 48.1,520 --temperature 20 --gravity 9.8",
    "verify calibration.json hand.csv --gnss track.csv -o out --lever-arm 0.1,0.2,0.3 --turn-on-bias 1,10",
    "predict calibration.json --seconds 60 --data-sheet consumer-mems --json",
    "predict calibration.json -o filter.json --noise noise.json --turn-on-bias 1,10 --seconds 30",
    "convert calibration.json --to kalibr -o made.yaml --noise noise.json --ros-topic /imu0",
    "convert calibration.json --to px4 -o made.params --largest-loss 500",
    "convert calibration.json --to kf-gins -o made.yaml --noise noise.json",
    "convert calibration.json --to c -o made.h --at-temperature 20 --consumer-rate 100",
    "diff calibration.json calibration.json --json",
    "mount hand.csv hand.csv -c calibration.json -o mount.json --mount-mrad 1",
    "noise hand.csv -o out --skip 1 --fit curve --units g,deg/s",
    "noise hand.csv --remove-temperature --rate 50 --json",
    "simulate six-position -o out --sample-rate 5 --seed 3 --unit-seed 4 --errors errors.yaml",
    "simulate rest -o out --duration 10 --output-units counts --turn-on-bias 1,10 --magnetometer lis3mdl",
    "simulate turntable-9 -o out --sample-rate 2 --errors errors.yaml --site 48.1",
    "simulate strapdown-rotation -o out --sample-rate 2 --errors errors.yaml --gravity 9.81",
    "plan six-position --data-sheet consumer-mems --hold 60 --site 48.1",
)
"""Calls of the program with as many options as go together; each is changed word by word."""
WORK = ("calibrate", "noise", "verify", "apply", "inspect")
"""Commands that are given recordings whose numbers were changed."""


@cache
def tumbled() -> bytes:
    """Return a recording of a unit that was tumbled through ten poses: enough to be calibrated."""
    from tests.cli.program import HEADER as NAMES, tumbled_rows

    body = tumbled_rows(3, holds=10)[::2]
    return (NAMES + "\n" + text(body)).encode()


def repacked(name: str, content: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Return a packed file whose content was changed, so that mutations reach what is inside."""
    try:
        if name.endswith(".gz"):
            return gzip.compress(change(gzip.decompress(content)), mtime=0)
        if name.endswith(".bz2"):
            return bz2.compress(change(bz2.decompress(content)))
        if name.endswith(".xz"):
            return lzma.compress(change(lzma.decompress(content)))
        if name.endswith((".zip", ".npz")):
            out = io.BytesIO()
            with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
                for member in old.infolist():
                    new.writestr(
                        zipfile.ZipInfo(member.filename, (2024, 1, 1, 0, 0, 0)), change(old.read(member))
                    )
            return out.getvalue()
    except (OSError, ValueError, zipfile.BadZipFile):
        pass
    return change(content)
