"""A calibration beside the node: one that is dropped ends at its next step, and leaves nothing behind."""

from concurrent.futures import CancelledError
from pathlib import Path

import yaml
from range_of_motion import known_body, known_rig, range_of_motion, registrations, wide_cameras

from bodycam_ros.live.live_calibration import LiveCalibration
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.pipeline_settings import PipelineSettings


def test_a_calibration_that_is_dropped_ends_and_writes_nothing(sample: Path, tmp_path: Path) -> None:
    truth = known_body()
    rig, path = known_rig(truth), tmp_path / "body.yaml"
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump({"cameras": dict(rig.cameras), "segments": dict(rig.parents)}))
    given = SolverParameters(body=str(path), rig=str(tmp_path / "rig.yaml"), map=str(sample / "map"))
    calibration = LiveCalibration(given, None)
    calibration.start(wide_cameras(truth.mounts), PipelineSettings())
    for matches in registrations(range_of_motion(truth), pixel_noise=0.3):
        calibration.add(matches)
    calibration.make_body()
    run = calibration._run
    assert run is not None
    calibration.restart()
    assert isinstance(run.exception(timeout=60.0), CancelledError)
    assert calibration.poll() is None and not calibration.is_running and not path.exists()
