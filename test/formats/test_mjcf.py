"""The body in MuJoCo: it stands and moves as ours does, and its loops hold while it is simulated."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from helpers.known_motion import BODY
from helpers.known_walk import Walk
from helpers.naming import naming
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, fitted_equipment
from bodycam_ros.body.equipment_search import close_loops
from bodycam_ros.body.equipment_yaml import read_equipment, supplied_equipment
from bodycam_ros.body.mechanism import Mechanism, project
from bodycam_ros.body.urdf import body_from_urdf, urdf_text
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.cli.main import main
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.mjcf import mjcf_text
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, quaternion_xyzw, rigid
from bodycam_ros.kinematics.joint import Joint, JointType
from bodycam_ros.kinematics.joint_angles import JointAngles

Poses = NDArray[np.float64]

FK_EXACT = 1e-9
CLOSED_M = 1e-8
"""[m], [rad] of a loop whose numbers were rounded on the way."""


class Simulation:
    """MuJoCo's model of a body, set to poses of ours."""

    def __init__(self, text: str) -> None:
        self.model: Any = mujoco.MjModel.from_xml_string(text)
        self.data: Any = mujoco.MjData(self.model)

    def set(self, body: BodyModel, world_T_segment: Poses) -> None:
        self._place(f"{body.root}_in_world", world_T_segment[body.segment_index[body.root]])
        for joint, rotation in zip(body.tree_joints, body.joint_rotations(world_T_segment), strict=True):
            child_R_joint = joint.child_T_joint[:3, :3]
            in_child = child_R_joint @ rotation @ child_R_joint.T
            if joint.child in body.standing:
                self._stand(joint.child, world_T_segment[body.segment_index[joint.child]])
            elif joint.type == "free":
                self._place(joint.name, world_T_segment[body.segment_index[joint.child]])
            elif joint.type == "ball":
                x, y, z, w = quaternion_xyzw(in_child)
                self.data.joint(joint.name).qpos = [w, x, y, z]
            elif joint.type == "hinge":
                angle = JointAngles(body).angles(body.joint_rotations(world_T_segment), np.zeros(len(names(body))))
                self.data.joint(joint.name).qpos = angle[names(body).index(joint.name)]

        for joint in body.loop_joints:
            self._roll(joint, *(world_T_segment[body.segment_index[s]] for s in (joint.parent, joint.child)))
        mujoco.mj_forward(self.model, self.data)

    def _place(self, joint: str, world_T_body: Poses) -> None:
        x, y, z, w = quaternion_xyzw(world_T_body[:3, :3])
        self.data.joint(joint).qpos = [*world_T_body[:3, 3], w, x, y, z]

    def _stand(self, body: str, world_T_body: Poses) -> None:
        x, y, z, w = quaternion_xyzw(world_T_body[:3, :3])
        self.data.mocap_pos[self.model.body(body).mocapid[0]] = world_T_body[:3, 3]
        self.data.mocap_quat[self.model.body(body).mocapid[0]] = [w, x, y, z]

    def _roll(self, loop: Joint, world_T_parent: Poses, world_T_child: Poses) -> None:
        """Set the carriage of a loop's joint to where its parent holds it."""
        at = inverse(world_T_child @ loop.child_T_joint) @ world_T_parent @ loop.parent_T_joint
        for row, axis in enumerate("xyz"):
            name = f"{loop.name}_along_{axis}"
            if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
                self.data.joint(name).qpos = at[row, 3]

    def body(self, name: str) -> Poses:
        found = self.data.body(name)
        return rigid(found.xmat.reshape(3, 3), found.xpos)

    def site(self, name: str) -> Poses:
        found = self.data.site(name)
        return rigid(found.xmat.reshape(3, 3), found.xpos)

    def residual(self) -> float:
        """The greatest of what the equality constraints are off by [m], [rad]."""
        rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert rows.any()
        return float(np.abs(self.data.efc_pos[rows]).max())


def names(body: BodyModel) -> tuple[str, ...]:
    return JointAngles(body).names


def posed(body: BodyModel, random: np.random.Generator) -> Poses:
    angles = random.uniform(-1.4, 1.4, size=len(names(body)))
    return body.forward_kinematics(exp_se3(random.normal(size=6)), JointAngles(body).poses(angles))


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.mark.parametrize("which", ["rider", "ride", "sample"])
def test_it_stands_where_our_forward_kinematics_has_it(
    rider: BodyModel, ride: Walk, sample: Path, random: np.random.Generator, which: str
) -> None:
    body = {"rider": rider, "ride": ride.body, "sample": read_body(sample / "body.yaml")}[which]
    simulation = Simulation(mjcf_text(body))
    for _ in range(10):
        poses = posed(body, random)
        simulation.set(body, poses)
        for segment, pose in zip(body.segments, poses, strict=True):
            np.testing.assert_allclose(simulation.body(segment), pose, rtol=0.0, atol=FK_EXACT)
        for camera, mount in body.mounts.items():
            pose = poses[body.segment_index[mount.segment]] @ mount.segment_T_camera
            np.testing.assert_allclose(simulation.site(optical_frame(camera)), pose, rtol=0.0, atol=FK_EXACT)
    assert simulation.model.nbody == 1 + len(body.segments)
    assert simulation.model.body_mass[1:].min() > 0.1


@pytest.mark.parametrize(("kind", "held"), [("ball", 3), ("hinge", 6), ("weld", 6)])
def test_a_loop_that_we_close_is_closed_and_one_that_opens_is_not(
    rider: BodyModel, random: np.random.Generator, kind: JointType, held: int
) -> None:
    poses = posed(rider, random)
    on_crank, axis = exp_se3(0.3 * random.normal(size=6)), np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    free = {"ball": random.normal(size=3), "hinge": 0.8 * axis, "weld": np.zeros(3)}[kind]
    crank, foot = (poses[rider.segment_index[segment]] for segment in ("crank", "foot"))
    on_foot = inverse(foot) @ crank @ on_crank @ rigid(exp_so3(free), np.zeros(3))
    pedal = Joint("pedal", "crank", "foot", kind, on_crank, on_foot, axis=axis)
    body = replace(rider, joints=(*rider.tree_joints, pedal))
    simulation = Simulation(mjcf_text(body))
    simulation.set(body, poses)
    assert simulation.residual() < CLOSED_M
    assert int((simulation.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum()) == held
    simulation.data.joint("axle").qpos += 0.1
    mujoco.mj_forward(simulation.model, simulation.data)
    assert simulation.residual() > 1e-3


def test_every_instant_of_a_ride_is_closed_and_a_crank_alone_opens_it(ride: Walk) -> None:
    simulation = Simulation(mjcf_text(ride.body))
    for poses in ride.world_T_segment[::9]:
        simulation.set(ride.body, poses)
        assert simulation.residual() < CLOSED_M
    simulation.data.joint("crank").qpos += 0.1
    mujoco.mj_forward(simulation.model, simulation.data)
    assert simulation.residual() == pytest.approx(2.0 * 0.17 * np.sin(0.05), rel=0.5)


def simulated_gaps(ride: Walk, *, constrained: bool) -> tuple[NDArray[np.float64], float]:
    """Gaps [m] of pedal and foot over 2 s without gravity, once the jolt is over; how far the crank turns [rad]."""
    simulation = Simulation(mjcf_text(ride.body))
    model, data = simulation.model, simulation.data
    model.opt.gravity = np.zeros(3)
    if not constrained:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    simulation.set(ride.body, ride.world_T_segment[0])
    start = float(data.joint("crank").qpos[0])
    data.joint("crank").qvel = 6.0
    gaps, turned = [], []
    while data.time < 2.0:
        mujoco.mj_step(model, data)
        turned.append(abs(float(data.joint("crank").qpos[0]) - start))
        ends = [simulation.site(f"pedal_left_0_on_{end}")[:3, 3] for end in ("parent", "child")]
        if data.time > 0.2:
            gaps.append(float(np.linalg.norm(ends[1] - ends[0])))
    return np.array(gaps), max(turned)


def test_the_loop_stays_closed_while_the_crank_is_turned(ride: Walk) -> None:
    gaps, turned = simulated_gaps(ride, constrained=True)
    assert turned > 0.9  # the frame stands, and the leg's mass slows the crank
    assert gaps.max() < 1e-3
    assert simulated_gaps(ride, constrained=False)[0].max() > 0.1


def held(name: str) -> tuple[BodyModel, Poses]:
    """A body that holds supplied equipment whose lengths are those of the file: as one, and poses that close all."""
    equipment = fitted_equipment(known(read_equipment(name)), BODY)
    mechanism = Mechanism(coupled_body(BODY, equipment), equipment)
    start, _ = close_loops(mechanism)
    return mechanism.body, mechanism.tree.poses_of(project(mechanism, start, mechanism.moving))


def known(equipment: Equipment) -> Equipment:
    attachments = tuple(replace(attachment, unknown=np.zeros(3)) for attachment in equipment.attachments)
    return replace(equipment, attachments=attachments, unknown={})


@pytest.mark.parametrize("name", supplied_equipment())
def test_supplied_equipment_is_closed_and_what_stands_does_not_fall(name: str, tmp_path: Path) -> None:
    body, poses = held(name)
    # As a solved bag says it: what holds and what stands goes through the URDF.
    simulation = Simulation(mjcf_text(body_from_urdf(urdf_text(body))))
    simulation.set(body, poses)
    assert simulation.residual() < CLOSED_M
    root = poses[body.segment_index[read_equipment(name).root]]
    while simulation.data.time < 0.3:
        mujoco.mj_step(simulation.model, simulation.data)
    assert np.isfinite(simulation.data.qpos).all()
    fallen_m = float(np.linalg.norm(simulation.body(read_equipment(name).root)[:3, 3] - root[:3, 3]))
    assert fallen_m == 0.0 if body.standing else fallen_m > 0.1


def test_a_seat_rolls_along_its_rail_and_nowhere_else() -> None:
    body, poses = held("rowing")
    simulation = Simulation(mjcf_text(body))
    simulation.set(body, poses)
    rail = poses[body.segment_index["rail"]]
    places = []
    simulation.data.joint("seat_place").qvel[:3] = -0.5 * rail[:3, 0]
    while simulation.data.time < 0.4:
        mujoco.mj_step(simulation.model, simulation.data)
        places.append((inverse(rail) @ simulation.body("seat"))[:3, 3])
    rolled = np.ptp(np.array(places), axis=0)
    assert rolled[0] > 0.05
    assert rolled[1:].max() < 5e-3


def test_what_a_joint_leaves_loose_is_not_held(rider: BodyModel, random: np.random.Generator) -> None:
    poses = posed(rider, random)
    crank, foot = (poses[rider.segment_index[segment]] for segment in ("crank", "foot"))
    for sigmas, rows in (
        ((0.01, 0.01, 10.0, 0.01, 0.01, 0.01), 5),
        ((10.0, 0.01, 0.01, 10.0, 0.01, 10.0), 3),
        ((10.0, 10.0, 10.0, 0.01, 0.01, 0.01), 3),
    ):
        pedal = Joint("pedal", "crank", "foot", "weld", np.eye(4), inverse(foot) @ crank, sigmas=sigmas)
        body = replace(rider, joints=(*rider.tree_joints, pedal))
        simulation = Simulation(mjcf_text(body))
        simulation.set(body, poses)
        assert simulation.residual() < CLOSED_M
        held_rows = np.flatnonzero(simulation.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        loose = simulation.model.nv - Simulation(mjcf_text(rider)).model.nv
        assert len(held_rows) - loose == rows


def test_limits_become_ranges(rider: BodyModel) -> None:
    limits = {"knee": ((-0.1, 2.5),), "hip": ((-0.5, 1.5), (-0.2, 0.3), (0.0, 0.1)), "ankle": ((-4.0, 4.0),) * 3}
    joints = tuple(replace(joint, limits=limits.get(joint.name)) for joint in rider.joints)
    model = Simulation(mjcf_text(replace(rider, joints=joints))).model
    np.testing.assert_allclose(model.joint("knee").range, [-0.1, 2.5])
    assert model.joint("knee").limited[0] and model.joint("hip").limited[0]
    low, high = model.joint("hip").range
    assert low == 0.0 and 1.5 < high < 1.5 + 0.3 + 0.1
    assert not model.joint("ankle").limited[0] and not model.joint("axle").limited[0]


def test_a_body_file_and_a_solved_bag_are_exported_with_their_loops(
    ride: Walk, ride_source: Path, tmp_path: Path
) -> None:
    output = tmp_path / "ride.xml"
    assert main(["export", str(ride_source), "--to", "mjcf", "-o", str(output)]) == 0
    simulation = Simulation(output.read_text())
    simulation.set(ride.body, ride.world_T_segment[20])
    assert simulation.residual() < 1e-7
    assert main(["export", str(ride_source), "--to", "mjcf", "-o", str(output)]) == 1
    assert main(["export", str(ride_source), "--to", "mjcf", "-o", str(output), "--force"]) == 0


def test_names_that_clash_and_chains_without_an_end_are_refused() -> None:
    joints = (Joint("b_in_world", "b", "a", "ball", np.eye(4)),)
    with naming(BodyError, "MJCF", "b_in_world"):
        mjcf_text(BodyModel("b", "b", ("b", "a"), joints, {}))
    segments = tuple(f"s{number}" for number in range(202))
    chain = tuple(
        Joint(f"j{number}", f"s{number}", f"s{number + 1}", "ball", np.eye(4)) for number in range(len(segments) - 1)
    )
    with naming(BodyError, "segment s200", 200):
        mjcf_text(BodyModel("snake", "s0", segments, chain, {}))
