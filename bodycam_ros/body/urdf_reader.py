"""A body from URDF: the inverse of ``urdf``.

URDF carries segments, tree joints with their limits, and camera mounts; the joints that close loops, and what stands,
come along in elements of our own. It cannot carry own sigmas of tree joints, and the report; a body that must keep
these is kept as YAML. Joints come in the order of the tree, those that close loops last.
Links and joints are identified by the names and the structure that ``urdf`` gives them, so a document that another
program wrote out again, with other visuals or without, reads as the same body.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.body_yaml import joints_from_yaml
from bodycam_ros.body.urdf import CAMERA_SUFFIX, WITHIN_A_TURN
from bodycam_ros.body.urdf_document import LOOPS, UrdfDocument, UrdfJoint
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kinematics.joint import Joint

_EXACT = 1e-9  # rounding of the document
_SLIDES = {(): "weld", (False,): "hinge", (False,) * 3: "ball", (True,) * 3 + (False,) * 3: "free"}
"""Whether each moving URDF joint of a joint slides -> its type."""


def body_from_urdf(text: str) -> BodyModel:
    """The body that a URDF document describes.

    Raises:
        BodyError: not a URDF, or one of something else than a body of ours; the message names the joint or link.
    """
    document = UrdfDocument.parse(text)
    if not document.name:
        raise BodyError("the robot has no name")
    # Links inside a joint: between the angles of one, or between a joint and a child frame that is turned.
    inner = {
        joint.child
        for joint in document.joints
        if (joint.axis is not None and joint.child == f"{joint.name}_link") or joint.child.endswith("_joint_frame")
    } - document.drawn
    segments = [link for link in document.links if link not in inner and not link.endswith(CAMERA_SUFFIX)]
    if document.root not in segments:
        raise BodyError(f"root link {document.root} is named as a camera or as the inside of a joint")
    below: dict[str, list[UrdfJoint]] = defaultdict(list)
    for joint in document.joints:
        below[joint.parent].append(joint)
    joints, mounts = [], {}
    for first in document.joints:
        if first.parent in inner or first.parent.endswith(CAMERA_SUFFIX):
            continue
        chain = [first]
        while (link := chain[-1].child) in inner:
            if len(below[link]) != 1:
                raise BodyError(
                    f"joint {first.name}: {len(below[link])} joints hang on link {link}, which is inside a joint of a "
                    "body; expected one, which leads on to the joint's child"
                )
            chain += below[link]
        if not link.endswith(CAMERA_SUFFIX):
            joints.append(_joint(chain))
        elif len(chain) > 1 or first.axis is not None:
            raise BodyError(f"link {link}: a camera is fixed to its segment, by one joint")
        else:
            mounts[link.removesuffix(CAMERA_SUFFIX)] = CameraMount(first.parent, first.parent_T_joint)
    try:
        loops = joints_from_yaml(document.loops) if document.loops.strip() else ()
    except BodyError as error:
        raise BodyError(f"<{LOOPS}>: {error}") from error
    return BodyModel(
        name=document.name,
        root=document.root,
        segments=tuple(segments),
        joints=(*joints, *loops),
        mounts=mounts,
        standing=document.standing,
    )


def _joint(chain: Sequence[UrdfJoint]) -> Joint:
    """The joint of a chain: its angles, then at most one fixed joint to a child frame that is not the joint's."""
    moving = [joint for joint in chain if joint.axis is not None]
    kind = _SLIDES.get(tuple(joint.slides for joint in moving))
    # A weld's first joint is the weld itself.
    own = max(len(moving), 1)
    after = [joint for joint in chain[own:] if joint.axis is None]
    if kind is None or len(after) > 1 or own + len(after) != len(chain):
        kinds = ", ".join(f"{joint.name} {_motion(joint)}" for joint in chain)
        raise BodyError(
            f"between segments {chain[0].parent} and {chain[-1].child} there are joints {kinds}; a body has balls "
            "(three turning), hinges (one turning), welds (one fixed) and free joints (three sliding, three turning), "
            "and after any a fixed one at most"
        )
    place: dict[str, Any] = {
        "parent": chain[0].parent,
        "child": chain[-1].child,
        "parent_T_joint": chain[0].parent_T_joint,
        "child_T_joint": inverse(after[0].parent_T_joint) if after else np.eye(4),
    }
    if kind == "weld":
        return Joint(name=chain[0].name, type="weld", **place)
    if kind == "hinge":
        limits = None if moving[0].limits is None else (moving[0].limits,)
        return Joint(name=moving[0].name, type="hinge", **place, axis=_axis(moving[0]), limits=limits)
    if kind == "ball":
        return _ball(moving, place)
    sliding, ball = moving[:3], _ball(moving[3:], place)
    names = [f"{ball.name}_at_{axis}" for axis in "xyz"]
    unturned = all(_is_identity(joint.parent_T_joint) for joint in moving[1:4])
    if [joint.name for joint in sliding] != names or not unturned or "".join(map(_letter, sliding)) != "xyz":
        raise BodyError(
            f"joints {', '.join(joint.name for joint in moving)}: a free joint slides along x, y and z, unturned, and "
            "then turns as a ball does; all are named FREE_at_x ... FREE_y ..."
        )
    return replace(ball, type="free", sigmas=None, limits=None)


def _motion(joint: UrdfJoint) -> str:
    return "fixed" if joint.axis is None else "sliding" if joint.slides else "turning"


def _ball(angles: Sequence[UrdfJoint], place: dict[str, Any]) -> Joint:
    names = [joint.name for joint in angles]
    axes = "".join(_letter(joint) for joint in angles)
    name = names[0].removesuffix(f"_{axes[0]}")
    if names != [f"{name}_{axis}" for axis in axes]:
        raise BodyError(
            f"joints {', '.join(names)}: a ball's angles about {', '.join(axes)} are named BALL_{axes[0]} ..."
        )
    if any(not _is_identity(joint.parent_T_joint) for joint in angles[1:]):
        raise BodyError(f"joints {', '.join(names)}: the three axes of a ball meet in one point, unturned")
    bounds = [joint.limits or WITHIN_A_TURN for joint in angles]
    unknown = all(np.allclose(pair, WITHIN_A_TURN, rtol=0.0, atol=_EXACT) for pair in bounds)
    return Joint(name=name, type="ball", angle_axes=axes, limits=None if unknown else tuple(bounds), **place)


def _letter(joint: UrdfJoint) -> str:
    """The axis x, y or z that an angle of a ball turns about, or a place slides along."""
    axis = _axis(joint)
    found = [letter for letter, unit in zip("xyz", np.eye(3), strict=True) if np.allclose(axis, unit, atol=_EXACT)]
    if not found:
        does = "a place slides along" if joint.slides else "an angle of a ball turns about"
        raise BodyError(f"joint {joint.name}: {does} x, y or z, not {axis.tolist()}")
    return found[0]


def _axis(joint: UrdfJoint) -> Array:
    assert joint.axis is not None  # of a joint that turns
    return joint.axis


def _is_identity(pose: Array) -> bool:
    return bool(np.allclose(pose, np.eye(4), rtol=0.0, atol=_EXACT))
