"""The runs that the net holds: each is a list of command lines, in a folder of its own."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "tests" / "reference"

Step = str | Callable[[], object]

RUNS: dict[str, list[Step]] = {}

# Targets that hold a calibration, targets of noise alone, and targets that are written only.
TARGETS = (
    "kalibr", "openvins", "imu-tk", "openicc", "px4", "ardupilot", "c", "cpp", "python", "basalt", "kf-gins",
    "fusion", "vectornav", "matlab", "imucal", "realsense", "ikalibr",
)  # fmt: skip
NOISE_TARGETS = ("kalibr-noise", "ros", "vins", "okvis", "svo")
NOT_READ = ("c", "cpp", "python", "kf-gins")


def _protocol(name: str, rate: float, consumer: str = "oj", sheet: str = "oj", grade: str = "hg1700") -> None:
    """Hold a named protocol at two grades: o its own procedure, j the joint one."""
    grades = (("consumer-mems", "", consumer), (grade, "--site 46.5", sheet))
    for imu, options, procedures in grades:
        if not procedures:
            continue
        steps: list[Step] = [f"simulate {name} --imu {imu} {options} --seed 7 --rate {rate:g} -o made"]
        if "o" in procedures:
            steps.append("calibrate --protocol made/protocol.yaml -o own")
        if "j" in procedures:
            steps.append("calibrate --protocol made/protocol.yaml --procedure joint -o joint")
        RUNS[f"{name}-{imu}"] = steps


_protocol("six-position", 20)
_protocol("multi-position-26", 20)
_protocol("multi-position-18", 20, sheet="")
_protocol("multi-position-10", 20, consumer="", sheet="o")
_protocol("multi-position-9", 20)
_protocol("rate-table", 20, "o", "o")
_protocol("modified-multi-position", 20, sheet="oj", grade="tactical")
_protocol("turntable-9", 10, "o", "o", grade="tactical")
_protocol("laboratory", 10, "o", "oj")
_protocol("strapdown-rotation", 20, grade="ring-laser")
_protocol("thermal-soak", 2)
_protocol("thermal-ramp", 2)
# Its joint run is refused, and round-off decides which of many combinations is named.
_protocol("thermal-fridge", 10, "o", "o")
_protocol("hand-held", 50, grade="industrial-mems")


def _copy(*names: str) -> Callable[[], None]:
    def copy() -> None:
        for name in names:
            shutil.copy(REFERENCE / name, Path(name).name)

    return copy


def _unpack(*names: str) -> Callable[[], None]:
    import gzip

    def unpack() -> None:
        for name in names:
            Path(Path(name).stem).write_bytes(gzip.decompress((REFERENCE / name).read_bytes()))

    return unpack


def _one_rate() -> None:
    """Leave of the rate table's protocol the holds and spins at 50 °/s."""
    head, steps = Path("table/protocol.yaml").read_text(encoding="utf-8").split("steps:\n")
    items = ["  - " + item for item in re.split(r"^  - ", steps, flags=re.M)[1:]]
    kept = [k for k, item in enumerate(items) if re.search(r"rate_deg_per_s: -?50\b", item)]
    chosen = sorted({*kept, *(k - 1 for k in kept)})
    head = re.sub(r"recordings:\n(  - .*\n)+(units:.*\n)?", "", head)
    Path("short.yaml").write_text(head + "steps:\n" + "".join(items[k] for k in chosen), encoding="utf-8")


RUNS["rate-table-joint"] = [
    "simulate rate-table --imu industrial-mems --seed 7 --rate 20 --site 46.5 -o table",
    _one_rate,
    "simulate short.yaml --imu industrial-mems --seed 7 --rate 20 --site 46.5 -o made",
    "calibrate --protocol made/protocol.yaml -o own",
    "calibrate --protocol made/protocol.yaml --procedure joint -o joint",
]

# Real recordings.
RUNS["demo"] = ["demo -o demo"]
RUNS["mpu9150"] = [
    _copy("mpu9150/imu1.log.gz", "mpu9150/imu0-first-16-s.log"),
    "inspect imu1.log.gz --rate 100 -v",
    "calibrate imu1.log.gz --rate 100 --gravity 9.8155 -o own",
    "calibrate imu1.log.gz --rate 100 --gravity 9.8155 --procedure joint -o joint",
    "calibrate imu1.log.gz --rate 100 --gravity 9.8155 --no-optional-terms --prior own -o prior",
    "verify own imu1.log.gz --rate 100",
    "calibrate imu0-first-16-s.log --rate 100 --gravity 9.8155 -o short",
    "inspect imu0-first-16-s.log --rate 100 --json",
]
RUNS["xsens"] = [
    _copy("xsens_mti_hand/xsens_acc.txt.gz", "xsens_mti_hand/xsens_gyro.txt.gz"),
    "inspect xsens_acc.txt.gz xsens_gyro.txt.gz --json",
    "calibrate xsens_acc.txt.gz xsens_gyro.txt.gz --gravity 9.81744 -o own",
    "calibrate xsens_acc.txt.gz xsens_gyro.txt.gz --gravity 9.81744 --procedure joint -o joint",
]
RUNS["drive"] = [
    _unpack("drive_rtk/imu.csv.gz", "drive_rtk/track.pos.gz"),
    _copy("drive_rtk/calibration.json"),
    "verify calibration.json imu.csv --gnss track.pos --units g,deg/s,ms --outages 2 --turn-on 0,0 -o judged",
    "predict calibration.json --trajectory track.pos --seconds 20 -o states",
]

# Options of calibrate.
_TWENTY_SIX = "simulate multi-position-26 --imu tactical --site 46.5 --seed 11 --rate 20"
_HAND = "simulate hand-held --gravity 9.81 --rate 50"
RUNS["multi-position-options"] = [
    f"{_TWENTY_SIX} -o made",
    "calibrate --protocol made/protocol.yaml --procedure multi-position --unknowns 6 -o six",
    "calibrate --protocol made/protocol.yaml --procedure multi-position --unknowns 3 --no-noise-correction -o three",
    "calibrate made/recording.csv --columns t,ax,ay,az,-,-,- --procedure multi-position --site 46.5 -o forces",
    "calibrate made/recording.csv --columns t,-,-,-,gx,gy,gz --procedure multi-position --site 46.5 -o rates",
    "calibrate made/recording.csv --procedure multi-position --site 46.5 --data-sheet tactical --json -o believed",
    "calibrate made/recording.csv --procedure multi-position --site 46.5 --imu-model HG --imu-serial 7 -q -o named",
]
RUNS["six-position-improved"] = [
    "simulate six-position --imu tactical --site 46.5 --seed 5 --rate 20 -o made",
    "calibrate --protocol made/protocol.yaml --procedure improved-six-position -o improved",
    "calibrate made/recording.csv --protocol six-position --procedure six-position --site 46.5 -v -o named",
    "calibrate made/recording.csv --procedure multi-position --site 46.5 --data-sheet tactical -o sheet",
    "calibrate made/recording.csv --procedure multi-position --site 46.5 -o refused",
]
RUNS["prior"] = [
    f"{_HAND} --seed 3 --unit 100 -o first",
    "calibrate first/recording.csv --gravity 9.81 -o earlier",
    "simulate six-position --gravity 9.81 --rate 50 --seed 4 --unit 100 -o second",
    "calibrate second/recording.csv --gravity 9.81 --prior earlier -o own",
    "calibrate second/recording.csv --gravity 9.81 --prior earlier --procedure joint -o joint",
    "diff earlier own --allowed 500,20",
]
RUNS["turn-ons"] = [
    f"{_HAND} --seed 3 --unit 100 --turn-on 5,100 -o first",
    f"{_HAND} --seed 4 --unit 100 --turn-on 5,100 -o second",
    "calibrate first/recording.csv second/recording.csv --turn-ons --gravity 9.81 -o both",
]
RUNS["array"] = [
    f"{_HAND} --seed 3 --unit 100 -o left",
    # Another rate: the same motion, other noise.
    "simulate hand-held --gravity 9.81 --rate 40 --seed 3 --unit 101 -o right",
    "calibrate left/recording.csv right/recording.csv --array --no-optional-terms --gravity 9.81 -o both",
]
RUNS["noise"] = [
    "simulate rest --imu industrial-mems --seed 2 --rate 50 --duration 600 -o rest",
    "noise rest/recording.csv -o noise",
    "noise rest/recording.csv --kind hadamard --taus octave --fit moments --json",
    f"{_HAND} --imu industrial-mems --seed 3 -o hand",
    "calibrate hand/recording.csv --gravity 9.81 --noise noise/noise.json -o own",
    (
        "calibrate hand/recording.csv --gravity 9.81 --noise noise/noise.json --procedure joint"
        " --monte-carlo 1000 -o joint"
    ),
    "denoise rest/recording.csv -o quiet.csv",
    "denoise rest/recording.csv --method ar -o level.csv --json",
    "predict own --seconds 10 --seconds 60 --data-sheet industrial-mems",
    "predict own --trajectory cart --seconds 60 --noise noise/noise.json --turn-on 1,30 -o states",
    *(f"convert own --to {target} --noise noise/noise.json -o {target}" for target in NOISE_TARGETS),
]
RUNS["counts"] = [
    "simulate hand-held --gravity 9.81 --rate 50 --seed 9 --units counts --nonlinear --asymmetry-ppm 200 -o made",
    "inspect made/recording.csv",
    "calibrate --protocol made/protocol.yaml -v -o own",
    "calibrate --protocol made/protocol.yaml --procedure joint -v -o joint",
]
RUNS["per-step"] = [
    "simulate modified-multi-position --site 46.5 --seed 8 --rate 20 --per-step --wander -o made",
    "calibrate --protocol made/protocol.yaml -o own",
]

# What is done with a calibration.
_MADE: list[Step] = [
    f"{_HAND} --seed 3 --unit 100 -o made",
    "calibrate made/recording.csv --gravity 9.81 -o own",
]
RUNS["convert"] = [
    *_MADE,
    "convert",
    "convert --json",
    *(f"convert own --to {target} --largest-loss 60000 -o out/{target}" for target in TARGETS),
    "convert own --frame accelerometer-z -o z.json",
    "convert own --to px4",
    "convert own --to nothing",
]
RUNS["convert-back"] = [
    *_MADE,
    *(
        step
        for target in TARGETS
        if target not in NOT_READ
        for step in (
            f"convert own --to {target} --largest-loss 60000 -o out/{target}",
            f"convert out/{target} --from {target} -o back-{target}.json",
        )
    ),
]
RUNS["algebra"] = [
    *_MADE,
    f"{_HAND} --seed 4 --unit 100 -o later",
    "apply own later/recording.csv -o corrected.csv",
    "calibrate corrected.csv --gravity 9.81 -o second",
    "compose own second -o both.json",
    "compose own second --merge -o one.json",
    "invert one.json -o undone.json",
    # Of two recordings: between a calibration and itself merged with another the uncertainty is round-off.
    "calibrate later/recording.csv --gravity 9.81 -o other",
    "diff own other",
    "diff own other --json",
    "verify own later/recording.csv",
    "verify one.json later/recording.csv --json",
    "apply own corrected.csv -o twice.csv",
]
RUNS["mount"] = [
    *_MADE,
    "simulate level.yaml --gravity 9.81 --rate 50 --unit 100 --seed 1 -o level",
    "simulate pitched.yaml --gravity 9.81 --rate 50 --unit 100 --seed 2 -o pitched",
    "mount level/recording.csv pitched/recording.csv -c own --mount-mrad 1 -o mount.json",
]
RUNS["thermal-applied"] = [
    "simulate thermal-fridge --imu industrial-mems --seed 6 --rate 10 -o made",
    "calibrate --protocol made/protocol.yaml -o own",
    "apply own made/recording.csv -o corrected.csv",
    "convert own --to px4 --largest-loss 60000 -o px4",
    "convert own --to c -o c --temperature 20",
    "verify own made/recording.csv --outside hold",
]


def _rest(name: str, up: str) -> Callable[[], None]:
    text = (
        "format: tumble protocol\nversion: 1\nname: rest\nprocedure: hand-held\ndescription: one pose\n"
        "gravity: 9.81\n"
        f"steps:\n  - hold: {up} up\n    up: {up}\n    seconds: 10\n"
    )
    return lambda: Path(name).write_text(text, encoding="utf-8") and None


RUNS["mount"][2:2] = [_rest("level.yaml", "z"), _rest("pitched.yaml", "x")]

# Plans, and what needs no recording.
RUNS["plan-poses"] = [
    "plan multi-position --imu tactical --site 48.1 --poses 12 --hold 8 -o made",
    "plan multi-position --imu ring-laser --time 4 --criterion D --json",
    # Neither a search by hand nor on two axes: of equally good sets round-off takes one.
    "plan six-position --imu hg1700",
]
RUNS["plan-protocols"] = [
    "plan six-position --imu tactical --data-sheet tactical --fixture-mrad 2",
    "plan turntable-9 --imu tactical --site 48.1 --no-steps -o table",
    "plan multi-position-26 --imu consumer-mems --no-steps -v",
    "plan strapdown-rotation --imu ring-laser --fixture-mrad 1.75 --site 48.1 -o budget.json",
]
RUNS["plan-joint"] = [
    "simulate multi-position-9 --imu tactical --site 48 --seed 2 --rate 20 -o made",
    "plan multi-position-9 --imu tactical --site 48 --no-steps -o judged",
    (
        "plan multi-position-9 --imu tactical --site 48 --given made/recording.csv --no-steps -q"
        " --targets bias=50,scale=100"
    ),
    "plan multi-position --imu tactical --site 48 --given made/recording.csv",
]
RUNS["reproduce"] = [
    "reproduce",
    "reproduce zhang-sensitivity",
    "reproduce savage-12 --json",
    "reproduce zhang-6 --repetitions 50",
    "reproduce savage-contradictions",
    "reproduce hayal-contradictions",
]
RUNS["words"] = [
    "--help",
    "calibrate --help",
    "plan --help",
    "simulate --help",
    "units explain 0.3 deg/√h",
    "units explain 60 ug/sqrt(Hz) --rate 200",
    "units explain 0.004 imu_utils:gyr_n --rate 200 --json",
    "calibrate",
    "calibrate nowhere.csv",
    "calibrate nowhere.csv --procedure none",
    "simulate none",
    "nothing",
]


def _front() -> dict[str, object]:
    """Walk through the public names of the package."""
    import tumble

    made = tumble.simulate(
        "hand-held", output="made", seed=12, rate=50.0, site=tumble.Site.from_gravity(9.81)
    )
    recording = tumble.read_recording("made/recording.csv")
    timeline = tumble.find_timeline(recording)
    run = tumble.calibrate("made/recording.csv", output="own", site=tumble.Site.from_gravity(9.81))
    calibration = tumble.read_calibration("own/calibration.json")
    applied = tumble.apply(calibration, "made/recording.csv", output="corrected.csv")
    judged = tumble.verify("own", "made/recording.csv")
    converted = tumble.convert_to("own", "imu-tk", output="imu-tk")
    noise = tumble.analyse_noise("made/recording.csv", output="noise")
    return {
        "names": sorted(tumble.__all__),
        "kinds": [type(one).__name__ for one in (made, run, calibration, applied, judged, converted, noise)],
        "same": run.calibration == calibration,
        "holds": [[hold.start, hold.stop] for hold in timeline.holds] if hasattr(timeline, "holds") else None,
        "matrix": calibration.accelerometer.matrix,
        "bias": calibration.accelerometer.bias,
    }


RUNS["front"] = [_front]
