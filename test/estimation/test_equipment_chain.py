"""A machine with all that can move: a hinge, a slide, a ball, and a part that lies beside it."""

import numpy as np
import pytest
from known_motion import BODY

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Attachment, Equipment, SegmentMotion, UnknownLengths
from bodycam_ros.estimation.equipment_chain import EquipmentChain
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.joint import LOOSE_M, TIGHT_M, TIGHT_RAD, Joint

HELD = (TIGHT_RAD,) * 3


def place(*tangent: float) -> Array:
    return exp_se3(np.array(tangent))


AXLE = Joint(
    "axle", "rail", "crank", "hinge", place(0.1, -0.4, 0.2, 0.1, 0.0, 0.5), place(0.3, 0.0, -0.2, 0.0, 0.02, 0.1),
    axis=np.array([1.0, 4.0, 2.0]),
)  # fmt: skip
SLIDE = Joint(
    "slide", "crank", "sleeve", "weld", place(0.5, 0.1, -0.7, 0.2, 0.1, 0.0), place(-0.2, 0.4, 0.0, 0.0, 0.1, 0.0),
    sigmas=(*HELD, LOOSE_M, TIGHT_M, TIGHT_M),
)  # fmt: skip
SOFT = Joint("spring", "sleeve", "cap", "weld", place(0.0, 0.3, 0.0, 0.1, 0.0, 0.0), sigmas=(*HELD, 0.02, 0.01, 1e-4))
KNOB = Joint("knob", "rail", "ball", "ball", place(1.0, 0.0, 0.3, 0.0, 0.3, 0.1), place(0.0, 0.7, 0.0, 0.05, 0.0, 0.0))
BESIDE = Joint("beside", "rail", "block", "free", place(0.0, 0.0, 0.6, -0.5, 0.0, 0.2))
JOINTS = (AXLE, SLIDE, SOFT, KNOB, BESIDE)
SEGMENTS = ("crank", "rail", "sleeve", "cap", "ball", "block")
ON_KNOB = np.array([[0.02, 0.0, 0.1], [0.0, 0.05, 0.1]])
MACHINE = Equipment(
    "machine",
    "rail",
    dict.fromkeys(SEGMENTS, SegmentMotion()),
    JOINTS,
    (
        Attachment(
            "hold", "forearm_left", "ball", ON_KNOB, ON_KNOB, np.full(2, 0.01), unknown=np.array([0.0, 0.1, 0.0])
        ),
    ),
    unknown={
        "slide": np.array([0.03, 0.0, 0.05]),
        "axle": np.array([0.0, 0.02, 0.0]),
        "knob": np.array([0.0, 0.0, 0.1]),
    },
)
INSTANTS = 4


@pytest.fixture
def chain() -> EquipmentChain:
    return EquipmentChain(MACHINE, JOINTS, UnknownLengths(MACHINE, JOINTS))


@pytest.fixture
def moving(chain: EquipmentChain) -> tuple[Array, Array, Array]:
    """Root (T, 4, 4), joint motions (T, J, 4, 4), and lengths (L)."""
    random = np.random.default_rng(7)
    motions = [exp_se3(random.normal(0.0, 0.8, (INSTANTS, xi.shape[1])) @ xi.T) for xi in chain.twists]
    return exp_se3(random.normal(0.0, 1.0, (INSTANTS, 6))), np.stack(motions, axis=1), random.normal(0.0, 0.05, 5)


def test_poses_are_those_of_the_coupled_body(chain: EquipmentChain, moving: tuple[Array, Array, Array]) -> None:
    root, motions, _ = moving
    poses, _ = chain.poses(root, motions, np.zeros(5))
    coupled = coupled_body(BODY, MACHINE)
    joint_poses = np.tile(np.eye(4), (INSTANTS, len(coupled.tree_joints), 1, 1))
    stand = {"machine": root, **{joint.name: motions[:, row] for row, joint in enumerate(chain.tree.tree_joints)}}
    by_name = coupled.joint_row
    for name in ("machine", "axle", "knob", "beside"):
        joint_poses[:, by_name[name]] = stand[name]
    by_body = coupled.forward_kinematics(np.broadcast_to(np.eye(4), root.shape), joint_poses)
    for name in ("rail", "crank", "ball", "block"):
        np.testing.assert_allclose(poses[:, chain.row[name]], by_body[:, coupled.segment_index[name]], atol=1e-12)
    # A body's welds do not slide; a machine's do.
    slid = inverse(poses[:, chain.row["crank"]] @ SLIDE.parent_T_joint) @ poses[:, chain.row["sleeve"]]
    np.testing.assert_allclose(slid @ SLIDE.child_T_joint, motions[:, 1], atol=1e-12)


def test_what_follows_from_each_unknown_is_what_a_small_step_of_it_does(
    chain: EquipmentChain, moving: tuple[Array, Array, Array]
) -> None:
    root, motions, lengths = moving
    poses, J = chain.poses(root, motions, lengths)
    small = 1e-5
    for column in range(chain.count):
        ends = []
        for sign in (1.0, -1.0):
            step = np.zeros((INSTANTS, chain.count))
            step[:, column] = sign * small
            moved = chain.moved(root, motions, step)
            ends.append(chain.poses(*moved, lengths + step[0, chain.length_columns])[0])
        numeric = (log_se3(inverse(poses) @ ends[0]) - log_se3(inverse(poses) @ ends[1])) / (2.0 * small)
        np.testing.assert_allclose(J[..., column], numeric, atol=1e-8, err_msg=str(column))
        # Only where somebody holds it, the first of the lengths, moves no segment.
        assert (np.abs(numeric).max() > 0.1) == (column != chain.length_columns[0])


def test_motions_are_read_from_poses(chain: EquipmentChain, moving: tuple[Array, Array, Array]) -> None:
    root, motions, lengths = moving
    np.testing.assert_allclose(chain.motions(chain.poses(root, motions, lengths)[0], lengths), motions, atol=1e-12)
