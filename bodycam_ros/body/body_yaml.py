"""The body as YAML, for a person to read and to mend.

::

    name: subject
    root: pelvis
    segments: [pelvis, thigh_left, shin_left]
    joints:
      hip_left: {parent: pelvis, child: thigh_left, type: ball, origin_in_parent: [0.0, 0.095, 0.0], angle_axes: yzx}
      knee_left: {parent: thigh_left, child: shin_left, type: hinge, origin_in_parent: [0.0, 0.0, -0.426],
        axis: [0.0, 1.0, 0.0], limits: [0.0, 2.6]}
    cameras:
      waist_front: {segment: pelvis, position: [0.144, -0.006, 0.043], quaternion_xyzw: [-0.49, 0.48, -0.58, 0.44]}
    standing: [frame]  # if any: segments of a machine that do not move in the world, for other programs
    surface: meshes  # if any: a folder beside this file, with an OBJ or PLY file a segment, for static cameras
    girths: {thigh_left: 1.08}  # if any: times as thick as people of its size, of capsules for static cameras
    report: {anything: kept as it is, never used}

========================= ============================================================================================
of a joint
========================= ============================================================================================
parent, child             segments; the joint that is first to name a child hangs it on its parent, later ones close
                          loops
type                      ball, hinge, weld or free, which holds nothing: its child is a machine that stands beside the
                          body
origin_in_parent          [x, y, z] of the joint in the parent segment [m]
orientation_in_parent     quaternion x y z w of the joint's axes in the parent segment; default: the segment's axes
origin_in_child           [x, y, z] of the joint in the child segment [m]; default: the child's origin
orientation_in_child      quaternion x y z w of the joint's axes in the child segment; default: the segment's axes
axis                      of a hinge: its direction in the joint's axes
angle_axes                of a ball or a free joint: the intrinsic order of its three angles, the child's long axis in
                          the middle; default yzx
limits                    of a hinge [low, high], of a ball three such pairs in the order of angle_axes [rad];
                          default: unknown
sigmas                    6 numbers, rotation [rad] then translation [m], instead of those of the type; a hinge's
                          rotations: about its axis first, then across
========================= ============================================================================================

A camera's position [m] and quaternion are ``segment_T_camera``, of its optical frame (x right, y down, z forward). What
the range of motion measured of its rows may follow: ``readout_time``, from the first to the last [s], and
``readout_sigma``, its standard deviation [s]; without one, or with 0, the read-out time is taken as it is. It holds in
the video mode ``readout_mode`` (width, height and focal length [px], images a second); in another it is a rough start.
The calibration of its inertial sensor follows as ``imu`` (``imu_yaml``).
"""

import math
from collections.abc import Iterable, Set
from textwrap import indent
from typing import Any

import numpy as np
import yaml

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.checked_fields import check_keys, name_of, numbers_of, pose_of
from bodycam_ros.body.imu_yaml import imu_entry, imu_of
from bodycam_ros.camera.readout import LONGEST_READOUT_S, Readout, VideoMode
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.kinematics.joint import LONG_AXIS_Z, Joint, default_sigmas
from bodycam_ros.shown import shown
from bodycam_ros.yaml_file import yaml_document

_DECIMALS = 9  # 1 nm, 1 nrad
_MOST_PARTS = 1000  # joints, segments, cameras

_BODY_KEYS = {"name", "root", "segments", "joints", "cameras"}
_JOINT_KEYS = {"parent", "child", "type", "origin_in_parent"}
_JOINT_PLACES = {"orientation_in_parent", "origin_in_child", "orientation_in_child"}
_JOINT_OPTIONS = {"axis", "angle_axes", "limits", "sigmas", *_JOINT_PLACES}
_CAMERA_KEYS = {"segment", "position", "quaternion_xyzw"}
_READOUT_KEYS = {"readout_time", "readout_sigma", "readout_mode"}


def body_from_yaml(text: str) -> BodyModel:
    """The body that a YAML document describes.

    Raises:
        BodyError: it is not YAML, or describes no body; the message names the place in it.
    """
    return _body(yaml_document(text, "body file", BodyError))


def joints_from_yaml(text: str) -> tuple[Joint, ...]:
    """The joints that a YAML document holds, a table of them as in a body file.

    Raises:
        BodyError: it is not YAML, or describes no joints; the message names the place in it.
    """
    return _joints(yaml_document(text, "table of joints", BodyError))


def joints_text(joints: Iterable[Joint]) -> str:
    """Joints as YAML, a line each: a body file's table of them."""
    return "".join(f"{_line(joint.name)}: {_line(_joint_entry(joint))}\n" for joint in joints)


def yaml_text(body: BodyModel) -> str:
    """The body as YAML, a line per joint and per camera."""
    parts = [f"name: {_line(body.name)}\n", f"root: {_line(body.root)}\n", f"segments: {_line(list(body.segments))}\n"]
    parts.append("joints:\n" if body.joints else "joints: {}\n")
    parts.append(indent(joints_text(body.joints), "  "))
    parts.append("cameras:\n" if body.mounts else "cameras: {}\n")
    parts += [f"  {_line(camera)}: {_line(_mount_entry(mount))}\n" for camera, mount in body.mounts.items()]
    if body.standing:
        parts.append(f"standing: {_line(list(body.standing))}\n")
    if body.surface is not None:
        parts.append(f"surface: {_line(body.surface)}\n")
    if body.girths:
        parts.append(f"girths: {_line({name: round(girth, _DECIMALS) for name, girth in body.girths.items()})}\n")
    if body.report:
        parts.append(yaml.safe_dump({"report": dict(body.report)}, sort_keys=False, default_flow_style=None))
    return "".join(parts)


def _body(document: Any) -> BodyModel:
    check_keys(document, "a body file", _BODY_KEYS, {"report", "standing", "surface", "girths"})
    joints, cameras = document["joints"], document["cameras"]
    _check_table(cameras, "cameras")
    report = document.get("report") or {}
    if not isinstance(report, dict):
        raise BodyError(f"report must be a table, not {shown(report)}")
    segments = document["segments"]
    if not isinstance(segments, list) or len(segments) > _MOST_PARTS:
        raise BodyError(f"segments must be a list of at most {_MOST_PARTS} names, not {shown(segments)}")
    standing = document.get("standing") or []
    if not isinstance(standing, list):
        raise BodyError(f"standing must be a list of segments, not {shown(standing)}")
    girths = document.get("girths") or {}
    _check_table(girths, "girths")
    return BodyModel(
        name=name_of(document["name"], "name"),
        root=name_of(document["root"], "root"),
        segments=tuple(name_of(segment, "segments") for segment in segments),
        joints=_joints(joints),
        mounts={name_of(name, "cameras"): mount_of(name, entry) for name, entry in cameras.items()},
        report=report,
        standing=tuple(name_of(segment, "standing") for segment in standing),
        surface=name_of(document["surface"], "surface") if document.get("surface") is not None else None,
        girths={
            name_of(segment, "girths"): float(numbers_of([girth], 1, f"girths: {shown(segment)}")[0])
            for segment, girth in girths.items()
        },
    )


def _joints(table: Any) -> tuple[Joint, ...]:
    _check_table(table, "joints")
    return tuple(joint_of(name_of(name, "joints"), entry) for name, entry in table.items())


def _check_table(table: Any, name: str) -> None:
    if not isinstance(table, dict):
        raise BodyError(f"{name} must be a table of names, not {shown(table)}; write {{}} for none")
    if len(table) > _MOST_PARTS:
        raise BodyError(f"{name}: {len(table)} are more than a body has; at most {_MOST_PARTS}")


def joint_of(name: str, entry: Any, further_keys: Set[str] = frozenset()) -> Joint:
    """The joint that a table describes; ``further_keys`` of it are for other readers.

    Raises:
        BodyError: it describes none; the message names the joint.
    """
    where = f"joint {name}"
    check_keys(entry, where, _JOINT_KEYS, _JOINT_OPTIONS | further_keys)
    if entry["type"] == "hinge" and "axis" not in entry:
        raise BodyError(f"{where}: a hinge needs its axis, such as [0.0, 1.0, 0.0]")
    options: dict[str, Any] = {}
    if "axis" in entry:
        options["axis"] = numbers_of(entry["axis"], 3, f"{where}: axis")
    if "sigmas" in entry:
        options["sigmas"] = tuple(numbers_of(entry["sigmas"], 6, f"{where}: sigmas").tolist())
    if "limits" in entry:
        options["limits"] = _limits(entry["limits"], f"{where}: limits")
    return Joint(
        name=name,
        parent=name_of(entry["parent"], f"{where}: parent"),
        child=name_of(entry["child"], f"{where}: child"),
        type=entry["type"],
        parent_T_joint=pose_of(entry, "origin_in_parent", "orientation_in_parent", where),
        child_T_joint=pose_of(entry, "origin_in_child", "orientation_in_child", where),
        angle_axes=name_of(entry.get("angle_axes", LONG_AXIS_Z), f"{where}: angle_axes"),
        **options,
    )


def mount_of(name: str, entry: Any) -> CameraMount:
    """The place of a camera that a table describes.

    Raises:
        BodyError: it describes none; the message names the camera.
    """
    where = f"camera {name}"
    check_keys(entry, where, _CAMERA_KEYS, {*_READOUT_KEYS, "imu"})
    return CameraMount(
        name_of(entry["segment"], f"{where}: segment"),
        pose_of(entry, "position", "quaternion_xyzw", where),
        _readout(entry, where),
        _readout_mode(entry, where),
        imu_of(entry["imu"], f"{where}: imu") if entry.get("imu") is not None else None,
    )


def _readout(entry: dict[str, Any], where: str) -> Readout | None:
    if "readout_time" not in entry:
        if "readout_sigma" in entry:
            raise BodyError(f"{where}: readout_sigma is the sigma of readout_time, which is missing")
        return None
    pair = [entry["readout_time"], entry.get("readout_sigma", 0.0)]
    seconds, sigma = numbers_of(pair, 2, f"{where}: readout_time and readout_sigma, together,").tolist()
    if abs(seconds) > LONGEST_READOUT_S or sigma < 0.0:
        raise BodyError(
            f"{where}: rows that are read out in {seconds:g} s, give or take {sigma:g} s; expected at most "
            f"{LONGEST_READOUT_S:g} s, and a sigma of 0 (exact) or more"
        )
    return Readout(seconds, sigma)


def _readout_mode(entry: dict[str, Any], where: str) -> VideoMode | None:
    if "readout_mode" not in entry:
        return None
    numbers = numbers_of(
        entry["readout_mode"], 4, f"{where}: readout_mode (width, height, focal length, rate)"
    ).tolist()
    if min(numbers) <= 0.0:
        raise BodyError(
            f"{where}: readout_mode {numbers} must be positive: width, height, focal length [px], rate [Hz]"
        )
    return VideoMode(round(numbers[0]), round(numbers[1]), numbers[2], numbers[3])


def _limits(value: Any, where: str) -> tuple[tuple[float, float], ...]:
    pairs = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    return tuple((float(low), float(high)) for low, high in (numbers_of(pair, 2, where) for pair in pairs))


def _line(value: Any) -> str:
    text: str = yaml.safe_dump(value, sort_keys=False, default_flow_style=True, width=math.inf)
    return text.removesuffix("...\n").strip()  # a bare scalar ends with a document end mark


def _joint_entry(joint: Joint) -> dict[str, Any]:
    entry: dict[str, Any] = {"parent": joint.parent, "child": joint.child, "type": joint.type}
    entry["origin_in_parent"] = _rounded(joint.parent_T_joint[:3, 3])
    if not np.array_equal(joint.parent_T_joint[:3, :3], np.eye(3)):
        entry["orientation_in_parent"] = _rounded(quaternion_xyzw(joint.parent_T_joint[:3, :3]))
    if joint.child_T_joint[:3, 3].any():
        entry["origin_in_child"] = _rounded(joint.child_T_joint[:3, 3])
    if not np.array_equal(joint.child_T_joint[:3, :3], np.eye(3)):
        entry["orientation_in_child"] = _rounded(quaternion_xyzw(joint.child_T_joint[:3, :3]))
    if joint.type == "hinge":
        entry["axis"] = _rounded(joint.axis)
    if joint.type in ("ball", "free"):
        entry["angle_axes"] = joint.angle_axes
    if joint.sigmas != default_sigmas(joint.type):
        entry["sigmas"] = list(joint.sigmas or ())
    if joint.limits is not None:
        pairs = [_rounded(np.array(pair)) for pair in joint.limits]
        entry["limits"] = pairs[0] if joint.type == "hinge" else pairs
    return entry


def _mount_entry(mount: CameraMount) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "segment": mount.segment,
        "position": _rounded(mount.segment_T_camera[:3, 3]),
        "quaternion_xyzw": _rounded(quaternion_xyzw(mount.segment_T_camera[:3, :3])),
    }
    if mount.readout is not None:
        entry["readout_time"], entry["readout_sigma"] = _rounded(np.array([mount.readout.seconds, mount.readout.sigma]))
        if (mode := mount.readout_mode) is not None and not math.isnan(mode.rate):
            entry["readout_mode"] = [mode.width, mode.height, round(mode.focal, 3), round(mode.rate, 3)]
    if mount.imu is not None:
        entry["imu"] = imu_entry(mount.imu)
    return entry


def _rounded(values: Array) -> list[float]:
    # Adding zero turns -0.0 into 0.0.
    return [round(float(value), _DECIMALS) + 0.0 for value in values]
