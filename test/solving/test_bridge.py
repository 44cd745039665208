"""What is between two instants, where nobody saw anything."""

from dataclasses import replace

import numpy as np
import pytest
from known_walk import FRAME_NS, Walk

from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.solving.body_covariance import BodyUncertainty
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.bridge import bridge


def states(ride: Walk, instants: list[int]) -> list[BodyState]:
    names = ride.body.segments
    joints = np.tile(np.eye(3), (len(ride.body.tree_joints), 1, 1))
    known = BodyUncertainty(np.eye(6), np.eye(6), joints, np.tile(np.eye(6), (len(names), 1, 1)))
    seen = np.ones(len(names), bool)
    return [BodyState(int(ride.stamps_ns[i]), names, ride.world_T_segment[i], known, seen, 16) for i in instants]


def bridged(ride: Walk, before: list[BodyState], after: list[BodyState], stamps_ns: list[int]) -> Array:
    """Poses (T, S, 4, 4) in between."""
    between = bridge(ride.body, before, after, stamps_ns, np.ones(6))
    assert not any(state.observed.any() for state in between)
    return np.array([state.world_T_segment for state in between])


def test_equipment_that_stands_in_the_world_stays_there_while_the_body_sways(ride: Walk) -> None:
    """In the pelvis's axes the frame moves, by curves that are not the pelvis's own."""
    before, after = states(ride, [10, 11]), states(ride, [15, 16])
    between = ride.stamps_ns[12:15].tolist()
    poses = bridged(ride, before, after, between)
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
    before = states(one_way, [9, 10] if sides != "after" else [10])
    after = states(one_way, [40, 41] if sides != "before" else [40])
    poses = bridged(ride, before, after, ride.stamps_ns[11:40].tolist())
    crank = ride.body.segment_index["crank"]
    np.testing.assert_allclose(poses[:, crank, :3, :3], path[11:40, crank, :3, :3], rtol=0.0, atol=1e-6)


def test_a_wheel_whose_speed_nobody_knows_takes_the_shorter_way(ride: Walk) -> None:
    before, after = states(ride, [10]), states(ride, [14])
    poses = bridged(ride, before, after, ride.stamps_ns[11:14].tolist())
    crank = ride.body.segment_index["crank"]
    np.testing.assert_allclose(poses[1, crank, :3, :3], ride.world_T_segment[12, crank, :3, :3], rtol=0.0, atol=1e-9)
