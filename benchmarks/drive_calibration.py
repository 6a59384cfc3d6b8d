"""A real drive cut in two: a calibration from its first part, and a second part to verify it on.

    python benchmarks/drive_calibration.py FOLDER OUT
    tumble verify OUT/calibration.json OUT/imu.csv --gnss OUT/track.pos --units g,deg/s,ms

FOLDER holds the car drive of rtklibexplorer/GNSS_IMU: imu_1934.csv and gnss_1934_sf.pos. The calibration is what the
filter's states of the sensors are at the end of the first part, with their covariance.
"""

from __future__ import annotations

import argparse
import json
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import tumble
from tumble.document.result import (
    FORMAT,
    Calibration,
    FrameBlock,
    QualityBlock,
    RawUnits,
    RecordingName,
    SiteBlock,
    TriadBlock,
    VerdictBlock,
)
from tumble.earth import EARTH_RATE, normal_gravity
from tumble.navigation import InertialSamples, TriadSpread, plan_filter, prepare_drive, read_track, run_filter
from tumble.noise.terms import NoiseModel
from tumble.recording import read_recordings
from tumble.units import angular_rate_factor, specific_force_factor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--split", type=float, default=250.0, help="s after the first sample")
    parser.add_argument("--length", type=float, default=1e9, help="s of the second part")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    recording = read_recordings(asked.folder / "imu_1934.csv", units="g,deg/s,ms")[0]
    samples = InertialSamples.from_recording(recording)
    track = read_track(asked.folder / "gnss_1934_sf.pos")
    setup = plan_filter(
        NoiseModel(random_walk=0.03, rate_random_walk=1e-3),
        (
            NoiseModel(random_walk=0.002, rate_random_walk=1e-5),
            NoiseModel(random_walk=0.006, rate_random_walk=1e-5),
            NoiseModel(random_walk=0.001, rate_random_walk=1e-5),
        ),
        accelerometer=TriadSpread(bias=0.2, scale_factor=0.01, misalignment=0.01),
        gyroscope=TriadSpread(bias=0.01, scale_factor=0.01, misalignment=0.01),
    )
    whole = prepare_drive(samples, track, setup=setup)
    split = float(samples.time[0]) + asked.split
    first = whole.track.rows(whole.track.time < split)
    run = run_filter(
        samples.between(float(samples.time[0]), split),
        first,
        whole.start,
        whole.setup(setup),
        keep_covariances=True,
    )
    document = composed(
        setup,
        run.sensors[-1],
        run.covariances[-1][9:, 9:],
        whole.start.latitude,
        whole.start.height,
        recording,
    )
    (asked.out / "calibration.json").write_text(json.dumps(document.model_dump(mode="json"), indent=1) + "\n")
    stop = split + asked.length
    lines = (asked.folder / "imu_1934.csv").read_text().splitlines()
    stamps = [line.split(",") for line in lines]
    kept = [",".join(row) for row in stamps if len(row) == 7 and split <= float(row[6] or 0) * 1e-3 <= stop]
    (asked.out / "imu.csv").write_text("ax,ay,az,gx,gy,gz,t\n" + "\n".join(kept) + "\n")
    text = (asked.folder / "gnss_1934_sf.pos").read_text().splitlines()
    header = [line for line in text if line.startswith("%")]
    rows = [line for line in text if line and not line.startswith("%")]
    inside = (whole.track.time >= split) & (whole.track.time <= stop)
    assert len(rows) == len(inside)
    chosen = [" ".join(row.split()) for row, good in zip(rows, inside, strict=True) if good]
    (asked.out / "track.pos").write_text("\n".join([*header, *chosen]) + "\n")
    print(whole.clock)
    print(f"{len(kept)} samples and {len(chosen)} positions after {asked.split:g} s")


def composed(setup, estimates, covariance, latitude, height, recording) -> Calibration:
    """The document: raw = matrix true + bias, of states E and bias of samples in SI."""
    factors = {
        "accelerometer": 1.0 / specific_force_factor(recording.specific_force_unit),
        "gyroscope": 1.0 / angular_rate_factor(recording.angular_rate_unit),
    }
    matrix = {kind: factor * np.eye(3) for kind, factor in factors.items()}
    bias = {kind: np.zeros(3) for kind in factors}
    names, scale = [], []
    for state, value in zip(setup.states, estimates, strict=True):
        factor = factors[state.kind]
        if state.column < 0:
            bias[state.kind][state.row] += factor * value
            names.append(f"{state.kind}.bias[{state.row}]")
        else:
            matrix[state.kind][state.row, state.column] += factor * value
            names.append(f"{state.kind}.matrix[{state.row},{state.column}]")
        scale.append(factor)
    blocks = {kind: TriadBlock(matrix=matrix[kind].tolist(), bias=bias[kind].tolist()) for kind in factors}
    gravity = float(normal_gravity(latitude, height))
    return Calibration(
        format=FORMAT,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {tumble.__version__}, benchmarks/drive_calibration.py",
        procedure="a drive with satellite positions",
        recordings=[RecordingName(name="imu_1934.csv, first part", sha256="0" * 64)],
        site=SiteBlock(
            latitude_deg=float(np.degrees(latitude)),
            height_m=height,
            gravity=gravity,
            gravity_standard_uncertainty=5e-4,
            gravity_source="normal gravity of WGS 84",
            earth_rate=EARTH_RATE,
        ),
        frame=FrameBlock(
            name="data sheet", description="the filter's: between the sensing axes, near the data sheet's"
        ),
        not_determined=[],
        raw_units=RawUnits(
            specific_force=recording.specific_force_unit, angular_rate=recording.angular_rate_unit
        ),
        accelerometer=blocks["accelerometer"],
        gyroscope=blocks["gyroscope"],
        parameters=[],
        covariance_parameters=names,
        covariance=(covariance * np.outer(scale, scale)).tolist(),
        quality=QualityBlock(
            sigma0=None,
            sigma0_with_variance_components=None,
            degrees_of_freedom=0,
            largest_normalised_residual=0.0,
            coverage_factor=2.0,
            rms_hold_norm=None,
            rms_turn_angle=None,
            holds=0,
            turns=0,
            variance_components={},
            left_out=[],
            optional_terms=[],
        ),
        verdict=VerdictBlock(fit=True, reasons=["From the first part of a drive."]),
        test_vectors=[],
    )


if __name__ == "__main__":
    main()
