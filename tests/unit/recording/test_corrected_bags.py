"""Corrected bags: read by others' libraries, every other topic as it was, the IMU as `apply` gives it as CSV."""

import hashlib
import re
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from msgspec import structs
from tests.cli.program import Bench
from tests.contract.ros import IMU, STORE, STORE1, TEXT, ros1, ros2, rosbag1, rosbag2, samples, stream
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, G, document

from tumble.document import Calibration, ParameterBlock
from tumble.errors import RecordingError, TumbleError, UsageError
from tumble.recording import read_recording
from tumble.sensor import ImuModel, Triad
from tumble.workflows import apply

UNIT = document()
PLAIN = document(ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)))


TIME, FORCE, RATE = samples(600)


def read_back(path: Path) -> tuple[dict[str, list[tuple[int, bytes]]], dict[str, Any]]:
    """Messages by topic, and what the bag says of each topic, by rosbags."""
    reader = rosbag2.Reader(path) if path.is_dir() else rosbag1.Reader(path)
    found: dict[str, list[tuple[int, bytes]]] = {}
    with reader:
        for connection, at, data in reader.messages():
            found.setdefault(connection.topic, []).append((at, bytes(data)))
        described = {
            c.topic: (c.msgtype, c.msgdef, c.digest, repr(c.ext), c.msgcount) for c in reader.connections
        }
    return found, described


def numbers(found: list[tuple[int, bytes]], ros: int) -> tuple[np.ndarray, np.ndarray, list[Any]]:
    read = STORE1.deserialize_ros1 if ros == 1 else STORE.deserialize_cdr
    made = [read(data, IMU) for _, data in found]
    force = [[m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z] for m in made]
    rate = [[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in made]
    return np.array(force), np.array(rate), made


def as_csv(unit: Calibration, path: Path, folder: Path, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    apply(unit, path, output=folder / "beside.csv", **options)
    frame = pl.read_csv(folder / "beside.csv")
    return frame.select("ax", "ay", "az").to_numpy(), frame.select("gx", "gy", "gz").to_numpy()


def by_hand(force, rate, sensitivity=G) -> tuple[np.ndarray, np.ndarray]:
    true = np.linalg.solve(M_A, (force - B_A).T).T
    return true, np.linalg.solve(M_G, (rate - B_G - true @ sensitivity.T).T).T


ALONE = by_hand(FORCE, RATE, 0.0 * G)  # what PLAIN makes of the samples


def check_copy(path: Path, copy: Path, folder: Path, ros: int, topic: str = "/imu") -> None:
    """The copy is the bag, but for the numbers of the IMU."""
    before, said_before = read_back(path)
    after, said_after = read_back(copy)
    # What it was corrected by stands before a ROS 1 topic's definition, as a comment.
    kind, definition, *rest = said_after[topic]
    mark = f"# corrected by tumble: {UNIT.identity}\n" if ros == 1 else ""
    said_after[topic] = (kind, definition._replace(data=definition.data.removeprefix(mark)), *rest)
    assert said_after == said_before
    assert [at for at, _ in after[topic]] == [at for at, _ in before[topic]]
    for other in set(before) - {topic}:
        assert after[other] == before[other]
    force, rate, messages = numbers(after[topic], ros)
    old_force, old_rate, old = numbers(before[topic], ros)
    np.testing.assert_allclose([force, rate], by_hand(old_force, old_rate), rtol=0, atol=1e-12)
    assert np.array_equal([force, rate], as_csv(UNIT, path, folder, topics=[topic]))
    for new, former in zip(messages, old, strict=True):
        assert (new.header, new.orientation) == (former.header, former.orientation)
        assert np.array_equal(new.linear_acceleration_covariance, former.linear_acceleration_covariance)


@pytest.mark.parametrize("compression", ["BZ2", "LZ4"])
def test_a_ros_1_bag_keeps_everything_but_the_imu(tmp_path: Path, compression: str | None) -> None:
    path = ros1(tmp_path / "a.bag", {"/imu": "both"}, compression=compression)
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    done = apply(UNIT, path, output=tmp_path / "b.bag")
    assert (done.samples, done.file) == (600, tmp_path / "b.bag")
    assert hashlib.sha256(path.read_bytes()).hexdigest() == before
    check_copy(path, tmp_path / "b.bag", tmp_path, ros=1)


@pytest.mark.parametrize(
    ("storage", "mode"),
    [("SQLITE3", None), ("SQLITE3", "MESSAGE"), ("SQLITE3", "FILE"), ("MCAP", None), ("MCAP", "STORAGE")],
)
def test_a_folder_of_a_ros_2_bag_keeps_everything_but_the_imu(tmp_path, storage, mode) -> None:
    path = ros2(tmp_path / "a", {"/imu": "both"}, storage=storage, mode=mode)
    apply(UNIT, path, output=tmp_path / "b")
    assert sorted(p.name for p in (tmp_path / "b").iterdir()) == sorted(p.name for p in path.iterdir())
    assert (tmp_path / "b" / "metadata.yaml").read_bytes() == (path / "metadata.yaml").read_bytes()
    check_copy(path, tmp_path / "b", tmp_path, ros=2)


def test_a_database_keeps_its_tables(tmp_path: Path) -> None:
    (path,) = ros2(tmp_path / "a", {"/imu": "both"}).glob("*.db3")
    apply(UNIT, path, output=tmp_path / "b.db3")

    def tables(file: Path) -> dict[str, list[Any]]:
        connection = sqlite3.connect(file)
        names = [n for (n,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        rows = {n: connection.execute(f"SELECT * FROM {n}").fetchall() for n in names}
        connection.close()
        return rows

    before, after = tables(path), tables(tmp_path / "b.db3")
    assert after.pop("tumble_corrections") == [("/imu", UNIT.identity)]
    messages = before.pop("messages"), after.pop("messages")
    assert after == before
    assert [r[:3] for r in messages[0]] == [r[:3] for r in messages[1]]


def mcap_file(path: Path, compression: str, chunk: int = 20_000) -> Path:
    """By the mcap library, with an attachment, metadata and two schemas."""
    writing = pytest.importorskip("mcap.writer")
    kind = getattr(writing.CompressionType, compression)
    with path.open("wb") as file:
        writer = writing.Writer(file, chunk_size=chunk, compression=kind, use_chunking=compression != "NONE")
        writer.start(profile="ros2", library="test")
        schemas = {k: writer.register_schema(k, "ros2msg", b"float64 x") for k in (IMU, TEXT)}
        made = {
            t: writer.register_channel(t, "cdr", schemas[k], {"offered_qos_profiles": "- depth: 5"})
            for t, k in (("/imu", IMU), ("/words", TEXT))
        }
        writer.add_metadata("rosbag2", {"serialized_metadata": "version: 5"})
        for number, (topic, at, each, kind_) in enumerate(stream(STORE, {"/imu": "both"}, 600)):
            data = bytes(STORE.serialize_cdr(each, kind_))
            writer.add_message(made[topic], at, data, at - 5, number)
        writer.add_attachment(5, 6, "notes.txt", "text/plain", b"as it was")
        writer.finish()
    return path


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_an_mcap_file_keeps_everything_but_the_imu(tmp_path: Path, compression: str) -> None:
    reading = pytest.importorskip("mcap.reader")
    path = mcap_file(tmp_path / "a.mcap", compression)
    apply(UNIT, path, output=tmp_path / "b.mcap")

    def everything(file: Path) -> tuple[list[Any], Any, list[Any], list[Any]]:
        with file.open("rb") as opened:
            for make in (reading.NonSeekingReader, reading.SeekingReader):
                opened.seek(0)
                reader = make(opened, validate_crcs=True)
                rows = [
                    (s.name, s.data, c.topic, c.metadata, m.sequence, m.log_time, m.publish_time, m.data)
                    for s, c, m in reader.iter_messages()
                ]
            summary = reader.get_summary()
            extra = list(reader.iter_attachments()), list(reader.iter_metadata())
        return rows, summary, *extra

    before, told, notes, metadata = everything(path)
    after, told_after, *extra = everything(tmp_path / "b.mcap")
    assert [r[:7] for r in after] == [r[:7] for r in before]
    assert [r for r in after if r[2] != "/imu"] == [r for r in before if r[2] != "/imu"]
    assert (extra[0], extra[1][1:]) == (notes, metadata)
    assert [m.name for m in extra[1]] == ["tumble", "rosbag2"]
    statistics = replace(told_after.statistics, metadata_count=1)
    # An empty chunk at the end is nobody's loss.
    assert replace(statistics, chunk_count=0) == replace(told.statistics, chunk_count=0)
    assert (told_after.channels, told_after.schemas) == (told.channels, told.schemas)
    force, rate, _ = numbers([(0, r[7]) for r in after if r[2] == "/imu"], 2)
    assert np.array_equal([force, rate], as_csv(UNIT, path, tmp_path))


def test_blocks_of_any_size_give_the_same_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ros1(tmp_path / "a.bag", {"/imu": "both"})
    apply(UNIT, path, output=tmp_path / "b.bag")
    whole, _ = read_back(tmp_path / "b.bag")
    for size in (1, 7, 599):
        monkeypatch.setattr("tumble.recording.formats.bags.bag._BATCH", size)
        apply(UNIT, path, output=tmp_path / "c.bag")
        found, _ = read_back(tmp_path / "c.bag")
        assert found["/words"] == whole["/words"]
        for made, expected in zip(numbers(found["/imu"], 1)[:2], numbers(whole["/imu"], 1)[:2], strict=True):
            # A product of one row is summed in another order than one of many.
            np.testing.assert_allclose(made, expected, rtol=0, atol=4e-15)


def test_the_corrected_bag_is_not_corrected_again(tmp_path: Path) -> None:
    for path, copy in (
        (ros1(tmp_path / "a.bag", {"/imu": "both"}), tmp_path / "b.bag"),
        (ros2(tmp_path / "two", {"/imu": "both"}), tmp_path / "two-corrected"),
        (ros2(tmp_path / "three", {"/imu": "both"}, storage="MCAP"), tmp_path / "three-corrected"),
    ):
        apply(UNIT, path, output=copy)
        with pytest.raises(UsageError, match="corrected by this calibration already"):
            apply(UNIT, copy, output=tmp_path / "again.csv")


def test_of_two_imus_the_named_one_is_corrected_and_the_other_stays(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", {"/left": "both", "/right": "both"})
    with pytest.raises(RecordingError, match=r"several sensors: .*name one of them with --topic"):
        apply(UNIT, path, output=tmp_path / "b.bag")
    assert not (tmp_path / "b.bag").exists()
    apply(UNIT, path, output=tmp_path / "b.bag", topics=["/right"])
    check_copy(path, tmp_path / "b.bag", tmp_path, ros=1, topic="/right")
    # The other one can be corrected after it, and this one cannot.
    apply(UNIT, tmp_path / "b.bag", output=tmp_path / "c.bag", topics=["left"])
    with pytest.raises(UsageError, match="corrected by this calibration already"):
        apply(UNIT, tmp_path / "c.bag", output=tmp_path / "d.bag", topics=["right"])
    force, _, _ = numbers(read_back(tmp_path / "c.bag")[0]["/left"], 1)
    np.testing.assert_allclose(force, by_hand(FORCE, RATE)[0], atol=1e-12)


def test_triads_with_a_topic_each_are_corrected_each(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", {"/accel": "force", "/gyro": "rate"})
    apply(PLAIN, path, output=tmp_path / "b.bag")
    found, _ = read_back(tmp_path / "b.bag")
    force, none, _ = numbers(found["/accel"], 1)
    zero, rate, _ = numbers(found["/gyro"], 1)
    np.testing.assert_allclose(force, ALONE[0], atol=1e-12)
    np.testing.assert_allclose(rate, ALONE[1], atol=1e-12)
    assert not np.any([none, zero])
    with pytest.raises(UsageError, match=r"g-sensitivity of the gyro.*a topic for each triad"):
        apply(UNIT, path, output=tmp_path / "c.bag")


def lagging(seconds: float) -> Calibration:
    name = "lag of the accelerometer behind the gyro"
    said = ParameterBlock(name=name, value=seconds, standard_uncertainty=1e-4, unit="s")
    return structs.replace(PLAIN, parameters=[said])


@pytest.mark.parametrize("lag", [0.0113, -0.0051])
def test_a_lag_is_taken_out_of_the_specific_force(tmp_path, monkeypatch, lag) -> None:
    """Sample by sample against numpy's interpolation; the CSV has the same numbers."""
    path = ros1(tmp_path / "a.bag", {"/imu": "both"})
    expected = np.column_stack([np.interp(TIME + lag, TIME, true) for true in ALONE[0].T])
    for size in (4096, 13):
        monkeypatch.setattr("tumble.recording.formats.bags.bag._BATCH", size)
        done = apply(lagging(lag), path, output=tmp_path / "b.bag", shift_lag=True)
        made, kept, messages = numbers(read_back(tmp_path / "b.bag")[0]["/imu"], 1)
        np.testing.assert_allclose(made, expected, atol=2e-6)
        np.testing.assert_allclose(kept, ALONE[1], atol=1e-12)
        assert messages[3].header.stamp.nanosec == round(TIME[3] % 1 * 1e9)
    assert any("11.3 ms later" in t or "5.1 ms earlier" in t for t in done.remarks)
    csv = as_csv(lagging(lag), path, tmp_path, shift_lag=True)
    np.testing.assert_allclose(csv[0], made, atol=1e-12)


def test_a_lag_moves_the_stamps_of_an_accelerometer_s_own_topic(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", {"/accel": "force", "/gyro": "rate"})
    apply(lagging(0.0113), path, output=tmp_path / "b.bag", shift_lag=True)
    before, after = (read_back(p)[0] for p in (path, tmp_path / "b.bag"))

    def stamps(found: dict[str, Any], topic: str) -> np.ndarray:
        made = numbers(found[topic], 1)[2]
        return np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in made])

    assert set(stamps(after, "/accel") - stamps(before, "/accel")) == {-11_300_000}
    assert np.array_equal(stamps(after, "/gyro"), stamps(before, "/gyro"))
    assert [at for at, _ in after["/accel"]] == [at for at, _ in before["/accel"]]


def test_an_mcap_file_that_is_cut_short_is_copied_as_far_as_it_goes(tmp_path: Path) -> None:
    cut, copy = mcap_file(tmp_path / "a.mcap", "ZSTD"), tmp_path / "copy.mcap"
    cut.write_bytes(cut.read_bytes()[: int(0.6 * cut.stat().st_size)])
    done = apply(UNIT, cut, output=copy)
    assert 200 < done.samples < 500
    assert any("cut short" in remark for remark in done.remarks)
    again = read_recording(copy)
    assert not [r for r in again.remarks if r.kind == "mended"]
    assert np.array_equal(again.specific_force, as_csv(UNIT, cut, tmp_path)[0])
    assert len(again) == done.samples


def test_the_copy_is_never_the_bag_itself(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", {"/imu": "both"}, count=50)
    folder = ros2(tmp_path / "two", {"/imu": "both"}, count=50)
    (part,) = folder.glob("*.db3")
    for source, place in (
        (path, path),
        (folder, folder),
        (folder, part),
        (part, part),
        (folder, folder / "b"),
    ):
        with pytest.raises(UsageError):
            apply(UNIT, source, output=place)
    (tmp_path / "link.bag").symlink_to(path)
    with pytest.raises(UsageError, match="the recording itself"):
        apply(UNIT, path, output=tmp_path / "link.bag")


def test_a_folder_with_other_things_in_it_is_left_alone(tmp_path: Path) -> None:
    path = ros2(tmp_path / "a", {"/imu": "both"}, count=50)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.tex").write_text("mine")
    with pytest.raises(UsageError, match=r"holds thesis\.tex"):
        apply(UNIT, path, output=tmp_path / "b")
    assert [p.name for p in (tmp_path / "b").iterdir()] == ["thesis.tex"]


def test_an_existing_copy_stays_whole_where_the_new_one_fails(tmp_path, monkeypatch) -> None:
    from tumble.recording import Exchange

    path, folder = ros1(tmp_path / "a.bag", {"/imu": "both"}), ros2(tmp_path / "two", {"/imu": "both"})
    apply(UNIT, path, output=tmp_path / "b.bag")
    apply(UNIT, folder, output=tmp_path / "copy")
    kept = {p: p.read_bytes() for p in (tmp_path / "b.bag", *(tmp_path / "copy").iterdir())}
    true = Exchange.of

    def fails(self: Exchange, topic: str, data: bytes) -> bytes:
        if self.count > 300:
            raise OSError(28, "No space left on device")
        return true(self, topic, data)

    monkeypatch.setattr(Exchange, "of", fails)
    for source, place in ((path, tmp_path / "b.bag"), (folder, tmp_path / "copy")):
        with pytest.raises(TumbleError, match="could not be written: No space left"):
            apply(PLAIN, source, output=place)
    assert {p: p.read_bytes() for p in kept} == kept
    assert not list(tmp_path.glob(".*")) + list((tmp_path / "copy").glob(".*"))


def test_what_is_not_corrected_or_not_written_says_why(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", {"/imu": "both"}, count=50)
    (tmp_path / "a.csv").write_text("t,ax,ay,az\n0,0,0,9.8\n0.01,0,0,9.8\n")
    counts = document(ImuModel(Triad(2048 * M_A, B_A), Triad(939 * M_G, B_G)), ("counts", "counts"))
    for unit, source, name, options, words in (
        (UNIT, path, "b.ulg", {}, "CAL_ACC.*convert CALIBRATION --to px4|--to px4"),
        (UNIT, path, "b.bin", {}, "--to ardupilot"),
        (UNIT, path, "b.mcap", {}, "here of a .bag"),
        (UNIT, tmp_path / "a.csv", "b.bag", {}, "a.csv is none"),
        (UNIT, path, "b.xlsx", {}, "is written as"),
        (UNIT, path, "b.bag", {"shift_lag": True}, "states no lag"),
        (counts, path, "b.bag", {}, r"in m/s\^2, but the calibration was made for counts"),
        (UNIT, path, "b.bag", {"columns": "t,ax,ay,az,gx,gy,gz"}, "--columns is for columns"),
    ):
        with pytest.raises(UsageError, match=words):
            apply(unit, source, output=tmp_path / name, **options)


def test_the_form_follows_the_input_where_no_name_says_it(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert apply(UNIT, ros1(tmp_path / "a.bag", {"/imu": "both"}, count=50)).file == Path("a-corrected.bag")
    folder = ros2(tmp_path / "two", {"/imu": "both"}, count=50)
    assert apply(UNIT, folder).file == Path("two-corrected")
    assert (tmp_path / "two-corrected" / "metadata.yaml").is_file()
    shutil.rmtree(tmp_path / "two-corrected")


def test_the_commands_of_the_page_are_run(bench: Bench, tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "corrected.md").read_text(encoding="utf-8")
    commands = re.findall(r"^    tumble (apply .*)$", page, re.M)
    assert len(commands) == 5
    UNIT.write(tmp_path / "calibrated" / "calibration.json")
    ros1(tmp_path / "drive.bag", {"/imu": "both"}, count=60)
    mcap_file(tmp_path / "drive.mcap", "ZSTD")
    ros2(tmp_path / "drive", {"/imu": "both"}, count=60)
    names = ["t", *(f"{kind}{axis}" for kind in "ag" for axis in "xyz")]
    pl.DataFrame(np.column_stack([TIME, FORCE, RATE])[:60], schema=names).write_csv(tmp_path / "imu.csv")
    apply(UNIT, tmp_path / "imu.csv", output=tmp_path / "MH_01")
    (tmp_path / "MH_01" / "mav0" / "imu0" / "sensor.yaml").write_text("sensor_type: imu\n")
    for command in commands:
        bench(command)
        assert (tmp_path / command.split()[-1]).exists()
