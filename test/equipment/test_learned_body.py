"""What was found of the equipment, in what is published."""

import numpy as np
from held_ride import report
from known_ride import make_ride

from bodycam_ros.equipment.learned_body import learned_body


def test_joints_of_the_equipment_move_to_where_they_were_found() -> None:
    body = make_ride().body
    found = report(30)  # crank_x
    learned = learned_body(body, (*found.lengths, "pedal_left_y"), np.append(found.values, 0.5))
    for before, after in zip(body.joints, learned.joints, strict=True):
        moved = after.parent_T_joint - before.parent_T_joint
        expected = np.zeros((4, 4))
        if before.name == "crank":
            expected[0, 3] = found.values[0] - before.parent_T_joint[0, 3]
        np.testing.assert_allclose(moved, expected, atol=1e-12)
    assert learned_body(body, (), np.zeros(0)) is body
