"""What no command can work with: exit status 2 (3 for the disk), one sentence that names it, no file touched."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.cli.program import Bench

STILL = np.arange(3000) % 100


def shaken(_: np.ndarray) -> np.ndarray:
    """Never at rest: 40 s of shaking, as of a unit in a washing machine."""
    rng = np.random.default_rng(1)
    force = [9.81, 0.0, 0.0] + 5.0 * rng.standard_normal((2000, 3))
    return np.column_stack([np.arange(2000) / 50.0, force, 2.0 * rng.standard_normal((2000, 3))])


# What is made of the good recording, by the name of its file.
SPOILED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "constant-time.csv": lambda rows: np.column_stack([np.full(len(rows), 5.0), rows[:, 1:]]),
    "backward-time.csv": lambda rows: np.column_stack([rows[::-1, 0], rows[:, 1:]]),
    "jump-back.csv": lambda rows: rows - np.outer(np.arange(len(rows)) >= 1000, [10.0, *[0.0] * 6]),
    "zeros.csv": lambda rows: rows * [1, 0, 0, 0, 0, 0, 0],
    "in-g.csv": lambda rows: rows / [1, *[9.80665] * 3, 1, 1, 1],
    "in-degrees.csv": lambda rows: rows * [1, 1, 1, 1, *[np.degrees(1.0)] * 3],
    "counts.csv": lambda rows: np.round(rows * [1, *[1000] * 6], 2),
    "swapped-triads.csv": lambda rows: rows[:, [0, 4, 5, 6, 1, 2, 3]],
    "left-handed-gyro.csv": lambda rows: rows * [1, 1, 1, 1, 1, 1, -1],
    "reversed-gyro.csv": lambda rows: rows * [1, 1, 1, 1, -1, -1, -1],
    "swapped-gyro.csv": lambda rows: rows[:, [0, 1, 2, 3, 5, 4, 6]],
    "turned-gyro.csv": lambda rows: rows[:, [0, 1, 2, 3, 5, 6, 4]],
    "left-handed-force.csv": lambda rows: rows * [1, -1, 1, 1, 1, 1, 1],
    "one-pose.csv": lambda rows: np.column_stack([np.arange(3000) / 50.0, rows[STILL, 1:]]),
    "shaken.csv": shaken,
}
STEPS = "version: 1\nprocedure: turntable\nsite: {latitude_deg: 48}\nsteps:\n"
HOLD = "  - hold: first\n    up: z\n    seconds: 8\n    uncertainty_deg: 3\n"
SPIN = "  - spin: there\n    axis: x\n    rate_deg_per_s: 10\n    seconds: 34\n    angle_deg: 360\n"
# Anything else that a call may name.
CONTENTS = {
    "empty.csv": b"",
    "head.csv": b"t,ax,ay,az,gx,gy,gz\n",
    "prose.csv": b"The unit lay on the table,\nand nobody turned it.\n" * 30,
    "binary.csv": np.random.default_rng(1).bytes(5000),
    "two.csv": b"t,ax\n" + b"".join(b"%d,1.5\n" % k for k in range(50)),
    "gyro.csv": b"t,gx,gy,gz\n" + b"".join(b"%d.02,0.1,%d,0.3\n" % (k, k % 3) for k in range(90)),
    "cut.json": b'{"format": "tumble calibration", "version": 1, "acc',
    "bare.json": b'{"format": "tumble calibration", "version": 1}',
    "other.json": b"{}",
    "precious": b"mine",
    "bias.yaml": b"limits: {bias: 1 mg}",
    "short.yaml": f"format: tumble protocol\n{STEPS}{HOLD}{SPIN}{HOLD}".encode(),
    "wobble.yaml": b"table_wobble_arcsec: -1",
    "stops.yaml": b"table_stops_percent: {99: 60}",
    "fixture.yaml": b"fixture_zero_mrad: 1",
    "dip.yaml": b"magnetic_dip_deg: 60",
    "tilt.yaml": b"table_tilt_deg: 1",
}


def refused(tumble: Bench, rows: np.ndarray, call: str, *words: str, status: int = 2) -> None:
    """The call is refused with the files that it names there."""
    for name, make in SPOILED.items():
        if name in call:
            tumble.write(name, make(rows))
    for name, content in CONTENTS.items():
        if name in call:
            (tumble.folder / name).write_bytes(content)
    tumble.refuses(call, *words, status=status)


def table(prefix: str, *rows: tuple[str, ...], suffix: str = "") -> list[object]:
    """Calls that begin and end alike, each with the words of its refusal."""
    return [
        pytest.param(f"{prefix} {row[0]} {suffix}".strip(), row[1:], id=f"{prefix} {row[0]}") for row in rows
    ]


RECORDINGS = table(
    "calibrate",
    ("constant-time.csv", "time column never changes", "--rate"),
    ("backward-time.csv", "line 3", "time steps back"),
    ("jump-back.csv", "line 1002", "19.99 to 10.01", "Split"),
    ("zeros.csv", "all zeros", "switched on"),
    ("in-g.csv --units m/s^2,rad/s", "0.101 times gravity", "--units g"),
    ("tumbled.csv --units g,rad/s", "look like m/s^2: give --units m/s^2"),
    ("tumbled.csv --units m/s^2,deg/s", "looks like rad/s: say so"),
    ("in-degrees.csv --units m/s^2,rad/s", "declared to be in rad/s", "deg/s", "--units"),
    ("swapped-triads.csv", "triads seem exchanged", "--columns"),
    ("left-handed-gyro.csv", "contradict", "gx, gy, -gz", "--columns"),
    ("swapped-gyro.csv", "contradict", "gy, gx, gz", "--columns"),
    ("turned-gyro.csv", "contradict", "gy, gz, gx", "--columns"),
    ("left-handed-force.csv", "contradict", "--columns"),
    ("reversed-gyro.csv", "contradict", "-gx, -gy, -gz"),
    ("one-pose.csv", "determine nothing of the accelerometers", "a hold with z up"),
    ("shaken.csv", "shaken.csv"),
    suffix="--gravity 9.81 -o new",
)
# What is no recording, and what is no calibration, each command refuses alike.
READERS = (
    "calibrate {} -o new",
    "apply calibrated {} -o new.csv",
    "verify calibrated {}",
    "inspect {} --save new.csv",
)
NO_RECORDING = [
    row
    for reader in READERS
    for row in table(
        "",
        (reader.format("empty.csv"), "empty.csv", "is empty"),
        (reader.format("head.csv"), "head.csv", "header but no rows"),
        (reader.format("prose.csv"), "prose.csv", "text without rows"),
        (reader.format("binary.csv"), "binary.csv", "binary"),
        (reader.format("two.csv"), "two.csv", "no ay and az"),
        (reader.format("calibrated"), "is a folder"),
        (reader.format("absent.csv"), "absent.csv", "does not exist"),
    )
]
CALIBRATE = table(
    "calibrate",
    ("tumbled.csv --site here", "--site here", "48.1,520"),
    ("tumbled.csv --site 95", "beyond the poles"),
    ("tumbled.csv --site 48,20000", "height"),
    ("tumbled.csv --gravity 1", "nowhere on the Earth"),
    ("tumbled.csv --gravity nan", "Gravity"),
    ("tumbled.csv --gravity heavy", "--gravity"),
    ("tumbled.csv --site 0 --gravity 9.83", "contradicts"),
    ("tumbled.csv --rate -1", "--rate", "positive"),
    ("tumbled.csv --rate nan", "--rate", "positive"),
    ("tumbled.csv --units furlong", "furlong"),
    ("tumbled.csv --columns t,ax,ay", "--columns"),
    ("tumbled.csv --columns t,ax,ay,az,gx,gy,qq", "qq"),
    ("tumbled.csv --procedure turntable", "turntable", "table", "--protocol", "simulate turntable-9 -o"),
    ("tumbled.csv --procedure laboratory", "laboratory", "table", "--protocol", "simulate laboratory -o"),
    ("tumbled.csv --procedure rate-table", "rate-table", "table", "--protocol"),
    ("tumbled.csv --procedure guess", "no procedure", "hand-held"),
    ("tumbled.csv --procedure strapdown-rotation", "--protocol"),
    ("tumbled.csv --intervals absent.txt", "absent.txt", "list of intervals"),
    ("tumbled.csv --prior absent.json", "no calibration absent.json"),
    ("tumbled.csv --limits bias.yaml", "'bias' is no parameter"),
    ("tumbled.csv --limits none.yaml", "none.yaml"),
    ("absent.csv --monte-carlo 10", "from 1000 to 1000000"),
    ("tumbled.csv --wrong", "No such option", "tumble calibrate --help"),
    suffix="-o new",
)
OTHERS = [
    *table(
        "",
        ("calibrate", "--help"),
        ("calibrate tumbled.csv -o new --gravity", "--gravity", "--help"),
        ("wrong", "--help"),
        ("apply only-one", "--help"),
        ("verify only-one", "--help"),
        ("demo extra", "--help"),
        ("apply absent.json tumbled.csv -o new.csv", "There is no calibration", "absent.json"),
        ("apply cut.json tumbled.csv -o new.csv", "cut.json", "cannot be read as a calibration"),
        ("apply bare.json tumbled.csv -o new.csv", "bare.json", "is damaged"),
        ("apply calibrated counts.csv --units counts -o new.csv", "in counts", r"made for m/s\^2"),
        ("apply calibrated tumbled.csv -o new.xlsx", ".csv or .parquet"),
        ("verify absent.json tumbled.csv", "There is no calibration", "absent.json"),
        ("verify cut.json tumbled.csv", "cut.json", "cannot be read as a calibration"),
        ("verify bare.json tumbled.csv", "bare.json", "is damaged"),
        ("verify calibrated gyro.csv", "accelerometer"),
        ("verify calibrated tumbled.csv --lever-arm 1,2,3", "--lever-arm is for a drive"),
        ("verify calibrated tumbled.csv --gnss none.pos", "none.pos"),
        ("noise tumbled.csv --skip -3", "--skip"),
        ("noise tumbled.csv --fit best", "curve or moments"),
        ("predict none.json", "no calibration"),
        ("predict calibrated --seconds 3600", "at most 600"),
        ("predict calibrated --seconds 0", "at least 0.1"),
        ("predict calibrated --turn-on-bias 1", "--turn-on-bias takes 2 numbers"),
        ("predict calibrated --turn-on-bias=-1,10", "not negative"),
        ("predict calibrated --data-sheet nonsense", "nonsense"),
        ("reproduce hayal-44 -o new", "'hayal-44'", "Did you mean hayal-4.4?", "`tumble reproduce` lists"),
        ("reproduce 4.4 -o new", "Did you mean hayal-4.4?"),
        ("reproduce zzz -o new", "nothing to reproduce", "`tumble reproduce` lists"),
        ("reproduce -o new", "--output goes with an ITEM"),
        ("reproduce hayal-4.2 --repetitions 0", "--repetitions", "0.*from 1 to 100000"),
        ("reproduce hayal-4.2 --repetitions 100001", "--repetitions", "100001.*from 1 to 100000"),
        ("reproduce hayal-4.2 --repetitions many", "--repetitions", "many is no whole number"),
        ("reproduce hayal-4.2 --seed -1", "--seed", "-1.*from 0 on"),
        ("reproduce hayal-4.2 --seed 1.5", "--seed", "1.5 is no whole number"),
        ("batch tumbled.csv --limits none.yaml -o new", "none.yaml"),
        ("batch tumbled.csv --reports some -o new", "some"),
        ("batch nowhere -o new", "nowhere"),
        ("batch s3://me:secret@b/u.csv -o new", "s3://***@b/u.csv: a batch is of files of this machine"),
        ("registry list --registry none.sqlite", "none.sqlite"),
        ("registry add calibrated --registry none.sqlite", "serial"),
        ("registry list --registry postgresql://me:secret@127.0.0.1:1/none", r"\*\*\*"),
        ("registry list --registry mysql://me:secret@host/none", "mysql"),
        ("registry list --due none.yaml --registry none.sqlite", "none"),
        ("registry list --before 2030-01-01 --registry none.sqlite", "none|--due"),
        ("certificate", "--help"),
        ("certificate calibrated --language xx -o a.pdf", "xx"),
        ("certificate calibrated --date today -o a.pdf", "today"),
        ("certificate calibrated --profile none.yaml -o a.pdf", "none.yaml"),
        ("certificate calibrated --date today -o a.xml", "today"),
    ),
    *table(
        "simulate",
        ("sixposition", "no protocol 'sixposition': give a protocol file", "Did you mean six-position?"),
        ("six-position --imu HG170", "no IMU grade 'HG170'", "ring-laser", "Did you mean hg1700?"),
        ("nowhere.yaml", "There is no protocol file", "nowhere.yaml"),
        ("six-position --seed 1.5", "--seed 1.5 is no whole number"),
        ("six-position --gravity abc", "Gravity of 'abc' is no number", "9.80788±0.00002"),
        ("six-position --errors none.yaml", "no file of errors none.yaml"),
        ("six-position --site 95", "beyond the poles"),
        ("six-position --duration 60", "--duration is for a unit at rest"),
        ("rest --duration 0", "at least one second"),
        ("res", "Did you mean rest?"),
        ("six-position --turn-on-bias=-1,60", "--turn-on-bias takes two numbers that are not negative"),
        ("turntable-9 --errors wobble.yaml", "a number from 0 to 36000"),
        ("turntable-9 --errors stops.yaml", "stop spin 99 early, and the protocol's last one is number 12"),
        ("six-position --errors fixture.yaml", "six-position has no sequence of rotations"),
        ("six-position --errors dip.yaml", "give --magnetometer"),
        ("thermal-soak --errors tilt.yaml", "no table in this chamber"),
        suffix="-o new",
    ),
]
PLAN = [
    *table(
        "plan",
        ("turntabel-9", "turntabel-9", "Did you mean turntable-9?"),
        ("turntable", "strapdown-rotation", "multi-position"),
        ("thermal-soak", "temperature", "multi-position-9"),
        ("short.yaml --poses 9", "--poses", "a protocol as it is"),
        ("short.yaml --hold 9", "--hold", "leave it out"),
        ("short.yaml --no-steps", "--no-steps has left"),
        ("short.yaml --protocol short.yaml", "--given"),
        ("short.yaml --given no.csv", "no such file"),
        ("short.yaml --targets gyro-bias=0", "--targets", "gyro-bias in °/h"),
        ("short.yaml --noise other.json", "--noise", "no noise document"),
        ("short.yaml --imu tactcal", "tactical"),
        ("short.yaml --data-sheet nobody", "nobody"),
        ("short.yaml --seed -1", "--seed"),
        ("multi-position --protocol short.yaml", "--protocol", "multi-position"),
        ("six-position --poses 9", "six faces"),
    ),
    *table(
        "plan multi-position --imu tactical --site 48.1",
        ("--poses 8", "8 poses determine 8 numbers", "9 poses or more"),
        ("--poses 0", "--poses 0"),
        ("--poses 9 --time 5", "not both"),
        ("--time 0.5", "too short for the 9 poses"),
        ("--time 5 --hold 9", "leave --hold out"),
        ("--targets bias=-3", "--targets"),
        ("--given none.csv", "no such file"),
        ("--data-sheet tactcal", "tactical"),
        ("--turn-seconds 0", "--turn-seconds 0"),
        ("--reach sphere", "--reach has left"),
        ("--set criterion=D", "--criterion has left"),
    ),
]
CONVERT = [
    *table(
        "convert calibrated/calibration.json",
        ("", "--from TARGET"),
        ("--frame accelerometer-x --units g", "about reading"),
        ("--to kalibur", "kalibur", "choose one of"),
        ("--to px4 --from px4", "exclude"),
        ("--to px4 --largest-loss 10", "ppm", "--largest-loss"),
        ("--to px4 --noise n.json", "holds no noise"),
        ("--to kalibr --noise n.json", "no noise file n.json"),
        ("--to kalibr --noise calibrated/calibration.json", "no noise.json"),
        ("--to kalibr --frame accelerometer-z", "only be in the frame"),
        ("--to kalibr --consumer-rate 2", "--noise"),
        ("--to imu-tk --largest-loss nan -o new", "--largest-loss"),
        ("--to imu-tk --largest-loss -1 -o new", "--largest-loss"),
        ("--to imu-tk --consumer-rate 0 -o new", "--consumer-rate"),
        ("--frame sideways", "sideways"),
        ("--frame x --ros-topic y", "--ros-topic goes"),
        ("--from c", "written only", "imu-tk takes any matrix"),
        ("--from kalibr", "imu0"),
    ),
    *table(
        "",
        ("convert --to kalibr", "calibration.json first"),
        ("convert --from kalibr", "Name the file"),
        ("convert nowhere.yaml --from kalibr", "no Kalibr file nowhere.yaml"),
        ("diff calibrated calibrated --allowed few", "2 numbers"),
    ),
]
# No command writes over its inputs, nor replaces a device, a pipe or a folder by a file.
OUTPUTS = table(
    "",
    ("apply tumbled.csv tumbled.csv -o tumbled.csv", "tumbled.csv"),
    ("apply calibrated tumbled.csv -o tumbled.csv", "tumbled.csv"),
    ("predict calibrated/calibration.json -o calibrated/calibration.json", "one of the inputs"),
    (
        "convert calibrated/calibration.json --frame accelerometer-z -o calibrated/calibration.json",
        "one of the inputs",
    ),
    ("convert calibrated/calibration.json --to yaml -o calibrated/calibration.json", "one of the inputs"),
    ("inspect tumbled.csv --save tumbled.csv", "tumbled.csv"),
    ("noise tumbled.csv -o tumbled.csv", "is one of the inputs"),
    ("calibrate tumbled.csv --prior calibrated -o calibrated", "calibrated"),
    ("plan short.yaml -o precious", "is a file"),
    ("plan multi-position -o precious", "is a file"),
    ("calibrate tumbled.csv --gravity 9.81 -o precious", "is a file: give a folder"),
    ("simulate six-position --sample-rate 5 -o precious", "is a file: give a folder"),
    ("predict calibrated -o precious", "is a file: give a folder"),
    ("apply calibrated tumbled.csv -o precious", "is a file: give a folder"),
)


@pytest.mark.parametrize(
    ("call", "words"), [*RECORDINGS, *NO_RECORDING, *CALIBRATE, *OTHERS, *PLAN, *CONVERT, *OUTPUTS]
)
def test_wrong_input_is_one_sentence_and_touches_no_file(tumble, rows, call, words):
    refused(tumble, rows, call, *words)


@pytest.mark.parametrize(
    ("call", "words"),
    table(
        "",
        ("demo -o /proc/tumble", "/proc/tumble cannot be made or written to"),
        (
            "calibrate tumbled.csv --gravity 9.81 -o precious/new",
            "precious/new cannot be made: .*precious is no",
        ),
        (
            "simulate six-position --sample-rate 5 -o precious/new",
            "precious/new cannot be made: .*precious is no",
        ),
        ("predict calibrated -o precious/new", "precious/new cannot be made: .*precious is no"),
        ("apply calibrated tumbled.csv -o precious/new", "precious/new cannot be made: .*precious is no"),
        ("apply calibrated tumbled.csv -o absent/new.csv", "does not exist"),
        ("inspect tumbled.csv --save absent/new.csv", "does not exist"),
        ("apply calibrated tumbled.csv -o absent/new.parquet", "does not exist"),
        ("apply calibrated tumbled.csv -o precious/new.csv", "could not be written"),
        ("apply calibrated tumbled.csv -o precious/new.parquet", "could not be written"),
    ),
)
def test_what_cannot_be_written_is_one_sentence(tumble, rows, call, words):
    refused(tumble, rows, call, *words, status=3)


@pytest.mark.parametrize("place", ["/dev/null", "pipe.csv"])
@pytest.mark.parametrize(
    "call",
    [
        "mount tumbled.csv tumbled.csv -c calibrated",
        "convert calibrated/calibration.json --frame accelerometer-z",
        "apply calibrated tumbled.csv",
        "plan strapdown-rotation",
        "simulate six-position",
        "noise tumbled.csv",
    ],
)
def test_no_command_replaces_a_device_or_a_pipe(tumble: Bench, call: str, place: str) -> None:
    os.mkfifo(tumble.folder / "pipe.csv")
    before = (tumble.folder / place).lstat()
    tumble.refuses(f"{call} -o {place}", "is a (device|pipe|file)")
    after = (tumble.folder / place).lstat()
    assert (after.st_mode, after.st_ino) == (before.st_mode, before.st_ino)


def test_a_folder_without_permission(tumble: Bench) -> None:
    folder = tumble.folder / "calibrated"
    folder.chmod(0o555)
    try:
        if os.access(folder, os.W_OK):
            pytest.skip("this user may write anywhere (root): permissions stop nothing")
        tumble.refuses("calibrate tumbled.csv --gravity 9.81 -o calibrated", "made or written to", status=3)
    finally:
        folder.chmod(0o755)


@pytest.mark.parametrize("packed", [True, False])
def test_without_a_temporary_folder_only_what_has_to_be_unpacked_is_refused(
    tumble, rows, monkeypatch, packed
):
    import gzip
    import io
    import tempfile

    made = io.BytesIO()
    np.save(made, rows)
    (tumble.folder / "packed.npy.gz").write_bytes(gzip.compress(made.getvalue()))
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(Path("absent").resolve())])
    if packed:
        tumble.refuses("inspect packed.npy.gz", "temporary folder", status=3)
    else:
        tumble("inspect tumbled.csv")
