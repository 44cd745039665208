"""OpenSim: joint angles over time (MOT), and the model that they move: segments, joints, angles and virtual markers.

Coordinates are named as the joint angles and rotate about the same axes in the same order, so a coordinate is a joint
angle [deg]. Six more, ``<root>_tx`` to ``_tz`` [m] and ``<root>_rotation``, ``_list``, ``_tilt``, are the pose of the
root, whose first rotation is about the vertical. Frames are OpenSim's: x forward, y up, z to the right. No muscles;
segments have the density of water. Time is from the first frame on. A gap is interpolated.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import scipy

from bodycam_ros.body.body_model import BONE_RADIUS_M, JOINT_RADIUS_M, BodyModel, Mass, bone_ends
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import Surface
from bodycam_ros.body.urdf import xml_numbers
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.figure import continuous_angles
from bodycam_ros.formats.markers import Marker, place_markers
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion, change_axes
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import Joint

MODEL_MARK, MODEL_SUFFIX = "<OpenSimDocument", ".osim"
MOTION_MARK = "inDegrees=yes"

OPENSIM_R_OURS = UP_AXES["y"]
"""Rotation of the ground and of every segment (3, 3)."""

_ROOT_ROTATIONS, _ROOT_ORDER = ("rotation", "list", "tilt"), "yxz"
_ROOT_POSITIONS = ("tx", "ty", "tz")
_DENSITY = 1000.0  # [kg / m^3]
_BALL_KG = _DENSITY * 4.0 / 3.0 * np.pi * JOINT_RADIUS_M**3
_BALL = Mass(_BALL_KG, np.zeros(3), 0.4 * _BALL_KG * JOINT_RADIUS_M**2 * np.eye(3))
_VERSION = "40000"
_WIDE_RAD, _WIDE_M = 100.0, 1000.0  # ranges of what has no limit; OpenSim wants some
_X, _Y, _Z = np.eye(3)
_FIXED = (0.0, 0.0)
_Axis = tuple[str, Array, tuple[float, float]]
"""Coordinate that moves along or about an axis, or "" if none does, the axis, and the coordinate's limits."""


def write_mot(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """The motion as a MOT file, and its model."""
    root = motion.body.root
    joints = {name for j in motion.body.tree_joints if j.child in motion.body_segments for name in j.angle_names}
    columns = [column for column, name in enumerate(motion.joint_names) if name in joints]
    rotations = change_axes(OPENSIM_R_OURS, motion.world_T_root[:, None, :3, :3])
    numbers = np.column_stack(
        [
            motion.seconds,
            np.degrees(continuous_angles((_ROOT_ORDER,), rotations)[:, 0]),
            motion.world_T_root[:, :3, 3] @ OPENSIM_R_OURS.T,
            np.degrees(motion.joint_angles[:, columns]),
        ]
    )
    root_names = [f"{root}_{name}" for name in (*_ROOT_ROTATIONS, *_ROOT_POSITIONS)]
    header = [
        motion.name,
        "version=1",
        f"nRows={len(numbers)}",
        f"nColumns={numbers.shape[1]}",
        MOTION_MARK,
        "endheader",
        "\t".join(["time", *root_names, *(motion.joint_names[column] for column in columns)]),
    ]
    rows = ["\t".join(map("{:.8f}".format, row)) for row in numbers.tolist()]
    return {"": "\n".join([*header, *rows]) + "\n", MODEL_SUFFIX: model_text(motion, place_markers(motion))}


def model_text(motion: SampledMotion, markers: list[Marker]) -> str:
    """The body of a motion with markers as an OpenSim model.

    Raises:
        BodyError: a name that OpenSim cannot read back.
    """
    body, segments = motion.body, motion.body_segments
    _check_names([*segments, *(joint.name for joint in body.tree_joints if joint.child in segments)])
    surfaces = capsule_surfaces(body)
    joints = [_connect_joint(joint) for joint in body.tree_joints if joint.child in segments]
    spots = [
        _element("Marker", m.name, socket_parent_frame=f"/bodyset/{m.segment}", location=_position(m.at), fixed="true")
        for m in markers
    ]
    model = _element("Model", body.name, gravity="0 -9.80665 0", length_units="meters", force_units="N")
    model.append(_element("BodySet", "bodyset", objects=[_body(body, each, surfaces.get(each)) for each in segments]))
    model.append(_element("JointSet", "jointset", objects=[_connect_root(body.root), *joints]))
    model.append(_element("MarkerSet", "markerset", objects=spots))
    document = ET.Element("OpenSimDocument", Version=_VERSION)
    document.append(model)
    ET.indent(document)
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, encoding="unicode") + "\n"


def _element(tag: str, name: str = "", **content: str | Sequence[ET.Element]) -> ET.Element:
    """An element, of which each keyword is the tag of a child, with text or elements in it."""
    element = ET.Element(tag, {"name": name} if name else {})
    for key, value in content.items():
        child = ET.SubElement(element, key)
        if isinstance(value, str):
            child.text = value
        else:
            child.extend(value)
    return element


def _surface_mass(surface: Surface) -> Mass:
    """Mass of a closed surface that is filled with water."""
    from trimesh import Trimesh

    mesh = Trimesh(surface.vertices, surface.faces, process=False)
    mesh.density = _DENSITY
    return Mass(float(mesh.mass), np.asarray(mesh.center_mass), np.asarray(mesh.moment_inertia))


def _check_names(names: Sequence[str]) -> None:
    """OpenSim separates paths by slashes, columns and lists by spaces."""
    if wrong := [name for name in names if "/" in name or name.split() != [name]]:
        raise BodyError(f"names in OpenSim have no spaces or slashes, but {', '.join(wrong)} has; rename it")


def _body(body: BodyModel, segment: str, surface: Surface | None) -> ET.Element:
    bones = []
    for number, end in enumerate(bone_ends(body, segment)):
        length = float(np.linalg.norm(end))
        half = xml_numbers(np.array([length / 2.0]))
        cylinder = _element("Cylinder", "bone", socket_frame="..", radius=str(BONE_RADIUS_M), half_height=half)
        along_y = scipy.spatial.transform.Rotation.align_vectors((OPENSIM_R_OURS @ end / length)[None], _Y[None])[0]
        frame = _frame(f"{segment}_bone_{number}", segment, end / 2.0, np.asarray(along_y.as_matrix()))
        frame.insert(0, _element("attached_geometry"))
        frame[0].append(cylinder)
        bones.append(frame)
    mass = _BALL if surface is None else _surface_mass(surface)
    inertia = change_axes(OPENSIM_R_OURS, mass.inertia)
    return _element(
        "Body",
        segment,
        components=bones,
        attached_geometry=[_element("Sphere", "joint", socket_frame="..", radius=str(JOINT_RADIUS_M))],
        mass=xml_numbers(np.array([mass.kilograms])),
        mass_center=_position(mass.centre),
        inertia=xml_numbers(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]),
    )


def _connect_root(root: str) -> ET.Element:
    """A joint that moves freely on the ground."""
    turns = [(f"{root}_{name}", axis, _WIDE_RAD) for name, axis in zip(_ROOT_ROTATIONS, (_Y, _X, _Z), strict=True)]
    moves = [(f"{root}_{name}", axis, _WIDE_M) for name, axis in zip(_ROOT_POSITIONS, (_X, _Y, _Z), strict=True)]
    axes = [(name, axis, (-wide, wide)) for name, axis, wide in (*turns, *moves)]
    return _connect("CustomJoint", f"ground_{root}", ("", np.eye(4)), (root, np.eye(4)), axes)


def _connect_joint(joint: Joint) -> ET.Element:
    ends = (joint.parent, joint.parent_T_joint), (joint.child, joint.child_T_joint)
    if joint.type == "weld":
        return _connect("WeldJoint", joint.name, *ends, [])
    axes = joint.axes_of_rotation if joint.type == "hinge" else np.eye(3)[["xyz".index(a) for a in joint.angle_axes]]
    names = (*joint.angle_names, "", "")[:3]
    limits = joint.limits or ((-_WIDE_RAD, _WIDE_RAD),) * 3
    turns = [
        (name, OPENSIM_R_OURS @ axis, limit)
        for name, axis, limit in zip(names, axes, (*limits, _FIXED, _FIXED)[:3], strict=True)
    ]
    return _connect("CustomJoint", joint.name, *ends, [*turns, *(("", axis, _FIXED) for axis in (_X, _Y, _Z))])


_End = tuple[str, Array]
"""A segment, or "" for the ground, and the joint's frame on it in our axes (4, 4) [m]."""


def _connect(kind: str, name: str, parent: _End, child: _End, axes: Sequence[_Axis]) -> ET.Element:
    """A joint with six axes, of which the first three are rotations, or none."""
    sockets = [f"{segment or 'ground'}_offset" for segment, _ in (parent, child)]
    frames = [
        _frame(socket, segment, pose[:3, 3], change_axes(OPENSIM_R_OURS, pose[:3, :3]))
        for socket, (segment, pose) in zip(sockets, (parent, child), strict=True)
    ]
    element = _element(kind, name, socket_parent_frame=sockets[0], socket_child_frame=sockets[1], frames=frames)
    if not axes:
        return element
    # Limits are shown, not kept: a range of motion is what a person did on one day.
    coordinates = [
        _element("Coordinate", name, default_value="0", range=xml_numbers(np.array(limits)), clamped="false")
        for name, _, limits in axes
        if name
    ]
    along = []
    for number, (coordinate, axis, _) in enumerate(axes):
        place = f"{'translation' if number > 2 else 'rotation'}{number % 3 + 1}"
        along.append(_element("TransformAxis", place, coordinates=coordinate, axis=xml_numbers(axis)))
        linear = _element("LinearFunction", "function", coefficients="1 0")
        along[-1].append(linear if coordinate else _element("Constant", "function", value="0"))
    element.extend(_element("_", coordinates=coordinates, SpatialTransform=along))
    return element


def _frame(name: str, segment: str, at: Array, R: Array) -> ET.Element:
    """A frame on a segment, or on the ground, at a place (3,) in our axes [m], turned in OpenSim's (3, 3).

    OpenSim has angles about x, then y, then z of the frame [rad].
    """
    angles = np.asarray(scipy.spatial.transform.Rotation.from_matrix(R).as_euler("XYZ"), np.float64)
    parent = f"/bodyset/{segment}" if segment else "/ground"
    return _element(
        "PhysicalOffsetFrame", name, socket_parent=parent, translation=_position(at), orientation=xml_numbers(angles)
    )


def _position(ours: Array) -> str:
    return xml_numbers(OPENSIM_R_OURS @ ours)
