"""Static cameras through the command line: a painted person in a bag, and what a user may have got wrong."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from made_once import made_once
from numpy.typing import NDArray
from outside.dressed_body import DressedBody, small_motion, stations_around
from tiny_bag import write_tiny_bag

from bodycam_ros.body.body_file import read_body
from bodycam_ros.cli.main import main
from bodycam_ros.geometry import exp_se3, quaternion_xyzw
from bodycam_ros.messages.header import header_message
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.stations_file import write_stations
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.solved.solved_recording import read_solved

Array = NDArray[np.float64]

FRAMES, START_NS, FRAME_NS = 10, 1_700_000_000_000_000_000, 33_333_333


def dressed_body(sample: Path) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), stations_around(3))


@pytest.fixture(scope="module")
def painted(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a bag, ``cameras.yaml`` and a ``start.yaml`` that is 2 cm and 4 degrees off."""
    return made_once(tmp_path_factory, "painted", lambda folder: write_painted(dressed_body(sample), folder))


def write_painted(dressed: DressedBody, folder: Path) -> None:
    motion = small_motion(dressed.body, FRAMES)
    write_bag(dressed, motion, folder / "bag")
    write_stations(folder / "cameras.yaml", dressed.stations.values())
    directions = np.random.default_rng(5).normal(size=(len(motion[0]), 2, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    placed = motion[0] @ exp_se3(np.concatenate([0.07 * directions[:, 0], 0.02 * directions[:, 1]], axis=1))
    lines = {
        name: [float(value) for value in (*placed[row, :3, 3], *quaternion_xyzw(placed[row, :3, :3]))]
        for row, name in enumerate(dressed.body.segments)
    }
    (folder / "start.yaml").write_text(yaml.safe_dump(lines))


def write_bag(dressed: DressedBody, motion: Array, path: Path) -> None:
    make = recorded_messages()
    with write_recording(path) as writer:
        for frame, poses in enumerate(motion):
            stamp_ns = START_NS + frame * FRAME_NS
            for name, picture in dressed.images(poses, 1.0, frame).items():
                camera, header = dressed.stations[name].camera, header_message(make, stamp_ns, f"{name}_optical_frame")
                info = make(
                    "sensor_msgs/msg/CameraInfo", header=header, width=camera.width, height=camera.height,
                    distortion_model=camera.distortion_model, d=np.array(camera.distortion), k=np.array(camera.k),
                )  # fmt: skip
                writer.write(f"/{name}/camera_info", stamp_ns, info)
                encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].reshape(-1)
                image = make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=encoded)
                writer.write(f"/{name}/image_raw/compressed", stamp_ns, image)


def run(sample: Path, bag: Path, out: Path, flags: Sequence[object]) -> int:
    inputs = [bag, "--body", sample / "body.yaml", "-o", out, "--jobs", 1, *flags]
    return main(["replay", *(str(each) for each in inputs)])


def test_a_painted_person_is_followed_in_the_frame_of_the_stations(
    sample: Path, painted: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without a map, and without worn cameras: joint states, odometry and what each station said."""
    out, files = tmp_path / "out", ("--stations", painted / "cameras.yaml", "--start", painted / "start.yaml")
    assert run(sample, painted / "bag", out, files) in (0, 3)
    assert f"{FRAMES} of {FRAMES} instants solved" in " ".join(capfd.readouterr().out.split())
    dressed = dressed_body(sample)
    solved, truth = read_solved(out), small_motion(dressed.body, FRAMES)
    np.testing.assert_array_equal(solved.stamps_ns, START_NS + FRAME_NS * np.arange(FRAMES))
    off = np.array(
        [
            np.linalg.norm((solved.world_T_link[name] - truth[:, row])[:, :3, 3], axis=1)
            for row, name in enumerate(dressed.body.segments)
        ]
    )
    assert off.mean() < 0.01 and off.max() < 0.03
    assert (off.mean(axis=1) < 0.02).all()
    assert {station.station for station in solved.stations} == set(dressed.stations) and not solved.cameras
    assert np.linalg.norm(truth[-1, :, :3, 3] - truth[0, :, :3, 3], axis=1).mean() > 0.05  # who stood still would fail


@pytest.mark.parametrize(
    ("flags", "complaints"),
    [
        ((), ["nothing tells where the cameras are", "--map", "--stations"]),
        (("--surface", "meshes"), ["--surface is for static cameras: say with --stations"]),
        (("--start", "start.yaml"), ["--start is for static cameras: say with --stations"]),
        (("--stations", "others.yaml"), ["others.yaml: the recording has none of its cameras (ext_09)", "ext_00"]),
        (("--stations", "missing.yaml"), ["missing.yaml"]),
        (("--stations", "cameras.yaml", "--start", "nobody.yaml"), ["nobody.yaml: places no segment of body"]),
        (("--stations", "cameras.yaml", "--surface", "meshes"), ["meshes"]),
        (("--stations", "cameras.yaml"), ["start"]),
        (("--stations", "cameras.yaml", "--passes", "2"), ["--passes lets a reference map grow", "--map"]),
    ],
    ids=["nothing", "surface alone", "start alone", "others", "missing", "nobody", "no meshes", "no start", "passes"],
)
def test_what_cannot_be_is_said_in_one_line(
    sample: Path,
    painted: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    flags: Sequence[str],
    complaints: Sequence[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    cameras = (painted / "cameras.yaml").read_text()
    Path("cameras.yaml").write_text(cameras)
    Path("others.yaml").write_text(yaml.safe_dump({"ext_09": yaml.safe_load(cameras)["ext_00"]}))
    Path("nobody.yaml").write_text("tail: [0, 0, 0, 0, 0, 0, 1]")
    assert run(sample, painted / "bag", tmp_path / "out", flags) == 1
    errors = capfd.readouterr().err
    message = " ".join(errors.split("bodycam: error:")[1].split())
    assert "Traceback" not in errors
    for words in complaints:
        assert words in message
    assert not list(tmp_path.glob("*out*"))


def test_a_bag_with_grey_images_of_another_size_solves_nothing_and_names_the_camera(
    sample: Path,
    painted: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The stations' file names its cameras, but it is that of another hall."""
    entry = yaml.safe_load((painted / "cameras.yaml").read_text())["ext_00"]
    cameras, start = tmp_path / "cameras.yaml", painted / "start.yaml"
    cameras.write_text(yaml.safe_dump({"left": entry, "right": entry}))
    bag = write_tiny_bag(tmp_path / "tiny")
    assert run(sample, bag, tmp_path / "out", ("--stations", cameras, "--start", start)) == 1
    errors = " ".join(capfd.readouterr().err.split())
    assert "no image of a static camera could be" in errors and "Traceback" not in errors
    warnings = [record.getMessage() for record in caplog.records]
    for camera in ("left", "right"):
        said = [warning for warning in warnings if warning.startswith(f"camera {camera}: an image of 64x48 px")]
        assert len(said) == 1 and "the lens is for 640x480" in said[0]
    assert not list(tmp_path.glob("*out*"))
