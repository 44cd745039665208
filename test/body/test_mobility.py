from dataclasses import replace

import numpy as np
import pytest
from helpers.athletes import barbell, bicycle, snowboard
from helpers.known_motion import BODY

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Attachment
from bodycam_ros.body.equipment_search import close_loops
from bodycam_ros.body.mechanism import Mechanism, project
from bodycam_ros.body.mobility import Mobility, mobility
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint


def four_bar() -> BodyModel:
    """Four bars in a plane, hinged in a ring: the joints of all four say three times that it is a plane."""
    z = np.array([0.0, 0.0, 1.0])

    def at(x: float, y: float) -> np.ndarray:
        return rigid(np.eye(3), np.array([x, y, 0.0]))

    joints = (
        Joint("a", "ground", "left", "hinge", at(0.0, 0.0), axis=z),
        Joint("b", "left", "top", "hinge", at(0.0, 0.5), axis=z),
        Joint("c", "ground", "right", "hinge", at(1.0, 0.0), axis=z),
        Joint("d", "right", "top", "hinge", at(0.1, 0.6), at(1.1, 0.1), axis=z),
    )
    return BodyModel("ring", "ground", ("ground", "left", "top", "right"), joints, {})


def test_a_plane_ring_moves_though_gruebler_says_that_it_cannot() -> None:
    # B eq. 9 in space: 6 x 4 - 4 x 5 = 4, of which 6 would be of all together; in truth the ring has one besides.
    found = mobility(four_bar())
    assert found.count.freedoms == 4
    assert (found.freedoms, found.as_a_whole) == (7, 6)
    assert (found.rows, found.rank) == (5, 2)
    assert not found.conflicts


@pytest.fixture(scope="module")
def ridden() -> Mobility:
    return mobility(BODY, bicycle())


@pytest.mark.parametrize(
    ("athlete", "freedoms", "as_a_whole"),
    # 6 x 16 segments; 12 balls, 3 hinges, two attachments of six rows and three of three; the others alike.
    [("cyclist", 6 * 16 - 12 * 3 - 3 * 5 - 2 * 6 - 3 * 3, 0), ("rider", 84 - 36 - 12, 6), ("lifter", 84 - 36 - 9, 6)],
)
def test_what_an_athlete_holds_takes_the_freedoms_that_gruebler_counts(
    athlete: str, freedoms: int, as_a_whole: int, ridden: Mobility
) -> None:
    holds = {"rider": snowboard, "lifter": barbell}
    found = mobility(BODY, holds[athlete]()) if athlete in holds else ridden
    assert found.count.freedoms == found.freedoms == freedoms
    assert found.as_a_whole == as_a_whole
    assert found.rows == found.rank
    assert not found.conflicts and not found.stuck


def test_a_crank_moves_the_legs_and_leaves_the_arms(ridden: Mobility) -> None:
    assert {"hip_left", "knee_right"} <= set(ridden.coupled["crank_axle"])
    assert "neck" not in ridden.coupled["crank_axle"]


def test_null_motions_keep_the_loops_closed() -> None:
    mechanism = Mechanism(coupled_body(BODY, bicycle()), bicycle())
    columns = mechanism.moving
    configuration = project(mechanism, close_loops(mechanism)[0], columns)
    rows = mechanism.constraints(configuration, ground=True)
    np.testing.assert_allclose(rows.residuals, 0.0, atol=1e-9)
    free = np.linalg.svd(rows.jacobian[:, columns])[2][rows.jacobian.shape[0] :]
    step = np.zeros(mechanism.tangent.count)
    for size in (1e-3, 1e-4):
        for direction in free:
            step[columns] = size * direction
            gaps = mechanism.constraints(mechanism.tangent.moved(configuration, step)).residuals
            # Closed to first order: what opens is of the order of the square [sigma of some mm].
            assert np.abs(gaps).max() < 2e3 * size**2


def test_a_crank_that_is_held_cannot_move() -> None:
    bike = bicycle()
    on_frame = next(a for a in bike.attachments if a.name == "saddle")
    grip = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
    held = [
        Attachment(f"chain_{segment}", "pelvis", segment, grip, grip + on_frame.on_equipment, np.full(3, 0.01))
        for segment in ("frame", "crank")
    ]
    found = mobility(BODY, replace(bike, attachments=tuple(held)))
    assert "crank_axle" in found.stuck
    assert "spindle_left" not in found.stuck
