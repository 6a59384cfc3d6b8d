"""Files and calls that once hung, filled the memory or the disk, lost rows, or ended in a traceback.

Each is made in a folder of its own and given to the program as its user would; its time and its memory are measured.
"""

from __future__ import annotations

import gzip
import io
import json
import lzma
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.fuzz.seeds import HEADER, rows, seeds, text

SECONDS = 20.0
"""Longest that one may take, Python's start included."""
MEGABYTES = 1000
"""Most memory that one may take."""
Make = Callable[[Path], list[str]]
CASES: dict[str, Make] = {}
"""By name: what writes the files of a case into a folder and returns the call."""
_GIGABYTE = 1 << 30


@dataclass(frozen=True, slots=True)
class Ended:
    """How a call ended: status, words, seconds of processor time, megabytes, bytes that it left in its folder."""

    status: int
    said: str
    seconds: float
    megabytes: int
    left: int

    def faults(self) -> list[str]:
        """Return what is wrong with it."""
        found = [] if self.status in (0, 1, 2, 3) else [f"status {self.status}"]
        if "Traceback" in self.said or "Warning" in self.said:
            found.append("words for programmers")
        if self.status and (self.said.count("\n") != 1 or not self.said.startswith("tumble: ")):
            found.append("not one sentence")
        if self.status == 0 and self.said.strip():
            found.append("words beside a result")
        found += [f"{self.seconds:.0f} s"] if self.seconds > SECONDS else []
        found += [f"{self.megabytes} MB of memory"] if self.megabytes > MEGABYTES else []
        return found + ([f"{self.left >> 20} MB left on the disk"] if self.left > _GIGABYTE else [])


def case(name: str) -> Callable[[Make], Make]:
    """Enter a case under a name."""

    def entered(make: Make) -> Make:
        CASES[name] = make
        return make

    return entered


def ended(name: str) -> Ended:
    """Make a case, run it, and say how it ended."""
    with tempfile.TemporaryDirectory(prefix="tumble-hostile-") as place:
        folder = Path(place)
        shutil.copytree(_sound()[1], folder, dirs_exist_ok=True)
        arguments = _made_apart(name, folder)
        before = _bytes_in(folder)
        status, said, seconds, megabytes = _run(arguments, folder)
        return Ended(status, said, seconds, megabytes, _bytes_in(folder) - before)


def _made_apart(name: str, folder: Path) -> list[str]:
    """Make a case in a process of its own: the program's memory is counted from that of who starts it."""
    script = "import sys; from tests.faults.hostile import made; made(*sys.argv[1:])"
    call = [sys.executable, "-c", script, name, str(folder)]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    return list(json.loads(done.stdout))


def made(name: str, place: str) -> None:
    """Write the files of a case into a folder, and print its call."""
    print(json.dumps(CASES[name](Path(place))))


@cache
def _sound() -> tuple[tempfile.TemporaryDirectory[str], Path]:
    """Sound files, which are in the folder of every case."""
    held = tempfile.TemporaryDirectory(prefix="tumble-sound-")
    script = "import sys; from tests.faults.hostile import write_sound; write_sound(sys.argv[1])"
    subprocess.run([sys.executable, "-c", script, held.name], check=True)
    return held, Path(held.name)


def write_sound(place: str) -> None:
    """Write a recording, a calibration with its covariance, and a noise file into a folder."""
    from tests.fuzz.seeds import HEADER, rows, text

    folder = Path(place)
    (folder / "hand.csv").write_text(f"{HEADER}\n{text(rows())}")
    (folder / "calibration.json").write_bytes(seeds()["calibration"][0][1])
    (folder / "noise.json").write_bytes(seeds()["noise"][0][1])


def _bytes_in(folder: Path) -> int:
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())


def _run(arguments: list[str], folder: Path) -> tuple[int, str, float, int]:
    """Run the program; return status, standard error, seconds and the most megabytes that it had."""
    # `sh:` is a command of a shell, in which `tumble` is the program.
    program = [sys.executable, "-c", "from tumble.cli import program; program()"]
    call = [*program, *arguments]
    if arguments[0] == "sh:":
        quoted = " ".join(f"'{part}'" for part in program)
        call = ["bash", "-c", f'tumble() {{ {quoted} "$@"; }}; {arguments[1]}']
    with (folder / ".said").open("w+b") as said:
        process = subprocess.Popen(
            call, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said
        )
        watch = threading.Timer(6 * SECONDS, process.kill)
        watch.start()
        _, status, used = os.wait4(process.pid, 0)
        watch.cancel()
        said.seek(0)
        words = said.read().decode(errors="replace")
    (folder / ".said").unlink()
    seconds = used.ru_utime + used.ru_stime
    return os.waitstatus_to_exitcode(status), words, seconds, used.ru_maxrss >> 10


def _calibrate(*files: str) -> list[str]:
    return ["calibrate", *files, "-o", "made"]


for _command in ("inspect", "calibrate", "apply calibration.json", "noise"):
    CASES[f"{_command} <(pipe)"] = lambda folder, c=_command: ["sh:", f"tumble {c} <(cat hand.csv)"]
    CASES[f"{_command} /dev/stdin"] = lambda folder, c=_command: [
        "sh:",
        f"cat hand.csv | tumble {c} /dev/stdin",
    ]


def _special() -> None:
    """Devices and pipes, everywhere where a file is read."""
    for place in ("/dev/zero", "/dev/urandom", "fifo"):
        for words in (
            "calibrate {}",
            "calibrate hand.csv --prior {}",
            "calibrate hand.csv --noise {}",
            "calibrate hand.csv --intervals {}",
            "calibrate hand.csv --protocol {}",
            "apply {} hand.csv",
            "verify calibration.json {}",
            "verify calibration.json hand.csv --gnss {}",
            "convert --from kalibr {} -o made.json",
            "convert --from ardupilot {} -o made.json",
            "convert calibration.json --to kalibr --noise {} -o made.yaml",
            "diff calibration.json {}",
            "plan {}",
            "simulate {}",
            "predict calibration.json --trajectory {}",
        ):

            def make(folder: Path, words: str = words, place: str = place) -> list[str]:
                if place == "fifo":
                    os.mkfifo(folder / "fifo")
                return words.format(place).split()

            CASES[words.format(place)] = make


_special()


@case("YAML alias bomb, kalibr")
def _(folder: Path) -> list[str]:
    (folder / "bomb.yaml").write_text(_aliases())
    return ["convert", "--from", "kalibr", "bomb.yaml", "-o", "made.json"]


@case("YAML alias bomb, ikalibr")
def _(folder: Path) -> list[str]:
    (folder / "bomb.yaml").write_text(_aliases())
    return ["convert", "--from", "ikalibr", "bomb.yaml", "-o", "made.json"]


@case("YAML alias bomb, protocol")
def _(folder: Path) -> list[str]:
    (folder / "bomb.yaml").write_text("format: tumble protocol\n" + _aliases())
    return [*_calibrate("hand.csv"), "--protocol", "bomb.yaml"]


def _aliases() -> str:
    first = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n"
    more = "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 12))
    return first + more


@case("MCAP with three chunks of 1 GB of zeros")
def _(folder: Path) -> list[str]:
    (folder / "bomb.mcap").write_bytes(_mcap())
    return ["inspect", "bomb.mcap"]


def _mcap() -> bytes:
    import zstandard

    def string(words: str) -> bytes:
        return struct.pack("<I", len(words)) + words.encode()

    def record(op: int, body: bytes) -> bytes:
        return struct.pack("<BQ", op, len(body)) + body

    zeros = zstandard.ZstdCompressor(level=3).compressobj(size=_GIGABYTE)
    packed = b"".join(zeros.compress(bytes(1 << 24)) for _ in range(64)) + zeros.flush()
    chunk = (
        struct.pack("<QQQI", 0, 1, _GIGABYTE, 0) + string("zstd") + struct.pack("<Q", len(packed)) + packed
    )
    magic = b"\x89MCAP0\r\n"
    start = record(1, string("") + string("x"))
    return (
        magic + start + 3 * record(6, chunk) + record(15, struct.pack("<I", 0)) + record(2, bytes(20)) + magic
    )


@case("HDF5 of 2e8 rows that were never written")
def _(folder: Path) -> list[str]:
    import h5py

    with h5py.File(folder / "empty.h5", "w") as file:
        for name in ("acc", "gyr"):
            file.create_dataset(name, shape=(200_000_000, 3), dtype="f8", chunks=(1 << 16, 3))
    return ["inspect", "empty.h5"]


@case("HDF5 whose numbers are in a pipe outside")
def _(folder: Path) -> list[str]:
    import h5py

    os.mkfifo(folder / "fifo")
    with h5py.File(folder / "outside.h5", "w") as file:
        for name in ("acc", "gyr"):
            file.create_dataset(
                name, shape=(1000, 3), dtype="f8", external=[(os.fsencode(folder / "fifo"), 0, 24000)]
            )
    return ["inspect", "outside.h5"]


@case("CSV with a line of 100 MB")
def _(folder: Path) -> list[str]:
    (folder / "long.csv").write_text(f"{HEADER}\n{text(rows())}{'1' * 100_000_000}\n")
    return ["inspect", "long.csv"]


@case("CSV with 33 million empty columns")
def _(folder: Path) -> list[str]:
    (folder / "wide.csv").write_text("," * 100_000_000 + "\n")
    return ["inspect", "wide.csv"]


@case("CSV with 10,000 columns")
def _(folder: Path) -> list[str]:
    line = ",".join(["1.5"] * 10_000) + "\n"
    (folder / "wide.csv").write_text(",".join(f"c{n}" for n in range(10_000)) + "\n" + line * 100)
    return ["inspect", "wide.csv"]


def _packed(name: str, pack: Callable[[], bytes]) -> None:
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(pack())
        return ["inspect", name]

    CASES[f"{name}, 2 GB of one row"] = make


def _gz() -> bytes:
    made = io.BytesIO()
    with gzip.GzipFile(fileobj=made, mode="wb", mtime=0) as file:
        _fill(file)
    return made.getvalue()


def _xz() -> bytes:
    made = io.BytesIO()
    with lzma.LZMAFile(made, "w", preset=0) as file:
        _fill(file)
    return made.getvalue()


def _zst() -> bytes:
    import zstandard

    made = io.BytesIO()
    with zstandard.ZstdCompressor(level=1).stream_writer(made, closefd=False) as file:
        _fill(file)
    return made.getvalue()


def _fill(file: object) -> None:
    file.write(f"{HEADER}\n".encode())  # type: ignore[attr-defined]
    piece = b"0,0,0,9.8,0,0,0\n" * (1 << 20)
    for _ in range(128):
        file.write(piece)  # type: ignore[attr-defined]


for _name, _pack in (("bomb.csv.gz", _gz), ("bomb.csv.xz", _xz), ("bomb.csv.zst", _zst)):
    _packed(_name, _pack)


@case("gz within gz within gz")
def _(folder: Path) -> list[str]:
    content = _gz()
    for _ in range(3):
        content = gzip.compress(content, mtime=0)
    (folder / "bomb.csv.gz").write_bytes(content)
    return ["inspect", "bomb.csv.gz"]


@case("protocol of 10 MB")
def _(folder: Path) -> list[str]:
    step = "  - hold: up\n    up: z\n    seconds: 20\n"
    (folder / "long.yaml").write_text(
        "format: tumble protocol\ngravity: 9.81\nsteps:\n" + step * (10_000_000 // len(step))
    )
    return [*_calibrate("hand.csv"), "--protocol", "long.yaml"]


@case("protocol of 1.9 MB")
def _(folder: Path) -> list[str]:
    step = "  - hold: up\n    up: z\n    seconds: 20\n"
    (folder / "long.yaml").write_text(
        "format: tumble protocol\ngravity: 9.81\nsteps:\n" + step * (1_900_000 // len(step))
    )
    return [*_calibrate("hand.csv"), "--protocol", "long.yaml"]


@case("zip of 50,000 names")
def _(folder: Path) -> list[str]:
    with zipfile.ZipFile(folder / "many.zip", "w") as archive:
        for n in range(50_000):
            archive.writestr(f"{n}.csv", "")
    return ["inspect", "many.zip"]


@case(".pos of 20 MB")
def _(folder: Path) -> list[str]:
    (folder / "long.pos").write_text(_pos(20_000_000))
    return ["verify", "calibration.json", "hand.csv", "--gnss", "long.pos"]


@case("predict along a .pos of 20 MB")
def _(folder: Path) -> list[str]:
    (folder / "long.pos").write_text(_pos(20_000_000))
    return ["predict", "calibration.json", "--trajectory", "long.pos", "--noise", "noise.json"]


def _pos(size: int) -> str:
    from datetime import datetime, timedelta

    from tests.unit.navigation import test_gnss as gnss

    row = gnss.ROW.format(0.5, 40.0966, -105.1474, 1601.4)
    stamp, rest = row[:23], row[23:]
    start = datetime.strptime(stamp.strip(), "%Y/%m/%d %H:%M:%S.%f")
    made = (
        f"{(start + timedelta(seconds=n / 10)):%Y/%m/%d %H:%M:%S.%f}"[:23] + rest
        for n in range(size // len(row))
    )
    return gnss.HEADER + "".join(made)


@case("simulate rest for 1,000,000 s")
def _(folder: Path) -> list[str]:
    return ["simulate", "rest", "--duration", "1000000", "-o", "made"]


@case("simulate rest for 1e300 s")
def _(folder: Path) -> list[str]:
    return ["simulate", "rest", "--duration", "1e300", "-o", "made"]


for _rate in ("1e300", "1e-300", "nan", "0", "-1"):
    CASES[f"calibrate --rate {_rate}"] = lambda folder, r=_rate: [*_calibrate("hand.csv"), "--rate", r]
    CASES[f"simulate --sample-rate {_rate}"] = lambda folder, r=_rate: [
        "simulate", "rest", "--sample-rate", r, "-o", "made",
    ]  # fmt: skip


def _documents() -> None:
    """Documents that are nested without end, hold numbers without end, halves of characters, keys twice."""
    texts = {
        "nested": "[" * 100_000,
        "nested in an object": '{"a":' * 100_000,
        "a number of 5,000 digits": '{"format": "tumble calibration", "version": ' + "9" * 5000 + "}",
        "half a character": '{"format": "\\ud800"}',
        "a key twice": '{"format": "tumble calibration", "format": "tumble noise"}',
        "truth with numbers for names": '{"format": "tumble truth", "recordings": [5]}',
        "600 MB": "",
    }
    calls = {
        "as calibration": ["apply", "bad.json", "hand.csv"],
        "as prior": ["calibrate", "hand.csv", "--prior", "bad.json", "-o", "made"],
        "as noise": [
            "convert",
            "calibration.json",
            "--to",
            "kalibr",
            "--noise",
            "bad.json",
            "-o",
            "made.yaml",
        ],
        "as noise models": ["predict", "calibration.json", "--trajectory", "rest", "--noise", "bad.json"],
        "as px4 parameters": ["convert", "--from", "px4", "bad.json", "-o", "made.json"],
        "as basalt": ["convert", "--from", "basalt", "bad.json", "-o", "made.json"],
        "as truth": ["simulate", "six-position", "-o", "made"],
    }
    for what, content in texts.items():
        for how, call in calls.items():

            def make(
                folder: Path, content: str = content, call: list[str] = call, how: str = how
            ) -> list[str]:
                place = folder / ("made/truth.json" if how == "as truth" else "bad.json")
                place.parent.mkdir(exist_ok=True)
                if content:
                    place.write_text(content)
                else:
                    with place.open("wb") as file:
                        file.truncate(600 << 20)
                return call

            CASES[f"{what}, {how}"] = make


_documents()


@case("NPZ header {{{")
def _(folder: Path) -> list[str]:
    with zipfile.ZipFile(folder / "bad.npz", "w") as archive:
        archive.writestr("acc.npy", b"\x93NUMPY\x01\x00\x46\x00" + b"{" * 70)
    return ["inspect", "bad.npz"]


@case("NPY of 2**70 rows")
def _(folder: Path) -> list[str]:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({2**70}, 7), }}".ljust(117) + "\n"
    (folder / "bad.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode())
    return ["inspect", "bad.npy"]


@case("one wrong bit in a gzip")
def _(folder: Path) -> list[str]:
    packed = bytearray(gzip.compress((folder / "hand.csv").read_bytes(), mtime=0))
    packed[len(packed) // 2] ^= 8
    (folder / "bad.csv.gz").write_bytes(packed)
    return ["inspect", "bad.csv.gz"]


def _nmea(body: str) -> str:
    check = 0
    for letter in body:
        check ^= ord(letter)
    return f"${body}*{check:02X}\r\n"


for _cell in ("1e1", "x", "!9"):
    for _place in range(1, 15):

        def _make(folder: Path, cell: str = _cell, place: int = _place) -> list[str]:
            from tests.unit.navigation.test_gnss import nmea

            sound = "".join(nmea(second) for second in range(20))
            cells = next(line for line in sound.splitlines() if "GGA" in line)[1:].split("*")[0].split(",")
            cells[place] = cell
            (folder / "track.nmea").write_text(sound + _nmea(",".join(cells)))
            return ["verify", "calibration.json", "hand.csv", "--gnss", "track.nmea"]

        CASES[f"NMEA {_cell} as cell {_place}"] = _make


@case("VectorNav registers with é")
def _(folder: Path) -> list[str]:
    (folder / "vn.txt").write_text("$VNWRG,23,é,0,0,0,1,0,0,0,1,0,0,0*XX\n")
    return ["convert", "--from", "vectornav", "vn.txt", "-o", "made.json"]


@case("header t,t,t,t,t,t,t")
def _(folder: Path) -> list[str]:
    (folder / "t.csv").write_text("t,t,t,t,t,t,t\n" + text(rows()))
    return ["calibrate", "t.csv", "-o", "made"]


for _scale in (1e300, 1e-300, 1e30, 1e12, 1e-30):

    def _make_scaled(folder: Path, scale: float = _scale) -> list[str]:
        body = rows()
        body[:, 1:] *= scale
        (folder / "extreme.csv").write_text(f"{HEADER}\n{text(body)}")
        return ["calibrate", "extreme.csv", "-o", "made"]

    CASES[f"numbers times {_scale:g}"] = _make_scaled


def _mark(name: str, sign: str) -> None:
    def make(folder: Path) -> list[str]:
        (folder / "marked.csv").write_text(f"# a{sign}b\n{HEADER}\n{text(rows())}", encoding="utf-8")
        count = len(rows())
        program = "import json,sys; sys.exit(json.load(sys.stdin)['samples'] != " + str(count) + ")"
        return ["sh:", f'set -o pipefail; tumble inspect marked.csv --json | {sys.executable} -c "{program}"']

    CASES[f"comment with {name}: all rows"] = make


for _words, _sign in (
    ("form feed", "\f"), ("VT", "\v"), ("U+0085", "\x85"), ("U+2028", "\u2028"),
):  # fmt: skip
    _mark(_words, _sign)


@case("name that is no UTF-8")
def _(folder: Path) -> list[str]:
    return ["sh:", "cp hand.csv $'h\\xff.csv'; tumble inspect $'h\\xff.csv'"]


@case("model name that is code")
def _(folder: Path) -> list[str]:
    document = json.loads((folder / "calibration.json").read_text())
    document["imu"] = {"model": "x\nimport pathlib; pathlib.Path('run').touch()\n#", "serial_number": None}
    (folder / "calibration.json").write_text(json.dumps(document))
    return ["convert", "calibration.json", "--to", "python", "-o", "made.py"]


@case("deflate bomb in a MATLAB file")
def _(folder: Path) -> list[str]:
    packed = zlib.compress(bytes(_GIGABYTE), 9)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    (folder / "bomb.mat").write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    return ["inspect", "bomb.mat"]


@case("recording of 10 GB of zeros")
def _(folder: Path) -> list[str]:
    with (folder / "sparse.csv").open("wb") as file:
        file.write(f"{HEADER}\n".encode())
        file.truncate(10 << 30)
    return ["inspect", "sparse.csv"]
