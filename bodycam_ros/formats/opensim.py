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
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BONE_RADIUS_M, JOINT_RADIUS_M, BodyModel, Mass, bone_ends
from bodycam_ros.body.urdf import xml_numbers
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.figure import continuous_angles
from bodycam_ros.formats.markers import Marker, place_markers
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion, change_axes
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces

MODEL_MARK, MODEL_SUFFIX = "<OpenSimDocument", ".osim"
MOTION_MARK = "inDegrees=yes"

OPENSIM_R_OURS = UP_AXES["y"]
"""Of the ground and of every segment (3, 3)."""

_ROOT_ROTATIONS, _ROOT_ORDER = ("rotation", "list", "tilt"), "yxz"
_ROOT_POSITIONS = ("tx", "ty", "tz")
_DENSITY = 1000.0  # [kg / m^3]
_BALL_KG = _DENSITY * 4.0 / 3.0 * np.pi * JOINT_RADIUS_M**3
_BALL = Mass(_BALL_KG, np.zeros(3), 0.4 * _BALL_KG * JOINT_RADIUS_M**2 * np.eye(3))
_VERSION = "40000"
_WIDE_RAD, _WIDE_M = 100.0, 1000.0  # ranges of what has no limit; OpenSim wants some
_X, _Y, _Z = np.eye(3)
_Axis = tuple[str, Array]
"""Coordinate that moves along or about an axis, or "" if none does, and the axis."""


def write_mot(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """The motion as a MOT file, and its model."""
    root = motion.body.root
    joints = {name for j in motion.body.tree_joints if j.child in motion.body_segments for name in j.angle_names}
    columns = [column for column, name in enumerate(motion.angle_names) if name in joints]
    rotations = change_axes(OPENSIM_R_OURS, motion.world_T_root[:, None, :3, :3])
    numbers = np.column_stack(
        [
            motion.seconds,
            np.degrees(continuous_angles((_ROOT_ORDER,), rotations)[:, 0]),
            motion.world_T_root[:, :3, 3] @ OPENSIM_R_OURS.T,
            np.degrees(motion.angles[:, columns]),
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
        "\t".join(["time", *root_names, *(motion.angle_names[column] for column in columns)]),
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
    document = ET.Element("OpenSimDocument", Version=_VERSION)
    model = ET.SubElement(document, "Model", name=body.name)
    _add(model, "gravity", "0 -9.80665 0")
    _add(model, "length_units", "meters")
    _add(model, "force_units", "N")
    bodies, joints = _objects(model, "BodySet"), _objects(model, "JointSet")
    surfaces = capsule_surfaces(body)
    for segment in segments:
        mesh = surfaces.get(segment)
        _add_body(bodies, body, segment, _BALL if mesh is None else _mesh_mass(mesh.vertices, mesh.faces))
    _add_root(joints, body.root)
    for joint in body.tree_joints:
        if joint.child in segments:
            _add_joint(joints, joint)
    marker_set = _objects(model, "MarkerSet")
    for marker in markers:
        element = ET.SubElement(marker_set, "Marker", name=marker.name)
        _add(element, "socket_parent_frame", f"/bodyset/{marker.segment}")
        _add(element, "location", _position(marker.at))
        _add(element, "fixed", "true")
    ET.indent(document)
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, encoding="unicode") + "\n"


def _mesh_mass(vertices: Array, faces: NDArray[np.int32]) -> Mass:
    """Mass of closed surfaces with vertices (V, 3) and faces (F, 3), filled with water."""
    from trimesh import Trimesh

    mesh = Trimesh(vertices, faces, process=False)
    mesh.density = _DENSITY
    return Mass(float(mesh.mass), np.asarray(mesh.center_mass), np.asarray(mesh.moment_inertia))


def _check_names(names: Sequence[str]) -> None:
    """OpenSim separates paths by slashes, columns and lists by spaces."""
    if wrong := [name for name in names if "/" in name or name.split() != [name]]:
        raise BodyError(f"names in OpenSim have no spaces or slashes, but {', '.join(wrong)} has; rename it")


def _add_body(bodies: ET.Element, body: BodyModel, segment: str, mass: Mass) -> None:
    element = ET.SubElement(bodies, "Body", name=segment)
    bones = ET.SubElement(element, "components")
    for number, end in enumerate(bone_ends(body, segment)):
        frame = ET.SubElement(bones, "PhysicalOffsetFrame", name=f"{segment}_bone_{number}")
        length = float(np.linalg.norm(end))
        cylinder = ET.SubElement(ET.SubElement(frame, "attached_geometry"), "Cylinder", name="bone")
        _add(cylinder, "socket_frame", "..")
        _add(cylinder, "radius", str(BONE_RADIUS_M))
        _add(cylinder, "half_height", xml_numbers(np.array([length / 2.0])))
        _add(frame, "socket_parent", f"/bodyset/{segment}")
        _add(frame, "translation", _position(end / 2.0))
        along_y = scipy.spatial.transform.Rotation.align_vectors((OPENSIM_R_OURS @ end / length)[None], _Y[None])[0]
        _add(frame, "orientation", _body_fixed(np.asarray(along_y.as_matrix())))
    sphere = ET.SubElement(ET.SubElement(element, "attached_geometry"), "Sphere", name="joint")
    _add(sphere, "socket_frame", "..")
    _add(sphere, "radius", str(JOINT_RADIUS_M))
    _add(element, "mass", xml_numbers(np.array([mass.kilograms])))
    _add(element, "mass_center", _position(mass.centre))
    inertia = change_axes(OPENSIM_R_OURS, mass.inertia)
    _add(element, "inertia", xml_numbers(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]))


def _add_root(joints: ET.Element, root: str) -> None:
    """A joint that moves freely on the ground."""
    element = ET.SubElement(joints, "CustomJoint", name=f"ground_{root}")
    rotations = [(f"{root}_{name}", axis) for name, axis in zip(_ROOT_ROTATIONS, (_Y, _X, _Z), strict=True)]
    positions = [(f"{root}_{name}", axis) for name, axis in zip(_ROOT_POSITIONS, (_X, _Y, _Z), strict=True)]
    _add_frames(element, ("ground", "/ground", np.eye(4)), (root, f"/bodyset/{root}", np.eye(4)))
    coordinates = ET.SubElement(element, "coordinates")
    for name, _ in rotations:
        _add_coordinate(coordinates, name, (-_WIDE_RAD, _WIDE_RAD))
    for name, _ in positions:
        _add_coordinate(coordinates, name, (-_WIDE_M, _WIDE_M))
    _add_transform(element, rotations, positions)


def _add_joint(joints: ET.Element, joint: Joint) -> None:
    element = ET.SubElement(joints, "WeldJoint" if joint.type == "weld" else "CustomJoint", name=joint.name)
    _add_frames(
        element,
        (joint.parent, f"/bodyset/{joint.parent}", joint.parent_T_joint),
        (joint.child, f"/bodyset/{joint.child}", joint.child_T_joint),
    )
    if joint.type == "weld":
        return
    coordinates = ET.SubElement(element, "coordinates")
    unknown = ((-_WIDE_RAD, _WIDE_RAD),) * len(joint.angle_names)
    for name, limits in zip(joint.angle_names, joint.limits or unknown, strict=True):
        _add_coordinate(coordinates, name, limits)
    axes = joint.axes_of_rotation if joint.type == "hinge" else np.eye(3)[["xyz".index(a) for a in joint.angle_axes]]
    named = (*joint.angle_names, "", "")[:3]
    about = [(name, OPENSIM_R_OURS @ axis) for name, axis in zip(named, axes, strict=True)]
    _add_transform(element, about, [("", _X), ("", _Y), ("", _Z)])


_End = tuple[str, str, Array]
"""Name of a frame's body, its path, and the frame on it in our axes (4, 4) [m]."""


def _add_frames(element: ET.Element, parent: _End, child: _End) -> None:
    _add(element, "socket_parent_frame", f"{parent[0]}_offset")
    _add(element, "socket_child_frame", f"{child[0]}_offset")
    frames = ET.SubElement(element, "frames")
    for name, path, pose in (parent, child):
        frame = ET.SubElement(frames, "PhysicalOffsetFrame", name=f"{name}_offset")
        _add(frame, "socket_parent", path)
        _add(frame, "translation", _position(pose[:3, 3]))
        _add(frame, "orientation", _body_fixed(change_axes(OPENSIM_R_OURS, pose[:3, :3])))


def _add_coordinate(coordinates: ET.Element, name: str, limits: tuple[float, float]) -> None:
    """Limits are shown, not kept: a range of motion is what a person did on one day."""
    element = ET.SubElement(coordinates, "Coordinate", name=name)
    _add(element, "default_value", "0")
    _add(element, "range", xml_numbers(np.array(limits)))
    _add(element, "clamped", "false")


def _add_transform(element: ET.Element, rotations: list[_Axis], positions: list[_Axis]) -> None:
    transform = ET.SubElement(element, "SpatialTransform")
    for kind, moving in (("rotation", rotations), ("translation", positions)):
        for number, (coordinate, axis) in enumerate(moving, start=1):
            along = ET.SubElement(transform, "TransformAxis", name=f"{kind}{number}")
            _add(along, "coordinates", coordinate)
            _add(along, "axis", xml_numbers(axis))
            if coordinate:
                _add(ET.SubElement(along, "LinearFunction", name="function"), "coefficients", "1 0")
            else:
                _add(ET.SubElement(along, "Constant", name="function"), "value", "0")


def _objects(model: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects")


def _add(element: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(element, tag).text = text


def _position(ours: Array) -> str:
    return xml_numbers(OPENSIM_R_OURS @ ours)


def _body_fixed(R: Array) -> str:
    """A frame's orientation as OpenSim has it: angles about x, then y, then z of the frame [rad]."""
    return xml_numbers(np.asarray(scipy.spatial.transform.Rotation.from_matrix(R).as_euler("XYZ"), dtype=np.float64))
