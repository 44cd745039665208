"""Cameras that are elsewhere than the rig says are named; a right rig is not doubted."""

from collections.abc import Mapping

import numpy as np
import pytest
from helpers.range_of_motion import known_body, known_rig, range_of_motion, registrations, wide_cameras

from bodycam_ros.body.segment_name import mirrored
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RigError
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches


@pytest.fixture(scope="module")
def recorded() -> list[LandmarkMatches]:
    """A range of motion, with noise and wrong registrations."""
    return list(registrations(range_of_motion(known_body()), pixel_noise=0.5, wrong_share=0.03))


def solved(
    recorded: list[LandmarkMatches], cameras: Mapping[str, str], parents: Mapping[str, str | None]
) -> CalibratedBody:
    calibrator = BodyCalibrator(Rig(cameras, parents), wide_cameras(cameras))
    for one in recorded:
        calibrator.add(one)
    return calibrator.solve()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("thigh_left", "thigh_right"),
        ("shin_left", "foot_left"),
        ("forearm_left", "shin_left"),
        ("chest", "waist_left"),
        ("upper_arm_left", "thigh_right"),
    ],
)
def test_two_exchanged_cameras_are_named(recorded: list[LandmarkMatches], one: str, other: str) -> None:
    rig = known_rig(known_body())
    cameras = {**rig.cameras, one: rig.cameras[other], other: rig.cameras[one]}
    with pytest.raises(RigError) as raised:
        solved(recorded, cameras, rig.parents)
    named = str(raised.value).split(" are exchanged:")[0]
    assert set(named.removeprefix("cameras ").split(" and ")) == {one, other}


def test_a_camera_on_another_segment_is_named(recorded: list[LandmarkMatches]) -> None:
    rig = known_rig(known_body())
    with pytest.raises(RigError, match="^camera chest is on torso, not on pelvis:"):
        solved(recorded, {**rig.cameras, "chest": "pelvis"}, rig.parents)


def test_exchanged_sides_are_told_by_the_knees(recorded: list[LandmarkMatches]) -> None:
    rig = known_rig(known_body())
    other = {name: mirrored(name) or name for name in rig.parents}
    cameras = {camera: other[segment] for camera, segment in rig.cameras.items()}
    parents = {other[child]: parent and other[parent] for child, parent in rig.parents.items()}
    with pytest.raises(RigError, match="camera shin_left is on shin_left, not on shin_right.*the knees bend forward"):
        solved(recorded, cameras, parents)


def test_a_slipped_strap_is_no_exchange() -> None:
    body = known_body()
    place = body.mounts["foot_left"].segment_T_camera @ rigid(
        exp_so3(np.array([0.2, 0.0, 0.3])), np.array([0.08, 0.1, 0.0])
    )
    motion = range_of_motion(body, duration_s=12.0, slip=("foot_left", 6.0, place))
    rig = known_rig(body)
    found = solved(list(registrations(motion, pixel_noise=0.3)), rig.cameras, rig.parents)
    assert any("foot_left slipped" in warning for warning in found.diagnosis.warnings)
