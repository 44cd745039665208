"""Static cameras through the command line: a painted person in a bag, and what a user may have got wrong."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from helpers.shared_by_workers import made_once
from helpers.tiny_bag import write_tiny_bag
from numpy.typing import NDArray
from static_cameras.dressed_body import small_motion
from static_cameras.painted_bag import FRAME_NS, FRAMES, START_NS, dressed_body, write_painted

from bodycam_ros.cli.main import main
from bodycam_ros.results.solved_recording import read_solved

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def painted(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a bag, ``cameras.yaml`` and a ``start.yaml`` that is 2 cm and 4 degrees off."""
    return made_once(tmp_path_factory, "painted", lambda folder: write_painted(dressed_body(sample), folder))


def run(sample: Path, bag: Path, out: Path, flags: Sequence[object]) -> int:
    inputs = [bag, "--body", sample / "body.yaml", "-o", out, "--jobs", 1, *flags]
    return main(["replay", *(str(each) for each in inputs)])


def test_a_painted_person_is_followed_in_the_frame_of_the_stations(
    sample: Path, painted: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without a map, and without body cameras: joint states, odometry, what each station said, and a picture of it."""
    dressed = dressed_body(sample)
    out = tmp_path / "out"
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    for name, surface in dressed.surfaces.items():
        trimesh.Trimesh(surface.vertices, surface.faces).export(meshes / f"{name}.ply")
    files = ("--stations", painted / "cameras.yaml", "--start", painted / "start.yaml", "--surface", meshes)
    assert run(sample, painted / "bag", out, files) in (0, 3)
    said = " ".join(capfd.readouterr().out.split())
    assert f"{FRAMES} of {FRAMES} frames solved" in said
    assert "hand_left" not in said  # neither the body's file nor the scan has hands, so none need be seen
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
    report = tmp_path / "report"
    given = ("evaluate", out, "-o", report, "--recording", painted / "bag", "--stations", painted / "cameras.yaml")
    assert main([*map(str, given), "--surface", str(meshes)]) in (0, 3)
    assert (report / "outside.png").read_bytes().startswith(b"\x89PNG")


def test_images_of_a_static_camera_that_are_missing_are_reported(
    sample: Path,
    painted: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The metadata counts more images than there are."""
    shutil.copytree(painted / "bag", tmp_path / "bag")
    metadata = yaml.safe_load((tmp_path / "bag/metadata.yaml").read_text())
    for topic in metadata["rosbag2_bagfile_information"]["topics_with_message_count"]:
        if topic["topic_metadata"]["name"].startswith("/ext_00/image_raw"):
            topic["message_count"] += 2
    (tmp_path / "bag/metadata.yaml").write_text(yaml.safe_dump(metadata))
    files = ("--stations", painted / "cameras.yaml", "--start", painted / "start.yaml")
    assert run(sample, tmp_path / "bag", tmp_path / "out", files) in (0, 3)
    assert "camera ext_00: 2 images that the recording should have are not in it" in caplog.text
    heading = next(line for line in capfd.readouterr().out.splitlines() if line.split()[:2] == ["camera", "images"])
    assert heading.split()[:4] == ["camera", "images", "registered", "missing"]


@pytest.mark.parametrize(
    ("flags", "complaints"),
    [
        ((), ["give the place's reference map with --map", "--stations"]),
        (("--surface", "meshes"), ["--surface needs --stations"]),
        (("--start", "start.yaml"), ["--start needs --stations"]),
        (("--stations", "others.yaml"), ["others.yaml: the recording has none of its cameras (ext_09)", "ext_00"]),
        (("--stations", "missing.yaml"), ["missing.yaml"]),
        (("--stations", "cameras.yaml", "--start", "nobody.yaml"), ["nobody.yaml: places no segment of body"]),
        (("--stations", "cameras.yaml", "--surface", "meshes"), ["meshes"]),
        (("--stations", "cameras.yaml"), ["start"]),
        (("--stations", "cameras.yaml", "--passes", "2"), ["--passes extends a reference map", "--map"]),
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
