"""Bad input through the command line: one clear line or a counted skip, no traceback, nothing half-written."""

import dataclasses
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from helpers.altered_sample import CAMERAS, write_altered_sample
from helpers.tiny_bag import write_by_rosbags
from mcap.reader import make_reader

from bodycam_ros.body.body_file import read_body
from bodycam_ros.cli.main import main
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.pipeline.sensors import unused_sensors
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.camera_worker import UnusableCount, UnusableImages
from bodycam_ros.results.solved_body import read_solved_body


def run(sample: Path, bag: Path, out: Path, *more: str, map_path: Path | None = None, body: Path | None = None) -> int:
    """Exit code of a replay with one process."""
    inputs = [str(bag), "--map", str(map_path or sample / "map"), "--body", str(body or sample / "body.yaml")]
    return main(["replay", *inputs, "-o", str(out), "--jobs", "1", *more])


def assert_refused(capfd: pytest.CaptureFixture[str], code: int, out: Path, *expected: str) -> None:
    """One line of error with all the expected words, and no trace of an output."""
    errors = capfd.readouterr().err
    assert code == 1
    assert "Traceback" not in errors
    message = " ".join(errors.split("bodycam: error:")[1].split())
    for words in expected:
        assert words in message
    assert not out.exists()
    assert not list(out.parent.glob(f".{out.name}*"))


def change_info(**changes: object):
    """An alteration that changes the first camera's intrinsics."""

    def alter(topic: str, number: int, message: object) -> object:
        if topic == f"/{CAMERAS[0]}/camera_info":
            return dataclasses.replace(message, **changes)
        return message

    return alter


@pytest.mark.parametrize(
    ("alter", "expected"),
    [
        (lambda topic, number, m: None if topic == "/waist_front/camera_info" else m, ["waist_front", "camera_info"]),
        (change_info(distortion_model="omnidirectional"), ["waist_front", "omnidirectional", "equidistant"]),
        (change_info(k=np.array([np.nan, 0, 320, 0, 240, 240, 0, 0, 1.0])), ["waist_front", "nan"]),
    ],
    ids=["no camera_info", "unknown distortion", "NaN intrinsics"],
)
def test_bad_intrinsics_name_the_camera(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], alter: object, expected: list[str]
) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", alter, frames=2)
    assert_refused(capfd, run(sample, bag, tmp_path / "out"), tmp_path / "out", *expected)


def test_a_truncated_recording_is_named(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    whole = next((sample / "sample" / "bag").glob("*.mcap")).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[:5000])
    assert_refused(capfd, run(sample, tmp_path / "cut.mcap", tmp_path / "out"), tmp_path / "out", "cut.mcap")


@pytest.mark.parametrize("damage", ["cut off", "damaged inside"])
def test_a_damaged_recording_is_solved_up_to_the_damage(
    sample: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    bag = shutil.copytree(sample / "sample" / "bag", tmp_path / "bag")
    write_by_rosbags(bag)  # in chunks of a megabyte
    file = next(bag.glob("*.mcap"))
    content, middle = file.read_bytes(), file.stat().st_size // 2
    if damage == "cut off":
        file.write_bytes(content[:middle])
    else:
        with file.open("rb") as opened:
            summary = make_reader(opened).get_summary()
        assert summary is not None
        start = max(each.chunk_start_offset for each in summary.chunk_indexes if each.chunk_start_offset < middle)
        file.write_bytes(content[: start + 49] + b"\xff" * 2000 + content[start + 2049 :])
    assert run(sample, bag, tmp_path / "out") == 0
    said = " ".join(record.getMessage() for record in caplog.records)
    (after_s,) = {float(each) for each in re.findall(r"it is read up to (\d\.\d+) s", said)}
    assert f"is {damage}" in said and str(bag) in said and 0.5 < after_s < 1.5
    messages = [record.getMessage() for record in caplog.records]
    lacking = [each for each in messages if re.search(r"\d+ images that the recording should have are not in it", each)]
    with open_recording(sample / "sample" / "bag") as recording:
        assert all(any(camera in each for each in lacking) for camera in recording.cameras), "each camera is named"
    assert 1 <= len(lacking) <= 2
    solved = read_solved_body(tmp_path / "out")
    assert 1e-9 * (solved.stamps_ns[-1] - solved.stamps_ns[0]) == pytest.approx(after_s, abs=0.1)


def test_a_file_that_is_no_recording_is_named(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.mcap").write_text("not a recording")
    assert_refused(capfd, run(sample, tmp_path / "notes.mcap", tmp_path / "out"), tmp_path / "out", "notes.mcap")


def test_a_camera_that_the_body_lacks_is_left_out_with_a_warning(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    body = "".join(
        line for line in (sample / "body.yaml").read_text().splitlines(True) if "thigh_left: {segment" not in line
    )
    (tmp_path / "body.yaml").write_text(body)
    bag = write_altered_sample(sample, tmp_path / "bag", frames=3)
    assert run(sample, bag, tmp_path / "out", body=tmp_path / "body.yaml") == 0
    assert "1 of its 3 cameras are not on body" in caplog.text and "not used: thigh_left" in caplog.text
    assert "3 of 3 frames solved" in capfd.readouterr().out


def test_a_body_of_other_cameras_is_refused(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text = (sample / "body.yaml").read_text()
    for camera in CAMERAS:
        text = text.replace(f"  {camera}: {{segment", f"  other_{camera}: {{segment")
    (tmp_path / "body.yaml").write_text(text)
    bag = write_altered_sample(sample, tmp_path / "bag", frames=2)
    code = run(sample, bag, tmp_path / "out", body=tmp_path / "body.yaml")
    assert_refused(capfd, code, tmp_path / "out", "none of the cameras", "waist_front")


def test_stamps_before_1970_are_the_cause_and_not_the_map(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def alter(topic: str, number: int, message: object) -> object:
        stamp = dataclasses.replace(message.header.stamp, sec=-1)
        return dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=stamp))

    bag = write_altered_sample(sample, tmp_path / "bag", alter, frames=3)
    code = run(sample, bag, tmp_path / "out")
    assert_refused(capfd, code, tmp_path / "out", "none of its images could be used", "before 1970")


def test_a_sensor_that_the_body_has_no_calibration_of_is_not_ignored_without_a_word(sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    rows = [(number * 5_000_000, (0.0, 0.0, 0.0, 0.0, 0.0, 9.8)) for number in range(40)]
    (remark,) = unused_sensors(body, {"thigh_left": ImuSamples.from_rows(rows), "nobodys": ImuSamples.from_rows(rows)})
    assert "inertial sensors of thigh_left are not used" in remark and "bodycam body" in remark
    assert not unused_sensors(body, {})


@pytest.mark.long
def test_stamps_that_jump_back_and_broken_or_grey_images_do_not_stop_the_rest(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    def alter(topic: str, number: int, message: object) -> object:
        if topic == "/waist_front/image_raw/compressed":
            if number == 3:
                return dataclasses.replace(message, data=np.frombuffer(b"no picture", np.uint8))
            if number == 5:
                grey = cv2.imencode(".jpg", np.full((480, 640), 128, np.uint8))[1].reshape(-1)
                return dataclasses.replace(message, data=grey)
        if topic == "/torso_front/image_raw/compressed" and number == 4:
            back = dataclasses.replace(message.header.stamp, sec=message.header.stamp.sec - 1)
            return dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=back))
        return message

    bag = write_altered_sample(sample, tmp_path / "bag", alter, frames=12)
    assert run(sample, bag, tmp_path / "out") == 0
    printed = capfd.readouterr()
    warnings = " ".join(caplog.text.split())
    assert "camera waist_front: the image of stamp" in warnings and "cannot be decoded" in warnings
    assert "camera torso_front: stamps of 1 images do not increase, or are before 1970" in warnings
    rows = {words[0]: words for line in printed.out.splitlines() if len(words := line.split()) > 2}
    assert ["camera", "images", "registered", "dropped"] in [line.split()[:4] for line in printed.out.splitlines()]
    assert rows["waist_front"][3] == rows["torso_front"][3] == "1"
    assert len(rows["thigh_left"]) == len(rows["waist_front"]) - 1
    assert "12 of 12 frames solved" in printed.out
    assert "Traceback" not in printed.err


def test_a_map_that_is_not_there_or_empty_or_damaged(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", frames=2)
    out = tmp_path / "out"
    assert_refused(capfd, run(sample, bag, out, map_path=tmp_path / "nowhere"), out, "nowhere", "bodycam map")
    (tmp_path / "empty").mkdir()
    assert_refused(capfd, run(sample, bag, out, map_path=tmp_path / "empty"), out, "empty")
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "map.yaml").write_bytes((sample / "map" / "map.yaml").read_bytes())
    (damaged / "landmarks.npz").write_bytes((sample / "map" / "landmarks.npz").read_bytes()[:5000])
    assert_refused(capfd, run(sample, bag, out, map_path=damaged), out, "landmarks.npz")


def test_the_map_of_another_place_registers_nobody_and_says_so(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    here = ReferenceMap.load(sample / "map")
    rng = np.random.default_rng(0)
    elsewhere = dataclasses.replace(here, descriptors=rng.integers(0, 100, here.descriptors.shape).astype(np.uint8))
    elsewhere.save(tmp_path / "elsewhere")
    bag = write_altered_sample(sample, tmp_path / "bag", frames=4)
    code = run(sample, bag, tmp_path / "out", map_path=tmp_path / "elsewhere")
    assert_refused(capfd, code, tmp_path / "out", "no camera", "check that this is the map of the place")


def test_an_output_that_is_there_is_not_overwritten(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", frames=2)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("precious")
    assert run(sample, bag, tmp_path / "out") == 1
    assert run(sample, bag, tmp_path / "out", "--force") == 1
    assert "thesis.txt" in [path.name for path in (tmp_path / "out").iterdir()]
    assert "exists already" in capfd.readouterr().err


def test_settings_are_checked(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    bag = write_altered_sample(sample, tmp_path / "bag", frames=2)
    out = tmp_path / "out"
    assert_refused(capfd, run(sample, bag, out, "--keypoints.max_keypoints", "10"), out, "max_keypoints", "50 to 20000")
    (tmp_path / "config.yaml").write_text("/**: {ros__parameters: {estimater: {window: 0.5}}}")
    assert_refused(
        capfd, run(sample, bag, out, "--config", str(tmp_path / "config.yaml")), out, "estimater", "estimator"
    )


def test_a_map_without_scale_is_refused(sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    dataclasses.replace(ReferenceMap.load(sample / "map"), metric=False).save(tmp_path / "map")
    code = run(sample, sample / "sample" / "bag", tmp_path / "out", map_path=tmp_path / "map")
    assert_refused(capfd, code, tmp_path / "out", str(tmp_path / "map"), "has no scale", "AprilTag board")


def test_a_map_without_a_vertical_is_solved_with_a_word(
    sample: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataclasses.replace(ReferenceMap.load(sample / "map"), gravity_aligned=False).save(tmp_path / "map")
    bag = write_altered_sample(sample, tmp_path / "bag", frames=4)
    assert run(sample, bag, tmp_path / "out", map_path=tmp_path / "map") == 0
    assert "upward axis of this map is unknown" in caplog.text


def test_what_is_lost_is_said_of_each_camera(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """The metadata says that there were twelve images of one camera."""
    bag = write_altered_sample(sample, tmp_path / "bag", frames=8)
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())
    for topic in metadata["rosbag2_bagfile_information"]["topics_with_message_count"]:
        if topic["topic_metadata"]["name"] == f"/{CAMERAS[0]}/image_raw/compressed":
            topic["message_count"] = 12
    (bag / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    assert run(sample, bag, tmp_path / "out") == 0
    printed = capfd.readouterr().out
    heading = next(line for line in printed.splitlines() if line.split()[:2] == ["camera", "images"])
    assert heading.split()[:4] == ["camera", "images", "registered", "missing"]
    row = next(line for line in printed.splitlines() if CAMERAS[0] in line)
    assert row.split()[:4] == [CAMERAS[0], "12", "66.7%", "4"]
    assert f"camera {CAMERAS[0]}: 4 images that the recording should have are not in it" in caplog.text


def test_cameras_after_the_first_of_a_kind_are_one_warning(caplog: pytest.LogCaptureFixture) -> None:
    unusable = UnusableCount()
    for camera in ("head", "shin", "foot", "hand"):
        unusable.add(UnusableImages(camera, 0, "undecodable", f"camera {camera}: no picture"))
    assert [record.getMessage() for record in caplog.records] == ["camera head: no picture"]
    unusable.warn_of_others()
    assert caplog.records[1].getMessage() == "each of 3 cameras (shin, foot, hand): no picture"
    assert len(caplog.records) == 2 and len(unusable.reasons) == 4


def test_each_kind_of_unusable_images_is_warned_of_once_a_camera(caplog: pytest.LogCaptureFixture) -> None:
    unusable = UnusableCount()
    for kind, reason in (("undecodable", "grey"), ("undecodable", "white"), ("unordered", "back"), ("missing", "gone")):
        unusable.add(UnusableImages("head", 0, kind, reason))
    assert [record.getMessage() for record in caplog.records] == ["grey", "back", "gone"]
    assert (unusable.skipped["head"], unusable.lost["head"]) == (3, 1)
