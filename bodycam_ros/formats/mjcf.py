"""The body as MJCF, for MuJoCo: a tree of bodies that have mass, and its loops closed by equality constraints.

Bodies are named as the segments and have their frames. The root moves freely in the world, and so does equipment, which
MuJoCo wants beside the body and not on it. A machine that stands is a mocap body: nothing moves it, and it is where
``mocap_pos`` has them. Joints are named as the body's; at zero the body stands in its N-pose. A
ball's quaternion is its joint rotation in the child's axes; its range holds every rotation that its three limits allow.
Cameras are sites. A ball that closes a loop is a connection of two sites, a hinge two of them along its axis, a weld
one of both place and rotation. What such a joint's own sigmas leave loose, as a seat that rolls on a rail, is given to
a small carriage between it and the child, which slides and turns along just that.

No body file has masses: the shapes, those of the URDF, weigh what water does. They touch nothing, because neighbours
overlap in their joint.
"""

import xml.etree.ElementTree as ET
from itertools import product

import numpy as np

from bodycam_ros.body.body_model import BONE_RADIUS_M, JOINT_RADIUS_M, BodyModel, bone_ends
from bodycam_ros.body.urdf import check_names, xml_numbers
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, log_so3, quaternion_xyzw, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import EulerOrder
from bodycam_ros.kinematics.tangent import held_rows

_LEVER_M = 0.05  # from a hinge's middle to each of the two points that hold its axis
_CARRIAGE_RADIUS_M = 0.02  # of what slides where a loop's joint is loose: it needs some mass
_STIFF = "0.999 0.9999 0.001"  # MuJoCo holds what is light softly, and a carriage carries who sits on the seat
_STEPS = 9  # of each angle of a ball between its limits, to find the widest rotation
_MOST_LEVELS = 200  # of bodies within each other: what writes XML goes down them by recursion
_NAMED = {
    "bodies": ["body"],
    "joints": ["joint", "freejoint"],
    "sites": ["site"],
    "constraints": ["connect", "weld"],
}
_COLOURS = {"body": "0.85 0.82 0.75 1", "equipment": "0.56 0.29 0.54 1"}


def mjcf_text(body: BodyModel) -> str:
    """The body as an MJCF document.

    Raises:
        BodyError: the body's names clash with each other in MJCF, or its chains are too long.
    """
    mujoco = ET.Element("mujoco", model=body.name)
    ET.SubElement(mujoco, "compiler", angle="radian")
    default = ET.SubElement(mujoco, "default")
    ET.SubElement(default, "geom", contype="0", conaffinity="0")
    for kind, rgba in _COLOURS.items():
        ET.SubElement(ET.SubElement(default, "default", {"class": kind}), "geom", rgba=rgba)
    world = ET.SubElement(mujoco, "worldbody")
    _add_bodies(world, body)
    elements = {element.attrib["name"]: element for element in world.iter("body")}
    equality = ET.SubElement(mujoco, "equality")
    for joint in body.loop_joints:
        _add_loop(equality, elements[joint.parent], elements[joint.child], joint)
    check_names(mujoco, _NAMED, "MJCF")
    ET.indent(mujoco)
    return ET.tostring(mujoco, encoding="unicode") + "\n"


def _add_bodies(world: ET.Element, body: BodyModel) -> None:
    standing = dict(zip(body.segments, body.n_pose(np.eye(4)), strict=True))
    elements = {body.root: _add_body(world, body, body.root, standing[body.root])}
    ET.SubElement(elements[body.root], "freejoint", name=f"{body.root}_in_world")
    levels = {body.root: 1}
    for joint in body.tree_joints:
        beside = joint.type == "free"
        levels[joint.child] = 1 if beside else levels[joint.parent] + 1
        if levels[joint.child] > _MOST_LEVELS:
            raise BodyError(
                f"segment {joint.child}: a chain of more than {_MOST_LEVELS} segments is not written as MJCF"
            )
        place = standing[joint.child] if beside else joint.parent_T_joint @ joint.joint_T_child
        element = _add_body(world if beside else elements[joint.parent], body, joint.child, place)
        elements[joint.child] = element
        if beside and joint.child in body.standing:
            element.set("mocap", "true")
        else:
            _add_joint(element, joint)


def _add_body(above: ET.Element, body: BodyModel, segment: str, above_T_segment: Array) -> ET.Element:
    """A body, its shapes and its cameras."""
    kind = "equipment" if segment in body.equipment_segments else "body"
    element = ET.SubElement(above, "body", {"name": segment, "childclass": kind, **_pose(above_T_segment)})
    ET.SubElement(element, "geom", type="sphere", size=str(JOINT_RADIUS_M))
    for end in bone_ends(body, segment):
        from_to = xml_numbers(np.concatenate([np.zeros(3), end]))
        ET.SubElement(element, "geom", type="capsule", fromto=from_to, size=str(BONE_RADIUS_M))
    for camera in body.cameras_on(segment):
        _add_site(element, optical_frame(camera), body.mounts[camera].segment_T_camera)
    return element


def _add_joint(element: ET.Element, joint: Joint) -> None:
    if joint.type == "free":
        ET.SubElement(element, "freejoint", name=joint.name)
        return
    if joint.type == "weld":
        return
    place = {"name": joint.name, "type": joint.type, "pos": xml_numbers(joint.child_T_joint[:3, 3])}
    if joint.type == "hinge":
        place["axis"] = xml_numbers(joint.child_T_joint[:3, :3] @ joint.axis)
        if joint.limits:
            place["range"] = xml_numbers(np.array(joint.limits[0]))
    elif (widest := _widest_rotation(joint)) < np.pi:
        place["range"] = xml_numbers(np.array([0.0, widest]))
    ET.SubElement(element, "joint", place)


def _widest_rotation(joint: Joint) -> float:
    """The widest rotation [rad] that a ball's limits allow; half a turn if they allow any."""
    if joint.limits is None or any(high - low > np.pi for low, high in joint.limits):
        return np.pi
    angles = np.array(list(product(*(np.linspace(low, high, _STEPS) for low, high in joint.limits))))
    rotations = EulerOrder((joint.angle_axes,)).compose(angles[:, None])[:, 0]
    return float(np.linalg.norm(log_so3(rotations), axis=1).max())


def _add_loop(equality: ET.Element, parent: ET.Element, child: ET.Element, joint: Joint) -> None:
    """What holds a joint that closes a loop; MuJoCo's own softness, which is not the joint's."""
    held = held_rows(joint)
    if not held:
        return
    is_hinge = joint.type == "hinge" and {1, 2} <= set(held)
    is_ball = min(held) > 2
    loose = [row for row in range(6) if row not in held and (row > 2 or not (is_hinge or is_ball))]
    child_T_joint = joint.child_T_joint
    if loose:
        child, child_T_joint = _add_carriage(child, joint, loose), np.eye(4)
    levers = [-_LEVER_M * joint.axis, _LEVER_M * joint.axis] if is_hinge else [np.zeros(3)]
    for number, lever in enumerate(levers):
        name = f"{joint.name}_{number}" if len(levers) > 1 else joint.name
        at_lever = rigid(np.eye(3), lever)
        _add_site(parent, f"{name}_on_parent", joint.parent_T_joint @ at_lever)
        _add_site(child, f"{name}_on_child", child_T_joint @ at_lever)
        kind = "connect" if is_hinge or is_ball else "weld"
        held_sites = ET.SubElement(equality, kind, name=name, site1=f"{name}_on_parent", site2=f"{name}_on_child")
        if loose:
            held_sites.set("solimp", _STIFF)


def _add_carriage(child: ET.Element, joint: Joint, loose: list[int]) -> ET.Element:
    """A body in the joint's frame on its child that moves along those of the joint's six rows that are loose."""
    carriage = ET.SubElement(child, "body", {"name": f"{joint.name}_carriage", **_pose(joint.child_T_joint)})
    ET.SubElement(carriage, "geom", type="sphere", size=str(_CARRIAGE_RADIUS_M))
    axes = np.vstack([joint.axes_of_rotation, np.eye(3)])
    for row in sorted(loose, reverse=True):  # places first: they are along the child's axes, however it is turned
        kind, way = ("slide", f"along_{'xyz'[row - 3]}") if row > 2 else ("hinge", f"about_{row}")
        ET.SubElement(carriage, "joint", name=f"{joint.name}_{way}", type=kind, axis=xml_numbers(axes[row]))
    return carriage


def _add_site(element: ET.Element, name: str, segment_T_site: Array) -> None:
    ET.SubElement(element, "site", {"name": name, **_pose(segment_T_site)})


def _pose(pose: Array) -> dict[str, str]:
    x, y, z, w = quaternion_xyzw(pose[:3, :3])
    return {"pos": xml_numbers(pose[:3, 3]), "quat": xml_numbers(np.array([w, x, y, z]))}
