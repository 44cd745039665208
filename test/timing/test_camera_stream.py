"""What a free-running camera says of instants at which it took no image."""

import numpy as np
from helpers.range_of_motion import START_NS, wide_cameras

from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_se3, rigid, transform_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_stream import CameraStream

CAMERA = wide_cameras(["head"])["head"]
FRAME_NS = 33_333_333
TWIST = np.array([0.6, -1.5, 0.9, 0.5, 1.0, -0.4])
FIRST = rigid(exp_so3(np.array([0.3, 0.2, -0.5])), np.array([0.4, -0.1, 1.2]))
POINTS = np.random.default_rng(2).uniform([-1.0, -1.0, 2.0], [1.0, 1.0, 5.0], (40, 3))


def pose_at(stamp_ns: int) -> np.ndarray:
    return FIRST @ exp_se3(1e-9 * (stamp_ns - START_NS) * TWIST)


def image(number: int, known: bool = True, offset_px: float = 0.0) -> LandmarkMatches:
    """Landmarks that are ahead of the camera at the fifth image; its turn since the image before is known."""
    stamp_ns, previous_ns = (START_NS + each * FRAME_NS for each in (number, number - 1))
    pose = pose_at(stamp_ns)
    points = transform_points(pose_at(START_NS + 5 * FRAME_NS), POINTS)
    pixels = CAMERA.project(transform_points(inverse(pose), points))[0] + offset_px
    ids = np.arange(len(points), dtype=np.uint32)
    return LandmarkMatches(
        camera="head",
        stamp_ns=stamp_ns,
        previous_stamp_ns=previous_ns if number else 0,
        track_ids=ids,
        landmark_ids=ids,
        pixels=pixels.astype(np.float32),
        points_world=points.astype(np.float32),
        world_T_camera=pose if known else None,
        pose_covariance=1e-6 * np.eye(6),
        current_R_previous=pose[:3, :3].T @ pose_at(previous_ns)[:3, :3],
        rotation_inliers=30 if number else 0,
    )


def said_of(instants_ns: list[int], images: list[LandmarkMatches]) -> list[LandmarkMatches]:
    stream = CameraStream(0)
    said = []
    waiting = sorted(instants_ns)
    stream.set_free(True, -1)
    for each in images:
        stream.add(each)
        while waiting and stream.has_passed(waiting[0], waiting[0]):
            said.append(stream.take(waiting[0], waiting.pop(0)))
    said += [stream.take(step_ns, step_ns) for step_ns in waiting]
    return [each for each in said if each is not None]


def test_a_constant_twist_is_followed_exactly() -> None:
    instants = [START_NS + round((number + share) * FRAME_NS) for number in range(2, 8) for share in (0.2, 0.5, 0.9)]
    said = said_of(instants, [image(number) for number in range(10)])
    assert [each.stamp_ns for each in said] == instants
    for each in said:
        assert each.world_T_camera is not None
        np.testing.assert_allclose(log_se3(inverse(pose_at(each.stamp_ns)) @ each.world_T_camera), 0.0, atol=1e-9)


def test_the_rotation_since_the_instant_before_is_what_the_camera_turned() -> None:
    instants = [START_NS + round((number + 0.3) * FRAME_NS) for number in range(1, 8)]
    said = said_of(instants, [image(number) for number in range(10)])
    assert said[0].rotation_inliers == 0
    for before, now in zip(instants, said[1:], strict=False):
        assert (now.previous_stamp_ns, now.rotation_inliers) == (before, 30)
        turned = pose_at(now.stamp_ns)[:3, :3].T @ pose_at(before)[:3, :3]
        np.testing.assert_allclose(now.current_R_previous, turned, atol=1e-6)


def test_an_unregistered_image_keeps_its_rotation_alone() -> None:
    images = [image(number, known=number != 5) for number in range(10)]
    step_ns = START_NS + round(5.2 * FRAME_NS)
    (said,) = said_of([step_ns], images)
    assert said.world_T_camera is None and said.stamp_ns == step_ns


def test_a_gap_has_no_pose() -> None:
    images = [image(number) for number in (*range(4), *range(12, 16))]
    near, far = START_NS + 4 * FRAME_NS, START_NS + 8 * FRAME_NS
    (said,) = said_of([near, far], images)
    assert said.stamp_ns == near and said.world_T_camera is None
