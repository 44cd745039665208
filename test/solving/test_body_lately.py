"""What is told of the latest two instants, for those who look for the body next: its velocity above all."""

import numpy as np
from moving_body import STEP_NS, body_with_cameras, lenses, seen_by, true_poses

from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_smoother import BodySmoother

DARK = range(8, 23)
"""Frames in which the arm's cameras see nothing."""


def test_an_arm_that_is_found_elsewhere_than_it_was_expected_has_not_moved_there() -> None:
    """The step from where it was said to be then to where it is seen now is no motion; lately the former is mended."""
    body, rng = body_with_cameras(), np.random.default_rng(4)
    smoother, said = BodySmoother(body, lenses(body)), {}
    assert smoother.lately == []
    for number in range(DARK.stop + 1):
        seen = [camera for camera in body.mounts if number not in DARK or camera in ("chest", "back")]
        matches = {camera: seen_by(body, camera, number, rng) for camera in seen}
        smoother.update(BodyFrame((number + 1) * STEP_NS, matches))
        lately = smoother.lately
        assert [each.stamp_ns for each in lately] == [(n + 1) * STEP_NS for n in (number - 1, number) if n >= 0]
        said[number] = lately[-1].world_T_segment[:, :3, 3].copy()
    wrist, found = body.segment_index["forearm"], DARK.stop
    moved = (true_poses(body, found) - true_poses(body, found - 1))[wrist, :3, 3]
    before, now = (each.world_T_segment[wrist, :3, 3] for each in lately)
    as_said = np.linalg.norm(now - said[found - 1][wrist] - moved)
    off = np.linalg.norm(now - before - moved)
    print(f"step off: {1e3 * off:.0f} mm, as it was said {1e3 * as_said:.0f} mm")
    assert as_said > 0.05
    assert off < 0.5 * as_said
