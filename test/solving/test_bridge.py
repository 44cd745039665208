"""What is between two instants, where nobody saw anything."""

from dataclasses import replace

import numpy as np
import pytest
from known_walk import FRAME_NS, Walk

from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.solving.body_covariance import BodyUncertainty
from bodycam_ros.solving.bridge import Posture, bridge


def postures(ride: Walk, instants: list[int]) -> list[Posture]:
    count = len(ride.body.segments)
    joints = np.tile(np.eye(3), (len(ride.body.tree_joints), 1, 1))
    known = BodyUncertainty(np.eye(6), np.eye(6), joints, np.tile(np.eye(6), (count, 1, 1)))
    return [Posture(int(ride.stamps_ns[i]), ride.world_T_segment[i], known) for i in instants]


def test_equipment_that_stands_in_the_world_stays_there_while_the_body_sways(ride: Walk) -> None:
    """In the pelvis's axes the frame moves, by curves that are not the pelvis's own."""
    before, after = postures(ride, [10, 11]), postures(ride, [15, 16])
    between = ride.stamps_ns[12:15].tolist()
    poses, _ = bridge(ride.body, before, after, between, np.ones(6))
    index = ride.body.segment_index
    pelvis = poses[:, index["pelvis"]]
    assert np.linalg.norm(log_se3(inverse(pelvis[0]) @ pelvis[-1])) > 0.005
    frame = ride.world_T_segment[0, index["frame"]]
    np.testing.assert_allclose(poses[:, index["frame"]], np.tile(frame, (3, 1, 1)), rtol=0.0, atol=1e-12)
    # What hangs on it hangs on it still, and turns on; so does every limb.
    np.testing.assert_allclose(poses[:, index["crank"], :3, 3], np.tile(frame[:3, 3], (3, 1)), rtol=0.0, atol=1e-12)
    wanted = ride.world_T_segment[12:15]
    assert np.linalg.norm(log_se3(inverse(poses) @ wanted), axis=-1).max() < 0.1
    assert ride.stamps_ns[12] - ride.stamps_ns[11] == FRAME_NS


@pytest.mark.parametrize("seen", [("both", 1), ("both", -1), ("before", 1), ("after", 1)])
def test_a_crank_turns_on_through_a_silence_of_a_turn_and_a_half(ride: Walk, seen: tuple[str, int]) -> None:
    """Three turns in two seconds; 30 images of silence, at either end of which its angle is known up to whole turns."""
    sides, direction = seen
    path = ride.world_T_segment[::direction]
    one_way = replace(ride, world_T_segment=path)
    before = postures(one_way, [9, 10] if sides != "after" else [10])
    after = postures(one_way, [40, 41] if sides != "before" else [40])
    poses, _ = bridge(ride.body, before, after, ride.stamps_ns[11:40].tolist(), np.ones(6))
    crank = ride.body.segment_index["crank"]
    np.testing.assert_allclose(poses[:, crank, :3, :3], path[11:40, crank, :3, :3], rtol=0.0, atol=1e-6)


def test_a_wheel_whose_speed_nobody_knows_takes_the_shorter_way(ride: Walk) -> None:
    before, after = postures(ride, [10]), postures(ride, [14])
    poses, _ = bridge(ride.body, before, after, ride.stamps_ns[11:14].tolist(), np.ones(6))
    crank = ride.body.segment_index["crank"]
    np.testing.assert_allclose(poses[1, crank, :3, :3], ride.world_T_segment[12, crank, :3, :3], rtol=0.0, atol=1e-9)
