"""The body as YAML, for a person to read and to mend.

::

    name: subject
    root: pelvis
    segments: [pelvis, thigh_left, shin_left]
    joints:
      hip_left: {parent: pelvis, child: thigh_left, type: ball, origin_in_parent: [0.0, 0.095, 0.0]}
      knee_left: {parent: thigh_left, child: shin_left, type: hinge, origin_in_parent: [0.0, 0.0, -0.426],
        axis: [0.0, 1.0, 0.0], limits: [0.0, 2.6]}
    cameras:
      waist_front: {segment: pelvis, position: [0.144, -0.006, 0.043], quaternion_xyzw: [-0.49, 0.48, -0.58, 0.44]}
    standing: [frame]
    surface: meshes
    girths: {thigh_left: 1.08}
    report: {anything: kept as it is, never used}

The joint that is first to name a child hangs it on its parent, later ones close loops.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from textwrap import indent
from typing import Annotated, Any

import msgspec
import numpy as np
import yaml

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.checked_fields import (
    ORIGIN,
    UNTURNED,
    Entry,
    Name,
    Number,
    Point,
    Quaternion,
    numbers_of,
    pose_of,
    read_entry,
    rounded,
)
from bodycam_ros.camera.readout import LONGEST_READOUT_S, Readout
from bodycam_ros.errors import BodyError
from bodycam_ros.files.yaml_file import yaml_document
from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.kinematics.joint import LONG_AXIS_Z, Joint, JointType, default_sigmas

_MOST_PARTS = 1000  # joints, segments, cameras
_Offset = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # a larger one is no delay of a sensor
_NUMBERS = ("gyro_bias", "gyro_scale", "accelerometer_bias", "accelerometer_scale")
_SIGMAS = ("rotation", "position", "time_offset", "gyro_bias", "gyro_scale", "accelerometer_bias")


class _ImuEntry(Entry):
    position: Point  # of the sensor in the camera's optical frame [m]
    quaternion_xyzw: Quaternion
    time_offset: _Offset  # sensor's stamp minus camera's stamp of the same moment [s]
    gyro_bias: Point  # [rad/s]
    gyro_scale: Point
    accelerometer_bias: Point  # [m/s^2]
    accelerometer_scale: Point
    sigmas: tuple[Number, Number, Number, Number, Number, Number]  # of _SIGMAS [rad], [m], [s], [rad/s], 1, [m/s^2]


_Table = Annotated[dict[Name, Any], msgspec.Meta(max_length=_MOST_PARTS)]


class _BodyEntry(Entry):
    name: Name
    root: Name
    segments: Annotated[list[Name], msgspec.Meta(max_length=_MOST_PARTS)]
    joints: _Table
    cameras: _Table
    report: dict[Any, Any] | None = None
    standing: list[Name] | None = None  # segments of a machine that do not move in the world, for other programs
    surface: Name | None = None  # a folder beside the file, with an OBJ or PLY file a segment, for static cameras
    girths: dict[Name, Number] | None = None  # times as thick as people of its size, of capsules for static cameras


class JointEntry(Entry):
    """A joint: places in metres, quaternions x y z w of its axes."""

    parent: Name
    child: Name
    type: JointType  # free holds nothing: its child is a machine that stands beside the body
    origin_in_parent: Point
    orientation_in_parent: Quaternion = UNTURNED
    origin_in_child: Point = ORIGIN
    orientation_in_child: Quaternion = UNTURNED
    axis: Point | None = None  # of a hinge: its direction in the joint's axes
    angle_axes: Name = LONG_AXIS_Z  # of a ball or a free joint: intrinsic order, the child's long axis in the middle
    sigmas: tuple[Number, Number, Number, Number, Number, Number] | None = None  # as ``Joint.sigmas``
    limits: list[Any] | None = None  # [low, high] of a hinge, of a ball a pair for each of angle_axes [rad]


class _MountEntry(Entry):
    segment: Name
    position: Point  # of the optical frame (x right, y down, z forward) on the segment [m]
    quaternion_xyzw: Quaternion
    readout_time: Annotated[float, msgspec.Meta(ge=-LONGEST_READOUT_S, le=LONGEST_READOUT_S)] | None = None  # [s]
    readout_sigma: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0  # [s]; 0: the read-out time is taken as it is
    readout_mode: Any = None  # of files of older versions
    imu: Any = None


def body_from_yaml(text: str) -> BodyModel:
    """The body that a YAML document describes.

    Raises:
        BodyError: it is not YAML, or describes no body; the message names the place in it.
    """
    body: _BodyEntry = read_entry(_BodyEntry, yaml_document(text, "body file", BodyError), "a body file")
    return BodyModel(
        name=body.name,
        root=body.root,
        segments=tuple(body.segments),
        joints=tuple(
            joint_of(name, read_entry(JointEntry, entry, f"joint {name}")) for name, entry in body.joints.items()
        ),
        mounts={name: mount_of(name, entry) for name, entry in body.cameras.items()},
        report=body.report or {},
        standing=tuple(body.standing or ()),
        surface=body.surface,
        girths=body.girths or {},
    )


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
    girths = dict(zip(body.girths, rounded(np.array(list(body.girths.values()))), strict=True))
    for name, value in (("standing", list(body.standing)), ("surface", body.surface), ("girths", girths)):
        if value:
            parts.append(f"{name}: {_line(value)}\n")
    if body.report:
        parts.append(yaml.safe_dump({"report": dict(body.report)}, sort_keys=False, default_flow_style=None))
    return "".join(parts)


def joint_of(name: str, entry: JointEntry) -> Joint:
    """The joint that an entry describes.

    Raises:
        BodyError: it describes none; the message names the joint.
    """
    where = f"joint {name}"
    if entry.type == "hinge" and entry.axis is None:
        raise BodyError(f"{where}: a hinge needs its axis, such as [0.0, 1.0, 0.0]")
    pairs = entry.limits if entry.limits and isinstance(entry.limits[0], list) else [entry.limits]
    limits = None if entry.limits is None else [numbers_of(pair, 2, f"{where}: limits").tolist() for pair in pairs]
    return Joint(
        name=name,
        parent=entry.parent,
        child=entry.child,
        type=entry.type,
        parent_T_joint=pose_of(entry.origin_in_parent, entry.orientation_in_parent, f"{where}: orientation_in_parent"),
        child_T_joint=pose_of(entry.origin_in_child, entry.orientation_in_child, f"{where}: orientation_in_child"),
        angle_axes=entry.angle_axes,
        sigmas=entry.sigmas,
        limits=None if limits is None else tuple((low, high) for low, high in limits),
        **({} if entry.axis is None else {"axis": np.array(entry.axis)}),
    )


def mount_of(name: str, entry: Any) -> CameraMount:
    """The place of a camera that a table describes.

    Raises:
        BodyError: it describes none; the message names the camera.
    """
    where = f"camera {name}"
    mount: _MountEntry = read_entry(_MountEntry, entry, where)
    if mount.readout_sigma and mount.readout_time is None:
        raise BodyError(f"{where}: readout_sigma is the sigma of readout_time, which is missing")
    return CameraMount(
        mount.segment,
        pose_of(mount.position, mount.quaternion_xyzw, f"{where}: quaternion_xyzw"),
        None if mount.readout_time is None else Readout(mount.readout_time, mount.readout_sigma),
        None if mount.imu is None else imu_of(mount.imu, f"{where}: imu"),
    )


def _line(value: Any) -> str:
    text: str = yaml.safe_dump(value, sort_keys=False, default_flow_style=True, width=math.inf)
    return text.removesuffix("...\n").strip()  # a bare scalar ends with a document end mark


def _unless(default: Any, values: Array) -> Any:
    """Rounded numbers; where they are the default the default itself, which msgspec then leaves out."""
    numbers = rounded(values)
    return default if numbers == default else numbers


def _joint_entry(joint: Joint) -> Any:
    limits = None if joint.limits is None else [rounded(np.array(pair)) for pair in joint.limits]
    entry = JointEntry(
        parent=joint.parent,
        child=joint.child,
        type=joint.type,
        origin_in_parent=rounded(joint.parent_T_joint[:3, 3]),
        orientation_in_parent=_unless(UNTURNED, quaternion_xyzw(joint.parent_T_joint[:3, :3])),
        origin_in_child=_unless(ORIGIN, joint.child_T_joint[:3, 3]),
        orientation_in_child=_unless(UNTURNED, quaternion_xyzw(joint.child_T_joint[:3, :3])),
        axis=rounded(joint.axis) if joint.type == "hinge" else None,
        angle_axes=joint.angle_axes,
        sigmas=None if joint.sigmas == default_sigmas(joint.type) else joint.sigmas,  # type: ignore[arg-type]
        limits=list(limits[0]) if limits and joint.type == "hinge" else limits,
    )
    return msgspec.to_builtins(entry)


def _mount_entry(mount: CameraMount) -> Any:
    readout = mount.readout
    seconds, sigma = (0.0, 0.0) if readout is None else rounded(np.array([readout.seconds, readout.sigma]))
    entry = _MountEntry(
        segment=mount.segment,
        position=rounded(mount.segment_T_camera[:3, 3]),
        quaternion_xyzw=rounded(quaternion_xyzw(mount.segment_T_camera[:3, :3])),
        readout_time=None if readout is None else seconds,
        readout_sigma=sigma,
        imu=None if mount.imu is None else imu_entry(mount.imu),
    )
    return msgspec.to_builtins(entry)


def imu_of(entry: Any, where: str) -> ImuCalibration:
    """The calibration that a table describes.

    Raises:
        BodyError: it describes none; the message begins with ``where``.
    """
    imu: _ImuEntry = read_entry(_ImuEntry, entry, where)
    if min(*imu.sigmas, *imu.gyro_scale, *imu.accelerometer_scale) <= 0.0:
        raise BodyError(f"{where}: sigmas and scales must be positive")
    camera_T_imu = pose_of(imu.position, imu.quaternion_xyzw, f"{where}: quaternion_xyzw")
    values: dict[str, Any] = {name: np.array(getattr(imu, name)) for name in _NUMBERS}
    values |= {f"{name}_sigma": sigma for name, sigma in zip(_SIGMAS, imu.sigmas, strict=True)}
    return replace(ImuCalibration(camera_T_imu[:3, :3], camera_T_imu[:3, 3], imu.time_offset), **values)


def imu_entry(imu: ImuCalibration) -> dict[str, Any]:
    """A calibration as a table."""
    entry = _ImuEntry(
        position=rounded(imu.camera_p_imu),
        quaternion_xyzw=rounded(quaternion_xyzw(imu.camera_R_imu)),
        time_offset=rounded(np.array([imu.time_offset]))[0],
        sigmas=rounded(np.array([getattr(imu, f"{name}_sigma") for name in _SIGMAS])),
        **{name: rounded(getattr(imu, name)) for name in _NUMBERS},
    )
    table: dict[str, Any] = msgspec.to_builtins(entry)
    return table
