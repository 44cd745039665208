"""What was found of the equipment, in what is published."""

from dataclasses import replace

import numpy as np
from known_ride import bicycle, make_ride
from known_walk import walking_body

from bodycam_ros.equipment.coupled_body import coupled_body
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.learned_body import learned_body
from bodycam_ros.equipment.unknown_lengths import UnknownLengths


def unsure_bicycle() -> Equipment:
    """Its crank's axle may be elsewhere, and its pedal, of which one end is known better than the other."""
    known = bicycle()
    (pedal,) = known.attachments
    pedal = replace(pedal, unknown=np.array([0.02, 0.0, 0.03]), sigmas=np.array([2e-3, 5e-3]))
    return replace(known, attachments=(pedal,), unknown={"crank": np.array([0.0, 0.0, 0.01])})


def test_joints_and_attachments_move_to_where_they_were_found() -> None:
    unsure = unsure_bicycle()
    body = coupled_body(walking_body(), unsure)
    lengths = UnknownLengths(unsure, unsure.joints)
    shifts = np.array([0.015, -0.02, 0.004])
    learned = learned_body(body, unsure, lengths.said + shifts)
    (crank,), (pedal,) = unsure.joints, unsure.attachments
    found = replace(unsure, attachments=(lengths.attachment(pedal, shifts),), joints=(lengths.joint(crank, shifts),))
    expected = coupled_body(walking_body(), found)
    assert lengths.names == ("pedal_left_x", "pedal_left_z", "crank_z")
    for joint, wanted in zip(learned.joints, expected.joints, strict=True):
        np.testing.assert_allclose(joint.parent_T_joint, wanted.parent_T_joint, atol=1e-12)
        np.testing.assert_array_equal(joint.child_T_joint, wanted.child_T_joint)


def test_what_is_known_stays() -> None:
    body = make_ride().body
    assert learned_body(body, bicycle(), np.zeros(0)) is body
