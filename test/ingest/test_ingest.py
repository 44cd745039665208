"""The command on small videos: what it writes, and what it says of bad ones."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from helpers.made_video import HEIGHT, RATE_HZ, WIDTH, make_video, number_in, picture, turn, write_lens
from helpers.mcap_doctor import doctor, read_beside_messages

from bodycam_ros.calibration.rig import NOT_RECORDED
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.cli.main import main
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording

SIZE = (WIDTH, HEIGHT)
CREATED_S = 1_714_564_800  # 2024-05-01T12:00:00Z


@pytest.fixture
def videos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three good cameras; the second began two seconds later.

    Their pictures move alike from the first on, by which motion would rightly put them at one time: it is not asked.
    """
    monkeypatch.setattr("bodycam_ros.ingest.camera_offsets._motion", lambda *_: ({}, {}))
    folder = tmp_path / "videos"
    folder.mkdir()
    add_camera(folder, "head")
    add_camera(folder, "shin", created="2024-05-01T12:00:02Z", lens="readout_time: 0.012\n")
    add_camera(folder, "thigh")
    return folder


def add_camera(
    folder: Path, name: str, lens: str = "", size: tuple[int, int] = (WIDTH, HEIGHT), **options: object
) -> Path:
    write_lens(folder / f"{name}.yaml", size, lens)
    return make_video(folder / f"{name}.mp4", frames=90, size=size, **{"created": "2024-05-01T12:00:00Z", **options})


def ingest(videos: Path, *more: str) -> tuple[int, Path]:
    bag = videos.parent / "bag"
    return main(["ingest", str(videos), "-o", str(bag), *more]), bag


def said(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join("".join(capsys.readouterr()).split())


def test_a_bag_holds_every_frame_at_its_time(videos: Path) -> None:
    code, bag = ingest(videos)
    assert code == 0
    with open_recording(bag) as recording:
        assert recording.cameras == ("head", "shin", "thigh")
        for camera in recording.cameras:
            images = list(recording.images([camera]))
            assert [number_in(decode_grey(image)) for image in images] == list(range(90))
            start_s = CREATED_S + (2 if camera == "shin" else 0)
            stamps_s = np.array([image.stamp_ns - start_s * 10**9 for image in images]) * 1e-9
            np.testing.assert_allclose(stamps_s, np.arange(90) / RATE_HZ, atol=2e-5)
            model = recording.camera_model(camera)
            assert (model.width, model.height, model.fx, model.distortion_model) == (WIDTH, HEIGHT, 40.0, "equidistant")


def test_what_the_bag_says_of_clocks_and_rows(videos: Path) -> None:
    _, bag = ingest(videos)
    with BagFile(bag) as file:
        assert file.topics["/head/image_raw/compressed_video"] == "foxglove_msgs/msg/CompressedVideo"
        timings = {topic: message for topic, _, message in file.messages(["/head/timing", "/shin/timing"])}
        infos = [message.header.stamp.sec for _, _, message in file.messages(["/head/camera_info"])]
        stamps = [stamp_ns for _, stamp_ns, _ in file.messages(file.topics)]
        first = next(message for _, _, message in file.messages(["/shin/image_raw/compressed_video"]))
    assert stamps == sorted(stamps)
    assert infos == [CREATED_S, CREATED_S + 1, CREATED_S + 2]
    assert timings["/shin/timing"].readout_time == 0.012 and timings["/shin/timing"].readout_sigma == 0.0
    assert math.isnan(timings["/head/timing"].readout_time)
    assert timings["/shin/timing"].offset == 0.0 and timings["/shin/timing"].offset_sigma >= 0.5
    assert (first.frame_id, first.format) == ("shin_optical_frame", "h264")
    assert bytes(first.data[:5]) in (b"\x00\x00\x00\x01\x67", b"\x00\x00\x00\x01\x06")


def test_the_bag_tells_what_it_was_made_from(videos: Path) -> None:
    (videos / "broken.mp4").write_bytes(b"no film")
    code, bag = ingest(videos)
    assert code == 3, "broken.mp4 is left out"
    assert doctor(bag / "bag.mcap") == []
    metadata, attachments = read_beside_messages(bag / "bag.mcap")
    assert metadata["bodycam_ros"]["command"] == "bodycam ingest"
    assert metadata["videos"] == {camera: f"{camera}.mp4" for camera in ("head", "shin", "thigh")}
    assert metadata["settings"]["head.scale"] == "1.0"
    assert attachments["timing.yaml"] == (videos.parent / "bag_timing" / "timing.yaml").read_bytes()
    assert isinstance(json.loads(attachments["findings.json"]), list)


def test_b_frames_rotation_and_hevc_come_out_upright_and_in_order(videos: Path) -> None:
    add_camera(videos, "b_frames", b_frames=3)
    turn(add_camera(videos, "askew", size=(HEIGHT, WIDTH)), 90)
    write_lens(videos / "askew.yaml", (WIDTH, HEIGHT))
    add_camera(videos, "hevc", codec="libx265")
    code, bag = ingest(videos)
    assert code == 0
    with open_recording(bag) as recording:
        assert len(recording.cameras) == 6
        for camera in recording.cameras:
            pictures = [decode_grey(image) for image in recording.images([camera])]
            assert len(pictures) == 90
            if camera == "askew":
                pictures = [np.rot90(grey, 1) for grey in pictures]
            errors = [
                np.abs(grey - picture(n, *grey.shape[::-1]).astype(int)).mean() for n, grey in enumerate(pictures)
            ]
            assert max(errors) < 6.0, camera


def test_each_bad_camera_is_named_and_the_rest_goes_on(videos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (videos / "no_video.mp4").write_text("these are notes\n")
    make_video(videos / "no_lens.mp4", frames=3)
    write_lens(videos / "other_size.yaml", (640, 480))
    make_video(videos / "other_size.mp4", frames=3)
    cut = add_camera(videos, "cut", fast_start=True)
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    (videos / "head.mov").write_bytes((videos / "thigh.mp4").read_bytes())
    add_camera(videos, "late", created="2024-05-01T12:01:00Z")
    add_camera(videos, "left-hand")
    code, bag = ingest(videos)
    output = said(capsys)
    assert code == 3, "cameras are left out"
    with open_recording(bag) as recording:
        assert recording.cameras == ("cut", "shin", "thigh")
    for expected in (
        "WARNING: camera head: left out:",
        "are several recordings of one camera",
        "no_video.mp4: is not a video",
        "camera no_lens: left out: there is no lens YAML",
        "other_size.yaml: is for 640 x 480 pixels, but",
        "camera cut: cut.mp4 should have 90 frames, and",
        "camera late: left out:",
        "after all others have ended",
        "camera left-hand: left out:",
    ):
        assert expected in output, expected


def test_one_camera_left_of_several_is_refused(videos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("shin", "thigh"):
        (videos / f"{name}.mp4").write_bytes(b"")
    code, bag = ingest(videos)
    assert code == 1 and not bag.exists()
    output = said(capsys)
    assert "only camera head of those given can be used" in output and "shin.mp4: is empty" in output


def test_what_is_there_is_replaced_only_if_an_ingest_wrote_it(videos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ingest(videos)[0] == 0
    code, bag = ingest(videos)
    assert code == 1 and "exists already" in said(capsys)
    assert ingest(videos, "--force")[0] == 0
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("bodycam ingest", "somebody"))
    assert ingest(videos, "--force")[0] == 1
    assert "no bag that 'bodycam ingest' wrote" in said(capsys)
    assert main(["ingest", str(videos), "-o", str(videos / "bag")]) == 1
    assert "lies within" in said(capsys)


def test_a_camera_of_the_rig_without_a_video_is_named(videos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = videos.parent / "rig.yaml"
    rig.write_text("cameras: {head: head, foot: foot}\nsegments: {head: null, foot: head}\n")
    assert ingest(videos, "--rig", str(rig))[0] == 3
    output = said(capsys)
    assert f"WARNING: camera foot: {NOT_RECORDED}" in output
    assert "each of 2 cameras (shin, thigh): is not in the rig" in output, "one of them may be the foot's"


def test_a_part_begins_with_the_keyframe_before_it_and_every_frame_decodes(
    videos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = ("--from", "1.2", "--to", "2.0")
    assert ingest(videos, "--synchronous")[0] == 0
    with open_recording(videos.parent / "bag") as recording:
        whole = {camera: list(recording.images([camera])) for camera in recording.cameras}
    code, bag = ingest(videos, "--force", "--synchronous", *part)
    assert code == 0 and "should have" not in said(capsys)
    start_ns = min(images[0].stamp_ns for images in whole.values())
    with open_recording(bag) as recording:
        for camera, all_images in whole.items():
            images = list(recording.images([camera]))
            for image in images:
                decode_grey(image)
            stamps_ns = [image.stamp_ns for image in images]
            wanted_ns = [i.stamp_ns for i in all_images if 1.2 <= 1e-9 * (i.stamp_ns - start_ns) < 2.0 - 1e-6]
            assert stamps_ns[-len(wanted_ns) :] == wanted_ns
            assert 1e-9 * (stamps_ns[0] - start_ns) <= 1.2 + 1.0 / RATE_HZ


def test_ctrl_c_leaves_nothing(videos: Path) -> None:
    make_video(
        videos / "head.mp4",
        frames=600,
        b_frames=2,
        size=(640, 480),
        preset="ultrafast",
        created="2024-05-01T12:00:00Z",
    )
    for name in ("shin", "thigh"):
        (videos / f"{name}.mp4").write_bytes((videos / "head.mp4").read_bytes())
    for name in ("head", "shin", "thigh"):
        write_lens(videos / f"{name}.yaml", (640, 480))
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "ingest", str(videos), "-o", str(videos.parent / "bag")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline_s = time.monotonic() + 30.0
    while not any(videos.parent.glob(".bodycam.*/bag/*.mcap")) and time.monotonic() < deadline_s:
        assert process.poll() is None
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert b"Traceback" not in errors
    assert sorted(path.name for path in videos.parent.iterdir()) == ["videos"]


def test_claps_bring_cameras_that_were_started_by_hand_to_one_time(
    videos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    began_s = {"head": 0.0, "shin": 0.437, "thigh": 1.1}
    claps_s = (1.6, 2.35, 3.9)
    decay = np.random.default_rng(4).normal(0.0, 1.0, 480)

    def sound_of(start_s: float) -> Callable[[np.ndarray], np.ndarray]:
        def sound(times_s: np.ndarray) -> np.ndarray:
            heard = 1e-3 * np.random.default_rng(round(1e3 * start_s)).normal(0.0, 1.0, len(times_s))
            for clap_s in claps_s:
                first = int(np.searchsorted(times_s, clap_s - start_s))
                heard[first : first + 480] += 0.3 * decay * np.exp(-np.arange(480) / 80.0)
            return heard

        return sound

    for camera, start_s in began_s.items():
        make_video(videos / f"{camera}.mp4", times_s=np.arange(150) / RATE_HZ, sound=sound_of(start_s))
    code, bag = ingest(videos)
    assert code == 0 and "sound" in said(capsys)
    with open_recording(bag) as recording:
        first_ns = {camera: next(recording.images([camera])).stamp_ns for camera in recording.cameras}
    for camera, start_s in began_s.items():
        assert 1e-9 * (first_ns[camera] - first_ns["head"]) == pytest.approx(start_s, abs=3e-3)
    report = bag.with_name("bag_timing")
    assert yaml.safe_load((report / "timing.yaml").read_text())["cameras"].keys() == began_s.keys()


def test_silent_videos_are_brought_to_one_time_by_their_motion(tmp_path: Path) -> None:
    folder = tmp_path / "videos"
    folder.mkdir()
    # What their files say of the time is wrong by two seconds.
    add_camera(folder, "head")
    add_camera(folder, "shin", created="2024-05-01T12:00:02Z")
    code, bag = ingest(folder)
    assert code == 0
    clocks = yaml.safe_load((bag.with_name("bag_timing") / "timing.yaml").read_text())["cameras"]
    assert clocks["shin"]["source"] == "motion"
    assert abs(clocks["shin"]["start_s"] - clocks["head"]["start_s"]) < 0.03


def test_one_camera_alone_needs_no_clock(tmp_path: Path) -> None:
    add_camera(tmp_path, "door")
    code = main(["ingest", str(tmp_path / "door.mp4"), "-o", str(tmp_path / "bag")])
    assert code == 0
    with open_recording(tmp_path / "bag") as recording:
        assert recording.cameras == ("door",)


def test_synchronous_cameras_and_given_offsets(videos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def first_s(*options: str) -> dict[str, float]:
        code, bag = ingest(videos, "--force", *options)
        assert code == (3 if "--offsets" in options else 0)
        with open_recording(bag) as recording:
            first = {camera: next(recording.images([camera])).stamp_ns for camera in recording.cameras}
        return {camera: 1e-9 * (stamp_ns - min(first.values())) for camera, stamp_ns in first.items()}

    assert set(first_s("--synchronous").values()) == {0.0}
    offsets = videos.parent / "offsets.yaml"
    offsets.write_text("head: 10.5\nshin: 10\n")
    assert first_s("--offsets", str(offsets)) == {"head": pytest.approx(0.5, abs=1e-6), "shin": 0.0}
    assert "camera thigh: left out:" in said(capsys)
    offsets.write_text("head: soon\n")
    assert ingest(videos, "--force", "--offsets", str(offsets))[0] == 1
    assert "start_s of camera head must be a number" in said(capsys)


def test_a_rate_of_videos_and_lenses_that_are_not_there_are_refused(
    videos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ingest(videos, "--rate", "25")[0] == 1
    assert "--rate is for folders with images" in said(capsys)
    assert ingest(videos, "--lenses", str(videos / "nowhere"))[0] == 1
    assert "nowhere: does not exist; expected the folder of the lens YAMLs" in said(capsys)


def test_folders_of_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for camera in ("left", "right"):
        (tmp_path / "in" / camera).mkdir(parents=True)
        write_lens(tmp_path / "in" / f"{camera}.yaml")
        for number in range(5):
            cv2.imwrite(str(tmp_path / "in" / camera / f"{number:04}.jpg"), picture(number))
    words = ["ingest", str(tmp_path / "in"), "-o", str(tmp_path / "bag"), "--synchronous"]
    assert main(words) == 1
    assert "give their rate with --rate" in said(capsys)
    assert main([*words, "--rate", "25"]) == 0
    with open_recording(tmp_path / "bag") as recording:
        images = list(recording.images(["left"]))
    assert [number_in(decode_grey(image)) for image in images] == list(range(5))
    assert np.diff([image.stamp_ns for image in images]).tolist() == [40_000_000] * 4


def test_reduced_frames_and_their_lens(videos: Path) -> None:
    code, bag = ingest(videos, "--scale", "0.5")
    assert code == 0
    with open_recording(bag) as recording:
        model = recording.camera_model("head")
        grey = decode_grey(next(recording.images(["head"])))
    assert grey.shape == (HEIGHT // 2, WIDTH // 2) == (model.height, model.width)
    assert (model.fx, model.cx) == (20.0, (WIDTH / 2 + 0.5) / 2 - 0.5)
    expected = cv2.resize(picture(0), (WIDTH // 2, HEIGHT // 2), interpolation=cv2.INTER_AREA)
    assert np.abs(grey.astype(int) - expected).mean() < 4.0


@pytest.mark.parametrize(
    "options", [{"codec": "libx265", "bits": 10}, {"rate_hz": 60000 / 1001}, {"size": (3840, 2160)}]
)
def test_what_action_cameras_write(tmp_path: Path, options: dict[str, object]) -> None:
    """HEVC with 10 bits, 59.94 frames a second and 4K go into the bag as they are, and come out as they were."""
    size = options.get("size", (WIDTH, HEIGHT))
    make_video(tmp_path / "head.mp4", frames=20, **options)
    write_lens(tmp_path / "head.yaml", size)
    assert main(["ingest", str(tmp_path / "head.mp4"), "-o", str(tmp_path / "bag")]) == 0
    with open_recording(tmp_path / "bag") as recording:
        images = list(recording.images(["head"]))
    interval_ns = 1e9 / options.get("rate_hz", RATE_HZ)
    np.testing.assert_allclose(np.diff([image.stamp_ns for image in images]), interval_ns, atol=2e4)
    errors = [np.abs(decode_grey(image) - picture(n, *size).astype(int)).mean() for n, image in enumerate(images)]
    assert len(images) == 20 and max(errors) < 6.0


def test_a_camera_that_was_stopped_in_between_has_two_parts(videos: Path) -> None:
    (videos / "head").mkdir()
    for number, created in ((1, "2024-05-01T12:00:00Z"), (2, "2024-05-01T12:00:08Z")):
        make_video(videos / "head" / f"GH0{number}0042.MP4", frames=90, created=created)
    write_lens(videos / "head" / "head.yaml")
    for name in ("shin", "thigh"):
        (videos / name).mkdir()
        make_video(videos / name / "GH010042.MP4", frames=330, created="2024-05-01T12:00:00Z")
        write_lens(videos / name / f"{name}.yaml")
    for file in [*videos.glob("*.mp4"), *videos.glob("*.yaml")]:
        file.unlink()
    code, bag = ingest(videos)
    assert code == 0
    with open_recording(bag) as recording:
        assert recording.cameras == ("head", "shin", "thigh")
        stamps_s = np.array([1e-9 * (image.stamp_ns - CREATED_S * 10**9) for image in recording.images(["head"])])
    assert len(stamps_s) == 180
    assert np.sort(np.diff(stamps_s))[-1] == pytest.approx(5.0 + 1 / RATE_HZ, abs=1e-3)
