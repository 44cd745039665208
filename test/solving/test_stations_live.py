"""Live, static cameras and worn ones come to the same instants, whoever speaks first."""

import numpy as np
import pytest
from moving_body import STEP_NS, body_with_cameras, lenses, seen_by, true_poses

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.pipeline import PipelineSettings, SkeletonPipeline
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.said_segments import SaidSegments

WORN = ("chest", "back")
LISTENING = 31
"""Frames that worn cameras are listened to before any of them goes on."""

SETTINGS = PipelineSettings()


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return body_with_cameras()


def pipeline_of(body: BodyModel, placed: bool) -> SkeletonPipeline:
    reports = StationReports(body, true_poses(body, 0) if placed else None, SETTINGS.region, SETTINGS.motion)
    worn = {camera: lens for camera, lens in lenses(body).items() if camera in WORN}
    return SkeletonPipeline(body, worn, SETTINGS, live=True, onlookers=reports, stations=("door",), placed=placed)


def said_of(body: BodyModel, number: int) -> SaidSegments:
    """Where the arm is, as the door has it."""
    poses, sure = true_poses(body, number), np.diag(np.repeat([0.003, 0.003], 3) ** 2)
    arm = [SegmentPose(name, poses[body.segment_index[name]], sure) for name in ("upper_arm", "forearm")]
    return SaidSegments("door", (number + 1) * STEP_NS, tuple(arm), dict.fromkeys(body.segments, 1.0))


def test_nobody_waits_for_a_static_camera_until_the_body_and_its_motion_are_known(body: BodyModel) -> None:
    pipeline, rng = pipeline_of(body, placed=False), np.random.default_rng(1)
    for number in range(LISTENING + 3):
        for camera in WORN:
            pipeline.add(seen_by(body, camera, number, rng))
    assert [each.stamp_ns for each in pipeline.lately] == [STEP_NS, 2 * STEP_NS]
    assert pipeline.assembler.assembled == 2, "from here on it waits for the door"
    for number in range(2, LISTENING):
        pipeline.add_static(said_of(body, number))
        assert pipeline.assembler.assembled == number + 1
        arm = pipeline.lately[-1].world_T_segment[2, :3, 3]
        assert np.linalg.norm(arm - true_poses(body, number)[2, :3, 3]) < 0.02
    assert pipeline.assembler.late == 0 and not pipeline.assembler.synchrony.missed


def test_what_static_cameras_say_waits_while_worn_ones_are_listened_to(body: BodyModel) -> None:
    """A station that was told where the body is speaks at once, and what is said of an instant comes together."""
    pipeline, rng = pipeline_of(body, placed=True), np.random.default_rng(2)
    outputs = []
    for number in range(LISTENING + 10):
        outputs += pipeline.add_static(said_of(body, number))
        for camera in WORN:
            outputs += pipeline.add(seen_by(body, camera, number, rng))
        assert pipeline.assembler.assembled == (number + 1 if number >= LISTENING else 0)
    outputs += pipeline.flush()
    assert [output.state.stamp_ns for output in outputs] == [(n + 1) * STEP_NS for n in range(LISTENING + 10)]
    assert all(output.state.cameras_used == 3 for output in outputs)
    assert pipeline.assembler.late == 0 and not pipeline.assembler.synchrony.missed
