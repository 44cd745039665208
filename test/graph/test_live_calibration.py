"""A calibration beside the node: one that is dropped ends at its next step, and leaves nothing behind."""

from concurrent.futures import CancelledError
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import yaml
from helpers.naming import naming
from helpers.range_of_motion import known_body, known_rig, range_of_motion, registrations, wide_cameras

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_identity import body_identity
from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.body.equipment_yaml import read_equipment
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodycamError, BodyError
from bodycam_ros.graph.live_calibration import LiveCalibration
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.messages.diagnostics import StatusLevel
from bodycam_ros.pipeline.settings import PipelineSettings


def collecting(sample: Path, folder: Path, frames: int | None = None) -> tuple[LiveCalibration, dict[str, CameraModel]]:
    """A calibration with a whole range of motion, or with its first registrations, and the models that it was given."""
    truth = known_body()
    rig, models = known_rig(truth), wide_cameras(truth.mounts)
    (folder / "rig.yaml").write_text(yaml.safe_dump({"cameras": dict(rig.cameras), "segments": dict(rig.parents)}))
    given = SolverParameters(body=str(folder / "body.yaml"), rig=str(folder / "rig.yaml"), map=str(sample / "map"))
    calibration = LiveCalibration(given, None)
    calibration.start(models, PipelineSettings())
    for matches in islice(registrations(range_of_motion(truth), pixel_noise=0.3), frames):
        calibration.add(matches)
    return calibration, models


def test_a_calibration_that_is_dropped_ends_and_writes_nothing(sample: Path, tmp_path: Path) -> None:
    calibration, _ = collecting(sample, tmp_path)
    calibration.make_body()
    run = calibration._run
    assert run is not None
    calibration.restart()
    assert isinstance(run.exception(timeout=60.0), CancelledError)
    assert calibration.poll() is None and calibration._run is None and not (tmp_path / "body.yaml").exists()


def test_a_camera_info_that_is_rejected_does_not_concern_what_was_collected(sample: Path, tmp_path: Path) -> None:
    """The node has no model of the camera any more."""
    calibration, models = collecting(sample, tmp_path)
    del models["chest"]
    calibration.make_body()
    assert calibration._run is not None and calibration._run.exception(timeout=120.0) is None


def test_a_body_is_written_once_with_its_report_and_is_the_one_that_is_read(sample: Path, tmp_path: Path) -> None:
    calibration, _ = collecting(sample, tmp_path)
    assert calibration.poll() is None
    calibration.make_body()
    assert calibration.report().values["step"]
    run = calibration._run
    assert run is not None
    run.result(timeout=120.0)
    body = calibration.poll()
    assert body is not None and calibration.poll() is None, "it is given out once"
    path = tmp_path / "body.yaml"
    # As it is in the file, which rounds: a replay with the file gives the same.
    assert body_identity(body) == body_identity(read_body(path))
    for joint, written in zip(body.joints, read_body(path).joints, strict=True):
        np.testing.assert_array_equal(joint.parent_T_joint, written.parent_T_joint)
    truth = {joint.name: joint.parent_T_joint[:3, 3] for joint in known_body().joints}
    for joint in body.joints:
        if joint.parent != body.root:  # the root's own origin is between its joints
            assert np.linalg.norm(joint.parent_T_joint[:3, 3] - truth[joint.name]) < 0.005
    assert path.with_suffix(".html").stat().st_size > 1000 and body.report
    assert calibration.report().level == StatusLevel.OK
    assert calibration.report().values["registrations collected"] > 1000, "it goes on collecting"


def test_a_range_of_motion_that_is_too_short_is_a_status_and_not_the_end(sample: Path, tmp_path: Path) -> None:
    calibration, models = collecting(sample, tmp_path, frames=3)
    calibration.make_body()
    run = calibration._run
    assert run is not None and isinstance(run.exception(timeout=60.0), BodycamError)
    assert calibration.poll() is None and not (tmp_path / "body.yaml").exists()
    status = calibration.report()
    assert status.level == StatusLevel.WARN and status.text == str(run.exception())
    calibration.restart()
    assert calibration.report().level == StatusLevel.OK
    assert calibration.report().values["registrations collected"] == 0


def test_what_a_calibration_cannot_have_is_named_at_its_start(sample: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("cameras: {a: torso}\nsegments: {torso: null}\n")
    (tmp_path / "there.yaml").write_text("dear")
    usual = SolverParameters(body=str(tmp_path / "b.yaml"), rig=str(tmp_path / "rig.yaml"), map=str(sample / "map"))
    LiveCalibration(usual, None)
    for change, named in (
        ({"cameras": ("a",)}, (tmp_path / "b.yaml", "cameras")),
        ({"body": str(tmp_path / "there.yaml")}, (tmp_path / "there.yaml", "overwrite_body:=true")),
        ({"body": str(tmp_path / "no" / "b.yaml")}, (tmp_path / "no" / "b.yaml",)),
        ({"map": ""}, ("map",)),
        ({"map": str(tmp_path / "nowhere")}, (tmp_path / "nowhere",)),
        ({"rig": str(tmp_path / "norig.yaml")}, (tmp_path / "norig.yaml",)),
    ):
        with naming(BodycamError, *named):
            LiveCalibration(replace(usual, **change), None)
    LiveCalibration(replace(usual, body=str(tmp_path / "there.yaml"), overwrite_body=True), None)
    assert (tmp_path / "there.yaml").read_text() == "dear", "it stays until there is another"
    assert read_equipment("bicycle").mounts == {}
    lamp = replace(read_equipment("bicycle"), mounts={"lamp": CameraMount("frame", np.eye(4))})
    with naming(BodyError, "equipment bicycle", "lamp"):
        LiveCalibration(usual, lamp)
    with naming(BodyError, "camera_info", "a"):
        LiveCalibration(usual, None).make_body()
