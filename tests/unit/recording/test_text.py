"""Text in every layout and with the names of many programs gives the same numbers, or is refused in one sentence."""

import bz2
import gzip
import lzma
import re
from pathlib import Path

import numpy as np
import pytest
from tests.contract.test_formats import example, write_xsens
from tests.unit.recording.by_hand import ROUNDED, said

from tumble.errors import RecordingError, UsageError
from tumble.recording import read_blocks, read_recording
from tumble.recording.formats import kernels, text


def sentence(path: Path | list[Path], **options: object) -> str:
    """The one sentence with which a recording is refused."""
    with pytest.raises(RecordingError) as caught:
        read_recording(path, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    return str(caught.value)


def header(time: str, force: str, rate: str, axes: str = "xyz") -> str:
    """Names of seven columns: those of the triads with an axis in place of the braces."""
    return ",".join([time, *(name.format(axis) for name in (force, rate) for axis in axes)])


LAYOUTS = {
    "semicolon": {"delimiter": ";"},
    "tab": {"delimiter": "\t"},
    "bar": {"delimiter": "|"},
    "comma and space": {"delimiter": ", "},
    "space": {"delimiter": " ", "header": "t ax ay az gx gy gz"},
    "several spaces": {"delimiter": "    ", "header": "t ax ay az gx gy gz"},
    "no header": {"header": None},
    "no header, spaces": {"header": None, "delimiter": "   "},
    "carriage returns": {"end": "\r\n"},
    "old Macintosh": {"end": "\r"},
    "comment header": {"header": "# made by hand\n# t ax ay az gx gy gz"},
    "header of units": {"header": "t,ax,ay,az,gx,gy,gz\ns,m/s^2,m/s^2,m/s^2,rad/s,rad/s,rad/s"},
    "plain": {"header": header("t", "a{}", "g{}")},
    "underscores": {"header": header("time", "acc_{}", "gyro_{}")},
    "capitals": {"header": header("Timestamp", "Acc{}", "Gyro{}", "XYZ")},
    "spelled out": {"header": header("stamp", "accel_{}", "omega_{}")},
    "ROS": {"header": header("header.stamp", "linear_acceleration.{}", "angular_velocity.{}")},
    "EuRoC": {"header": header("#timestamp [s]", "a_RS_S_{} [m s^-2]", "w_RS_S_{} [rad s^-1]")},
    "PX4": {"header": header("timestamp", "accelerometer_m_s2[{}]", "gyro_rad[{}]", "012")},
    "MAVLink": {"header": header("time_usec", "{}acc", "{}gyro")},
    "field's words": {"header": header("t", "specific_force_{}", "angular_rate_{}")},
    "w": {"header": header("t", "a{}", "w{}")},
    "phone": {"header": header("seconds_elapsed", "Accelerometer {} (m/s²)", "Gyroscope {} (rad/s)")},
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS.keys())
def test_every_layout_gives_the_same_recording(tumbled, csv, layout) -> None:
    rows = tumbled.rows(tumbled.time * (1e6 if "usec" in str(layout) else 1.0))
    recording = read_recording(csv(rows, **layout))
    assert np.abs(recording.time - tumbled.time).max() < ROUNDED
    assert tumbled.seen_in(recording)
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    assert recording.rate == pytest.approx(100.0, rel=1e-6)


def test_units_in_the_header_are_taken_over(tumbled, csv) -> None:
    scaled = tumbled.rows() / np.array([0.001, *[9.80665e-3] * 3, *[np.pi / 180] * 3])
    recording = read_recording(csv(scaled, header=header("t [ms]", "acc_{} [mg]", "g{} (deg/s)")))
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("mg", "deg/s")
    assert recording.rate == pytest.approx(100.0, rel=1e-6)
    assert not any("taken as" in remark.text for remark in recording.remarks)


@pytest.mark.parametrize("name", ["temperature", "Temp [degC]", "imu_temperature"])
def test_a_temperature_is_known_by_its_name_and_what_is_no_signal_is_left_out(tumbled, csv, name) -> None:
    more = ("quaternion_z", "latitude", "velocity_x", "x", "index", "timezone")
    rows = np.column_stack([tumbled.rows(), np.full(len(tumbled.time), 25.0), *[tumbled.time] * len(more)])
    recording = read_recording(csv(rows, header=",".join(["t,ax,ay,az,gx,gy,gz", name, *more])))
    assert np.all(recording.temperature == 25.0)
    assert tumbled.seen_in(recording)
    assert recording.magnetic_field is None


def test_the_option_permutes_skips_and_reverses(tumbled, csv) -> None:
    rows = np.column_stack([tumbled.rows(), np.full(len(tumbled.time), 25.0)])
    rows = rows[:, [7, 3, 1, 2, 0, 6, 4, 5]]  # temperature, az, ax, ay, t, gz, gx, gy
    rows[:, 3] *= -1.0
    path = csv(rows, header=None)
    recording = read_recording(path, columns="temp,az,ax,-ay,t,gz,gx,gy")
    assert tumbled.seen_in(recording)
    assert recording.temperature is not None
    lone = read_recording(path, columns="-,az,ax,-ay,_,_", rate=100.0)
    assert (lone.angular_rate, lone.temperature) == (None, None)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5, 6), (0, 4, 5, 6, 1, 2, 3), (1, 2, 3, 4, 5, 6, 0)])
def test_columns_without_names_are_told_by_their_content(tumbled, csv, order) -> None:
    recording = read_recording(csv(tumbled.rows()[:, order], header=None))
    assert tumbled.seen_in(recording)
    assert "names no columns" in said(recording, "assumed")


def test_the_real_recording_is_told_by_its_content(reference_data) -> None:
    """Order and units are what the recording's authors say, see its SOURCE.md."""
    recording = read_recording(reference_data / "mpu9150" / "imu0-first-16-s.log", rate=100.0)
    assert len(recording) == 1600
    assert (recording.specific_force_unit, recording.angular_rate_unit) == ("m/s^2", "rad/s")
    assert recording.specific_force[0].tolist() == [-8.42090, 0.06710, 5.24511]
    assert recording.angular_rate[0].tolist() == [0.03515, 0.00213, 0.04155]


@pytest.mark.parametrize("delimiter", [";", " ", "\t"])
def test_a_decimal_comma_is_read(tumbled, csv, delimiter) -> None:
    path = csv(tumbled.rows(), header=None, delimiter=delimiter)
    path.write_text(path.read_text().replace(".", ","))
    assert tumbled.seen_in(read_recording(path))


@pytest.mark.parametrize("names", ["t,ax,ay,az,gx,gy,gz\n", '"t","ax","ay","az","gx","gy","gz"\n', ""])
@pytest.mark.parametrize("quote", ["", '"'])
def test_decimal_commas_between_commas_are_asked_about(tmp_path: Path, names: str, quote: str) -> None:
    k = np.arange(60)
    rows = [
        0.02 * k,
        0.0312 * k - 0.5,
        0.1 + 0 * k,
        9.8066 + 0 * k,
        0.0051 * k,
        -0.0202 + 0 * k,
        0.03 - 1e-3 * k,
    ]
    cells = [[f"{quote}{v:.4f}{quote}".replace(".", ",") for v in row] for row in np.transpose(rows)]
    (tmp_path / "comma.csv").write_text(names + "".join(",".join(row) + "\n" for row in cells))
    assert "has decimal commas, and commas between its columns too" in sentence(
        tmp_path / "comma.csv", rate=50.0
    )


def test_whole_numbers_with_a_time_of_day_are_no_halves(tmp_path: Path) -> None:
    rows = [[20240301, f"{90000 + k:06d}", 8192 - k, 40 + k, 12, 16384, 5, k % 7] for k in range(60)]
    (tmp_path / "counts.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    options = {"columns": "-,-,ax,ay,az,gx,gy,gz", "rate": 50.0, "units": "counts"}
    assert read_recording(tmp_path / "counts.csv", **options).angular_rate[0].tolist() == [16384.0, 5.0, 0.0]


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_a_compressed_file_is_read_whatever_it_is_called(tumbled, csv, pack) -> None:
    path = csv(tumbled.rows())
    path.write_bytes(pack(path.read_bytes()))
    assert len(read_recording(path)) == len(tumbled.time)
    assert sum(len(b) for b in read_blocks(path)) == len(tumbled.time)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_is_no_part_of_the_first_name(tumbled, csv, encoding) -> None:
    path = csv(tumbled.rows())
    path.write_bytes(path.read_text().encode(encoding))
    assert "time 't'" in said(read_recording(path))


@pytest.mark.parametrize("character", ["\x0c", "\x0b", "\x85", "\u2028", "\u2029"])
def test_what_only_unicode_takes_for_a_line_end_loses_no_row(tumbled, csv, character) -> None:
    for names in (f"# made{character}by hand\nt,ax,ay,az,gx,gy,gz", f"t,ax,ay,az,gx,gy,gz{character}"):
        path = csv(tumbled.rows(), header=names)
        assert len(read_recording(path)) == sum(len(b) for b in read_blocks(path)) == len(tumbled.time)


def test_a_cut_last_line_is_left_out_and_said_and_a_missing_newline_loses_nothing(tumbled, csv, monkeypatch):
    """A last number with fewer decimals than all others is taken as cut; in the last of several blocks."""
    monkeypatch.setattr(text, "_CHUNK", 30_000)
    path = csv(tumbled.rows())
    whole = path.read_bytes()
    for octets, words in ((40, "cut short"), (4, "last number"), (1, None)):
        path.write_bytes(whole[:-octets])
        recording = read_recording(path)
        assert len(recording) == len(tumbled.time) - (words is not None)
        assert words in said(recording, "mended") if words else not said(recording, "mended")


def test_incomplete_first_rows_and_columns_of_text_are_set_aside(tumbled, csv) -> None:
    path = csv(tumbled.rows(), header=None)
    path.write_text("3.1,0.2,0.1\n" + path.read_text())
    recording = read_recording(path)
    assert len(recording) == len(tumbled.time)
    assert "incomplete first rows (line 1)" in said(recording)
    lines = csv(tumbled.rows(), header="t,ax,ay,az,gx,gy,gz,frame").read_text().splitlines()
    path.write_text("\n".join([lines[0], *(line + ",imu_link" for line in lines[1:])]) + "\n")
    assert tumbled.seen_in(read_recording(path))


def test_dates_in_the_time_column_become_seconds(tumbled, csv) -> None:
    rows = tumbled.rows()[:800]
    path = csv(rows)
    stamps = np.datetime64("2024-03-01T12:00:00", "us") + np.round(rows[:, 0] * 1e6).astype("timedelta64[us]")
    lines = path.read_text().splitlines()
    body = [f"{s}Z,{line.partition(',')[2]}" for s, line in zip(stamps, lines[1:], strict=True)]
    path.write_text("\n".join([lines[0], *body]) + "\n")
    # Seconds since 1970 in a double are exact to 0.24 microseconds.
    recording = read_recording(path)
    assert np.abs(recording.time - recording.time[0] - rows[:, 0]).max() < 1e-6
    assert recording.time[0] == 1709294400.0  # date -u -d 2024-03-01T12:00:00 +%s


def test_whole_or_in_pieces_compiled_or_by_polars_the_numbers_are_the_same(tumbled, csv, monkeypatch) -> None:
    for layout in ({}, {"delimiter": "   ", "header": None}, {"delimiter": "\t"}):
        path = csv(tumbled.rows(), **layout)
        small = read_recording(path)
        monkeypatch.setattr(text, "_CHUNK", 30_000)
        large = read_recording(path)
        first, second, *_ = text.read_tables(path)
        assert second.place(0) == f"line {len(first) + 1 + (layout.get('header', '') is not None)}"
        monkeypatch.setattr(kernels, "parse_rows", lambda *_: -1)
        by_polars = read_recording(path)
        monkeypatch.undo()
        for other in (large, by_polars):
            assert np.array_equal(small.specific_force, other.specific_force)
            assert np.array_equal(small.time, other.time)
            assert small.sources == other.sources


def test_one_clock_serves_all_pieces_of_an_xsens_file(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(text, "_CHUNK", 4096)
    write_xsens(tmp_path / "a.txt", example())
    lines = (tmp_path / "a.txt").read_text().splitlines()
    lines[-2] = re.sub(r"\t\S+", "\t", lines[-2], count=1)
    (tmp_path / "a.txt").write_text("\n".join(lines) + "\n")
    assert len(read_recording(tmp_path / "a.txt").time) == len(example()) - 1


def parsed(lines, columns, delimiter=",", skipped=()) -> np.ndarray | None:
    table = np.full((lines.count("\n"), columns), 7.0)
    passed = np.array([i in skipped for i in range(columns)], dtype=np.uint8)
    rows = kernels.parse_rows(np.frombuffer(lines.encode(), np.uint8), ord(delimiter), passed, table)
    return None if rows < 0 else table[:rows]


def test_every_number_is_the_double_that_is_nearest_to_it() -> None:
    """Python's own conversion is correctly rounded (David Gay); halves between two doubles are among them."""
    rng = np.random.default_rng(8)
    size = 4000
    wide, narrow, big = (
        rng.normal(0.0, 1e3, size),
        rng.normal(0.0, 10.0, size),
        rng.integers(2**53, 2**63, size),
    )
    written = [repr(x) for x in narrow.tolist()]
    written += [f"{x:.{d}f}" for x, d in zip(wide, rng.integers(0, 15, size), strict=True)]
    written += [f"{x:.{d}e}" for x, d in zip(narrow, rng.integers(0, 18, size), strict=True)]
    written += [f"{m}e{p}" for m, p in zip(big, rng.integers(-22, 23, size), strict=True)]
    halves = [str(2**53 + 2 * k + 1) for k in range(200)] + [f"{2**52 + k}.5" for k in range(200)]
    plain = ["-0", "+.5", "5.", "1E5", "0e0", "007", "0000", "-00.50", ".000", "0" * 30 + "1.25"]
    # Zeros before the first other digit are none of the digits that must be rounded.
    plain += [repr(x) for x in rng.uniform(1e-4, 0.1, size).tolist()]
    assert all(parsed(f"{word}\n", 1)[0, 0] == float(word) for word in plain)
    read = [(word, parsed(f"{word}\n", 1)) for word in [*written, *halves]]
    assert all(made is None or made[0, 0] == float(word) for word, made in read)
    refused = [word for word, made in read[: len(written)] if made is None]
    assert len(refused) < 0.01 * len(written), "most numbers take the short way"
    assert parsed("-0\n", 1)[0, 0].tobytes() == np.float64(-0.0).tobytes()


def test_rows_are_parsed_as_loggers_write_them_and_anything_else_is_left_to_others() -> None:
    rows = parsed("# x\n1, 2,3\r\n\n4,,6 # y\n", 3)
    assert np.array_equal(rows, [[1, 2, 3], [4, np.nan, 6]], equal_nan=True)
    assert np.array_equal(parsed(" 1  2\t3\n4 5 6\n", 3, "\0"), [[1, 2, 3], [4, 5, 6]])
    assert np.array_equal(parsed("1,rest,3\n4,,6\n", 3, ",", (1,))[:, [0, 2]], [[1, 3], [4, 6]])
    for line in ("1,2", "1,2,3,4", "1,x,3", "1,-,3", "1,.,3", "1,2,3e", "1 2,3,4", "nan,1,2", "1,2,3x"):
        assert parsed(f"1,2,3\n{line}\n", 3) is None, line
    assert parsed("1 2\n", 3, "\0") is None
    assert parsed("1,2,3456789012345678901234\n", 3) is None


# -- what is refused or left out -------------------------------------------------------------------


def test_what_is_no_recording_is_refused(tumbled, csv, tmp_path) -> None:
    (tmp_path / "a.bin").write_bytes(b"\n \n\n")
    assert "is empty" in sentence(tmp_path / "a.bin")
    for columns, words in (
        (2, "has 2 column(s), one of them time; a recording"),
        (1, "single column of numbers"),
    ):
        assert words in sentence(csv(tumbled.rows()[:, :columns], header=None))


def test_an_unreadable_file_is_refused(tumbled, csv, monkeypatch) -> None:
    """The superuser, who may run the tests, reads everything: the refusal is acted."""
    path = csv(tumbled.rows())

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert "permission denied" in sentence(path)


@pytest.mark.parametrize("delimiter", [",", "  "])
def test_a_cell_that_is_text_or_missing_is_named_by_line_and_column(tumbled, csv, delimiter) -> None:
    path = csv(tumbled.rows(), delimiter=delimiter, header="t,ax,ay,az,gx,gy,gz".replace(",", delimiter))
    lines = path.read_text().splitlines()
    lines[700] = delimiter.join(["7", "1", "oops", *"3456"])
    path.write_text("\n".join(lines) + "\n")
    assert "line 701, column 'ay' holds 'oops' instead of a number" in sentence(path)
    lines[300] += f"{delimiter}1.0{delimiter}2.0"
    path.write_text("\n".join(lines) + "\n")
    assert "line 301 has 9 columns where the others have 7" in sentence(path)
    lines = csv(tumbled.rows()).read_text().splitlines()
    lines[50] = "0.49,,1,2,3,4,5"
    path.write_text("\n".join(lines) + "\n")
    recording = read_recording(path)
    told = "1 row(s) without a finite number left out (first: line 51, column 'ax')"
    assert told in said(recording, "mended")
    assert (len(recording), recording.gaps) == (len(tumbled.time) - 1, (49,))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_a_few_rows_without_finite_numbers_are_left_out_and_many_refused(tumbled, csv, bad) -> None:
    rows = tumbled.rows()
    rows[10, 3] = bad
    assert len(read_recording(csv(rows))) == len(rows) - 1
    rows[::20, 3] = bad
    assert "rows hold no finite number somewhere, the first at line 2, column 'az'" in sentence(csv(rows))


@pytest.mark.parametrize("factor", [1e-300, 1e300, 1.7e308, 1e-320])
@pytest.mark.parametrize("what", [slice(0, 1), slice(1, 7)])
def test_numbers_that_no_sensor_gives_are_refused(tumbled, tmp_path, factor: float, what: slice) -> None:
    rows = tumbled.rows()[1:300]
    with np.errstate(over="ignore"):
        rows[:, what] *= factor
    np.savetxt(tmp_path / "a.csv", rows, fmt="%.9g", delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    for read in (read_recording, lambda path: list(read_blocks(path))):
        with pytest.raises(RecordingError, match=r"no finite number|all zeros|never changes"):
            read(tmp_path / "a.csv")


def test_options_that_are_wrong_are_usage_errors(tumbled, csv) -> None:
    path = csv(tumbled.rows())
    rates = [({"rate": rate}, "--rate") for rate in (1e300, 1e-300, float("nan"), 0.0, -1.0)]
    for options, match in (
        ({"columns": "t,ax,ay"}, "az missing"),
        ({"columns": "t,ax,ay,az,gx,gy,ax"}, "'ax' stands twice"),
        ({"columns": "t,a,b,c"}, "'a' is not one of"),
        ({"columns": "t,ax,ay,az,gx,gy,gz,-,-"}, "names 9 columns"),
        ({"columns": "t,-,-"}, "names no triad"),
        ({"units": "g,parsec"}, "'parsec' is neither a known unit"),
        ({"units": "g,mg"}, "two units of specific force"),
        *rates,
    ):
        with pytest.raises(UsageError, match=match):
            read_recording(path, **options)
    with pytest.raises(UsageError, match="3 files"):
        read_recording([path, path, path])
