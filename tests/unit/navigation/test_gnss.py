"""Tracks of satellite positions: every kind of file says the same, and impossible ones are refused in words."""

from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from tumble.errors import RecordingError
from tumble.navigation.gnss import gps_from_unix, gps_from_utc, leap_seconds, make_track, read_track
from tumble.navigation.gnss.time_scales import seconds_of_date

# 8 July 2025, 19:34:18 GPS time, is second 243,258 of week 2374.
WEEK, SECOND = 2374, 243_258.0
GPS = WEEK * 604_800.0 + SECOND
LATITUDE, LONGITUDE, HEIGHT = 40.0966268, -105.1474483, 1601.474
HEADER = (
    "%  GPST            latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) "
    "age(s) ratio vn(m/s) ve(m/s) vu(m/s)\n"
)
ROW = "2025/07/08 19:34:{:06.3f} {} {} {} 1 21 0.010 0.020 0.030 -0.005 0.004 0.0 0.0 9.9 1.5 -2.5 0.25\n"
# A message of a u-blox receiver, which may stand between sentences.
UBX = b"\xb5\x62\x0a\x04\x00\x00\x0e\x34"


def sentence(body: str) -> str:
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode(), 0):02X}\r\n"


def nmea(second: int = 0, day: str = "080725", hour: str = "19") -> str:
    # UTC is 18 s behind: 19:34:18 GPS time is 19:34:00 UTC
    clock = f"{hour}34{second:02d}.00"
    return (
        sentence(f"GNRMC,{clock},A,4005.797608,N,10508.846898,W,5.6682,300.9638,{day},,,R")
        + sentence(f"GNGGA,{clock},4005.797608,N,10508.846898,W,4,21,0.6,1618.474,M,-17.000,M,1.0,0000")
        + sentence(f"GNGST,{clock},0.5,0.02,0.01,45.0,0.010,0.020,0.030")
    )


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def files(folder: Path) -> dict[str, Path]:
    place = f"{LATITUDE};{LONGITUDE};{HEIGHT}"
    rows = "".join(ROW.format(18.0 + k, LATITUDE, LONGITUDE, HEIGHT) for k in range(3))
    csv = "utc;Latitude [deg];Longitude [deg];Height [m];sdn;sde;sdu;vn;ve;vd\n"
    csv += "".join(f"2025-07-08T19:34:{k:02d}Z;{place};0.01;0.02;0.03;1.5;-2.5;-0.25\n" for k in range(3))
    week = "week;tow;lat;lon;h;hacc;vn;ve;vd\n"
    week += "".join(f"{WEEK};{SECOND + k};{place};0.02;1.5;-2.5;-0.25\n" for k in range(3))
    return {
        "rtklib": write(folder, "a.pos", HEADER + rows),
        "nmea": write(folder, "a.nmea", UBX + "".join(nmea(k) for k in range(3)).encode()),
        "csv": write(folder, "a.csv", csv),
        "week": write(folder, "b.csv", week.replace(";", ",")),
    }


@pytest.mark.parametrize("kind", ["rtklib", "nmea", "csv", "week"])
def test_every_kind_of_file_tells_the_same_fix(kind: str, tmp_path: Path) -> None:
    track = read_track(files(tmp_path)[kind])
    assert len(track) == 3
    assert track.time == pytest.approx(GPS + np.arange(3.0), abs=1e-3)
    assert np.degrees(track.latitude) == pytest.approx(np.full(3, LATITUDE), abs=1e-7)
    assert np.degrees(track.longitude) == pytest.approx(np.full(3, LONGITUDE), abs=1e-7)
    assert track.height == pytest.approx(np.full(3, HEIGHT), abs=2e-3)
    assert track.velocity_n[:, :2] == pytest.approx(np.tile([1.5, -2.5], (3, 1)), abs=1e-3)
    assert track.remarks[0].kind == "found"
    if kind not in ("nmea",):
        assert track.velocity_n[:, 2] == pytest.approx(np.full(3, -0.25))
    if kind in ("rtklib", "nmea"):
        assert list(track.quality) == [1, 1, 1]
    if kind == "rtklib":
        # signed roots of covariances; those with up change their sign towards down
        expected = np.array([[1e-4, -2.5e-5, 0.0], [-2.5e-5, 4e-4, -1.6e-5], [0.0, -1.6e-5, 9e-4]])
        assert track.position_covariance_n[0] == pytest.approx(expected)
    elif kind in ("nmea", "csv"):
        assert np.sqrt(np.diag(track.position_covariance_n[1])) == pytest.approx([0.01, 0.02, 0.03])


def test_leap_seconds_are_those_of_the_date() -> None:
    assert leap_seconds(seconds_of_date("2016-12-31 23:59:59")) == 17
    assert leap_seconds(seconds_of_date("2017-01-01 00:00:00")) == 18
    assert leap_seconds(seconds_of_date("1981-06-30 00:00:00")) == 0
    assert gps_from_utc(seconds_of_date("2025-07-08 19:34:00")) == GPS
    # POSIX time of 8 July 2025, 19:34:00 UTC
    assert gps_from_unix(1_752_003_240.0) == GPS


def test_nmea_runs_on_past_midnight(tmp_path: Path) -> None:
    text = nmea(59, "080725", "23").replace("233459", "235959")
    fixed = "".join(sentence(line[1:].partition("*")[0]) for line in text.split("\r\n") if line)
    before = read_track(write(tmp_path, "a.nmea", fixed)).time[0]
    # GGA of the new day comes before the RMC that tells its date
    late = sentence("GNGGA,000000.00,4005.797608,N,10508.846898,W,4,21,0.6,1618.474,M,-17.000,M,1.0,0000")
    track = read_track(write(tmp_path, "b.nmea", fixed + late + nmea(1, "090725", "00")))
    assert track.time[:2] == pytest.approx([before, before + 1.0])


def test_false_checksums_are_left_out_and_said(tmp_path: Path) -> None:
    broken = nmea(1).replace("4005", "4105", 2)
    # and a place whose quality is zero is no fix
    none = "".join(
        sentence(s[1:].partition("*")[0].replace("W,4,", "W,0,")) for s in nmea(3).split("\r\n")[:3]
    )
    track = read_track(write(tmp_path, "a.nmea", nmea(0) + broken + nmea(2) + none))
    assert track.time == pytest.approx(GPS + np.array([0.0, 2.0]))
    assert any(remark.kind == "mended" for remark in track.remarks)


def test_a_track_in_the_earth_frame_is_read_too(tmp_path: Path) -> None:
    header = "%  GPST  x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m) age(s) ratio\n"
    row = f"{WEEK} {SECOND} 6378137.0 0.0 0.0 5 9 1.0 2.0 3.0 0.0 0.0 0.0 0.0 0.0\n"
    track = read_track(write(tmp_path, "a.pos", header + row))
    assert [*track.latitude, *track.longitude, *track.height] == pytest.approx([0.0] * 3, abs=1e-9)
    # on the equator at Greenwich x is up, y east, z north
    assert track.position_covariance_n[0] == pytest.approx(np.diag([9.0, 4.0, 1.0]))


def test_a_row_that_was_cut_while_it_was_written_is_left_out_of_any_table(tmp_path: Path) -> None:
    track = read_track(write(tmp_path, "a.csv", "time,lat,lon,height\n1,2,3,4\n2,2,3,4,\n3,2,3\n"))
    assert list(track.time) == [1.0, 2.0]
    assert any("1 row of a.csv without its columns" in remark.text for remark in track.remarks)


GGA = "GNGGA,193400.00,4005.7,N,10508.8,W,4,21,0.6,1618.4,M,-17.0,M,,"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.pos", "", "empty"),
        ("a.pos", "% nothing known\n1 2 3\n", "no header of RTKLIB"),
        ("a.pos", HEADER.replace("(deg)", "(d'\")") + "x\n", "decimal"),
        ("a.pos", HEADER.replace("GPST", "JST") + ROW.format(18.0, 40.0, -105.0, 0.0), "JST"),
        ("a.pos", HEADER + ROW.format(18.0, 40.0, "north", 0.0), "no number"),
        ("a.pos", HEADER + ROW.format(18.0, 140.0, -105.0, 0.0), "beyond the poles"),
        ("a.csv", "when,where\n1,2\n", "does not name"),
        ("a.csv", "time,lat,lon,height\n1,2,3\n", "1 of 1 rows .* 4 columns"),
        ("a.csv", "time,lat,lon,height\n", "no row"),
        ("a.csv", "time,lat,lon,height\n1,2,3,1e9\n", "height"),
        ("a.nmea", sentence(GGA), "no date"),
        ("a.nmea", sentence("GNRMC,193400.00,A,4005.7,N,10508.8,W,5.6,300.9,080725,,,R"), "no fix"),
        ("a.ubx", UBX, r"a\.ubx is UBX .* not read: make a \.pos of it by RTKLIB .*, or record NMEA"),
        ("none.pos", None, "There is no GNSS track"),
    ],
)
def test_what_is_no_track_is_refused_in_words(name, content, words, tmp_path):
    with pytest.raises(RecordingError, match=words):
        read_track(tmp_path / name if content is None else write(tmp_path, name, content))


def test_fixes_come_in_order_once_each_and_are_thinned_and_weakened() -> None:
    time = np.array([0.0, 0.5, 0.25, 0.75, 1.0, 1.0])
    flat = np.full(6, 0.5)
    track = make_track(time, (flat, flat, flat), np.full((6, 3), 0.1), quality=np.array([1, 1, 2, 1, 1, 1]))
    assert list(track.time) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert [remark.kind for remark in track.remarks] == ["mended", "mended"]
    aid, rest = track.thinned(0.5)
    assert list(aid.time) == [0.0, 0.5, 1.0]
    assert list(rest.time) == [0.25, 0.75]
    weak = track.weakened({2: 3.0})
    assert np.sqrt(weak.position_covariance_n[:, 0, 0]) == pytest.approx([0.1, 0.3, 0.1, 0.1, 0.1])
