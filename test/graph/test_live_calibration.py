"""A calibration beside the node: one that is dropped ends at its next step, and leaves nothing behind."""

from concurrent.futures import CancelledError
from pathlib import Path

import yaml
from helpers.range_of_motion import known_body, known_rig, range_of_motion, registrations, wide_cameras

from bodycam_ros.camera import CameraModel
from bodycam_ros.graph.live_calibration import LiveCalibration
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.pipeline.settings import PipelineSettings


def collecting(sample: Path, folder: Path) -> tuple[LiveCalibration, dict[str, CameraModel]]:
    """A calibration with a whole range of motion, and the models that it was given."""
    truth = known_body()
    rig, models = known_rig(truth), wide_cameras(truth.mounts)
    (folder / "rig.yaml").write_text(yaml.safe_dump({"cameras": dict(rig.cameras), "segments": dict(rig.parents)}))
    given = SolverParameters(body=str(folder / "body.yaml"), rig=str(folder / "rig.yaml"), map=str(sample / "map"))
    calibration = LiveCalibration(given, None)
    calibration.start(models, PipelineSettings())
    for matches in registrations(range_of_motion(truth), pixel_noise=0.3):
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
