"""What stations say of a body, put together: each knows it but for its own line of sight."""

import numpy as np
import pytest
from numpy.typing import NDArray
from outside.dressed_body import small_motion

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_se3
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.said_segments import SaidSegments

Array = NDArray[np.float64]

SURE, OPEN, DT_S = 0.004, 1.0, 1.0 / 30.0
SETTINGS, MOTION = RegionSettings(), MotionSettings()


@pytest.fixture(scope="module")
def body(sample) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture(scope="module")
def motion(body: BodyModel) -> Array:
    return small_motion(body, 4)


def said_along(body: BodyModel, poses: Array, station: str, sight: Array, depth_m: float) -> SaidSegments:
    """What a station says that looks along a direction of the world: all is right but how far away the body is."""
    evidence = []
    for segment, world_T_segment in zip(body.segments, poses, strict=True):
        along = np.concatenate([np.zeros(3), world_T_segment[:3, :3].T @ sight])
        covariance = SURE**2 * np.eye(6) + OPEN**2 * np.outer(along, along)
        evidence.append(SegmentPose(segment, world_T_segment @ exp_se3(depth_m * along), covariance))
    return SaidSegments(station, 1, tuple(evidence), dict.fromkeys(body.segments, 0.5))


def frame_of(*said: SaidSegments) -> BodyFrame:
    return BodyFrame(1, {}, {}, {each.station: each for each in said})


def off_m(poses: Array, truth: Array) -> float:
    return float(np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max())


def test_stations_together_know_what_each_leaves_open(body: BodyModel, motion: Array) -> None:
    one = said_along(body, motion[3], "a", np.array([1.0, 0.0, 0.0]), 0.08)
    other = said_along(body, motion[3], "b", np.array([0.0, 1.0, 0.0]), -0.06)
    reports = StationReports(body, None, SETTINGS, MOTION)
    alone, together = (reports.look(frame_of(*said), motion[2], DT_S, ()) for said in ((one,), (one, other)))
    assert off_m(motion[2], motion[3]) > 0.01 > 0.002 > off_m(together.world_T_segment, motion[3])
    assert set(together.evidence) == {"a", "b"} and len(together.evidence["a"]) == len(body.segments)
    np.testing.assert_array_equal(together.confidence["b"], 0.5)
    closed = body.forward_kinematics(together.world_T_segment[0], body.joint_rotations(together.world_T_segment))
    np.testing.assert_allclose(closed, together.world_T_segment, atol=1e-9)
    for single, both in zip(alone.together, together.together, strict=True):
        assert single.segment == both.segment
        assert np.linalg.eigvalsh(single.covariance)[-1] > 0.5 * OPEN**2
        assert np.linalg.eigvalsh(both.covariance)[-1] < 4 * SURE**2


def test_what_worn_cameras_know_is_obeyed(body: BodyModel, motion: Array) -> None:
    """Where the pelvis is, which one station alone cannot tell."""
    said = said_along(body, motion[3], "a", np.array([1.0, 0.0, 0.0]), 0.1)
    reports = StationReports(body, None, SETTINGS, MOTION)
    pelvis = SegmentPose("pelvis", motion[3, 0], 1e-6 * np.eye(6))
    without, with_it = (reports.look(frame_of(said), motion[2], DT_S, known) for known in ((), (pelvis,)))
    row = body.segment_index["pelvis"]
    away = [np.linalg.norm(seen.world_T_segment[row, :3, 3] - motion[3, row, :3, 3]) for seen in (without, with_it)]
    assert away[1] < 0.002 < away[0]
    assert all(np.linalg.eigvalsh(each.covariance)[-1] > 0.5 for each in with_it.together), "it is not what they said"


def test_segments_that_the_body_has_not_are_left_out(body: BodyModel, motion: Array) -> None:
    said = said_along(body, motion[3], "a", np.array([1.0, 0.0, 0.0]), 0.0)
    tail = SaidSegments("a", 1, (*said.evidence, SegmentPose("tail", np.eye(4), np.eye(6))), {"tail": 1.0})
    seen = StationReports(body, None, SETTINGS, MOTION).look(frame_of(tail), motion[2], DT_S, ())
    assert [each.segment for each in seen.together] == list(body.segments)
    np.testing.assert_array_equal(seen.confidence["a"], 0.0)


def test_nobody_speaks(body: BodyModel, motion: Array) -> None:
    reports = StationReports(body, motion[0], SETTINGS, MOTION)
    assert reports.look(frame_of(), motion[2], DT_S, ()) is None
    assert reports.begin(frame_of()) == []
    blind = reports.look(frame_of(SaidSegments("a", 1, (), {})), motion[2], DT_S, ())
    assert blind.together == [] and off_m(blind.world_T_segment, motion[2]) < 0.01


def test_it_begins_where_somebody_placed_it(body: BodyModel, motion: Array) -> None:
    said = said_along(body, motion[0], "a", np.array([1.0, 0.0, 0.0]), 0.0)
    begun = StationReports(body, motion[0], SETTINGS, MOTION).begin(frame_of(said))
    assert [each.segment for each in begun] == list(body.segments)
    np.testing.assert_array_equal([each.world_T_segment for each in begun], motion[0])
    assert StationReports(body, None, SETTINGS, MOTION).begin(frame_of(said)) == []


def test_after_a_silence_it_is_where_it_was_seen_last(body: BodyModel, motion: Array) -> None:
    said = said_along(body, motion[3], "a", np.array([1.0, 0.0, 0.0]), 0.0)
    reports = StationReports(body, motion[0], SETTINGS, MOTION)
    seen = reports.look(frame_of(said), motion[3], DT_S, ())
    later, again = (reports.begin(BodyFrame(stamp_ns, {}, {}, {"a": said})) for stamp_ns in (2, 1))
    np.testing.assert_array_equal([each.world_T_segment for each in later], seen.world_T_segment)
    np.testing.assert_array_equal([each.world_T_segment for each in again], motion[0])
