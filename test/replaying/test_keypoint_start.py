"""A replay of static cameras alone that starts by keypoints, without anything placed by hand."""

import json
from pathlib import Path

import numpy as np
import pytest
from static_cameras.dressed_body import DressedBody, small_motion
from static_cameras.painted_bag import FRAMES, dressed_body, write_painted

from bodycam_ros.cli.main import main
from bodycam_ros.formats.keypoints import JOINTS
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.static_cameras import blazepose

KINDS = {"Shoulder": "upper_arm", "Elbow": "forearm", "Hip": "thigh", "Knee": "shin", "Ankle": "foot"}
COCO_ROW = {joint: 5 + row for row, joint in enumerate(JOINTS)}


def write_keypoints(dressed: DressedBody, folder: Path, frames: int) -> None:
    """Keypoints of each camera in the first images, 1.5 px off."""
    truth, random = small_motion(dressed.body, FRAMES), np.random.default_rng(2)
    for name, station in dressed.stations.items():
        shown = folder / f"{name}_json"
        shown.mkdir(parents=True)
        for frame in range(frames):
            values = np.zeros((17, 3))
            for joint, row in COCO_ROW.items():
                if joint[1:] in KINDS:
                    segment = f"{KINDS[joint[1:]]}_{'left' if joint[0] == 'L' else 'right'}"
                    at = truth[frame, dressed.body.segment_index[segment], :3, 3]
                    pixels, _ = station.camera.project(transform_points(inverse(station.world_T_camera), at[None]))
                    values[row] = [*(pixels[0] + random.normal(0.0, 1.5, 2)), 0.8]
            people = [{"pose_keypoints_2d": values.ravel().tolist()}]
            (shown / f"{name}_{frame:06d}.json").write_text(json.dumps({"people": people}))


@pytest.mark.parametrize(("flag", "frames"), [("--start", 1), ("--keypoints", FRAMES)])
def test_a_painted_person_is_followed_from_keypoints(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], flag: str, frames: int
) -> None:
    dressed = dressed_body(sample)
    write_painted(dressed, tmp_path)
    write_keypoints(dressed, tmp_path / "pose", frames)
    files = ["--stations", str(tmp_path / "cameras.yaml"), flag, str(tmp_path / "pose")]
    body = ["--body", str(sample / "body.yaml"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    assert main(["replay", str(tmp_path / "bag"), *body, *files]) in (0, 3)
    assert f"{FRAMES} of {FRAMES} frames solved" in " ".join(capfd.readouterr().out.split())
    truth, solved = small_motion(dressed.body, FRAMES), read_solved(tmp_path / "out")
    off = np.array(
        [
            np.linalg.norm((solved.world_T_link[name] - truth[:, row])[:, :3, 3], axis=1)
            for name, row in dressed.body.segment_index.items()
        ]
    )
    assert off.mean() < 0.02 and off.max() < 0.06


def test_keypoints_that_no_detector_can_find_are_refused(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blazepose, "find_spec", lambda name: None)
    write_painted(dressed_body(sample), tmp_path)
    files = ["--stations", str(tmp_path / "cameras.yaml"), "--start", str(tmp_path / "start.yaml")]
    body = ["--body", str(sample / "body.yaml"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    assert main(["replay", str(tmp_path / "bag"), *body, *files, "--keypoints", "auto"]) == 1
    assert blazepose.INSTALL in " ".join(capfd.readouterr().err.split())
    assert not (tmp_path / "out").exists()
    assert main(["replay", str(tmp_path / "bag"), *body, *files, "--keypoints", "none"]) in (0, 3)


def test_keypoints_of_another_number_of_images_are_refused(
    sample: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    dressed = dressed_body(sample)
    write_painted(dressed, tmp_path)
    write_keypoints(dressed, tmp_path / "pose", FRAMES - 1)
    files = ["--stations", str(tmp_path / "cameras.yaml"), "--keypoints", str(tmp_path / "pose")]
    body = ["--body", str(sample / "body.yaml"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    assert main(["replay", str(tmp_path / "bag"), *body, *files]) == 1
    error = " ".join(capfd.readouterr().err.split())
    assert f"ext_00 has {FRAMES - 1} files of keypoints and {FRAMES} images" in error
    assert not (tmp_path / "out").exists()
