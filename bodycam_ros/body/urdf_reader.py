"""A body from URDF: what ``urdf`` wrote, read back.

URDF carries segments, tree joints with their limits, and camera mounts; the joints that close loops, and what stands,
come along in elements of our own. It cannot carry own sigmas of tree joints, and the report; a body that must keep
these is kept as YAML. Joints come in the order of the tree, those that close loops last.
Links and joints are told apart by the names and the structure that ``urdf`` gives them, so a document that another
program wrote out again, with other visuals or without, reads as the same body.
"""

from collections import defaultdict
from collections.abc import Sequence, Set
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
_INNER_LINK, _CHILD_FRAME = "_link", "_joint_frame"
_SLIDES = {"weld": [], "hinge": [False], "ball": [False] * 3, "free": [True] * 3 + [False] * 3}
"""Joint type -> whether each of its moving URDF joints slides."""


def body_from_urdf(text: str) -> BodyModel:
    """The body that a URDF document describes.

    Raises:
        BodyError: not a URDF, or one of something else than a body of ours; the message names the joint or link.
    """
    document = UrdfDocument.parse(text)
    return _Structure(document, _inner_links(document.joints) - document.drawn).body()


def _inner_links(joints: Sequence[UrdfJoint]) -> set[str]:
    """Links inside a joint: between the angles of one, or between a joint and a child frame that is turned."""
    after_angle = {
        joint.child for joint in joints if joint.axis is not None and joint.child == f"{joint.name}{_INNER_LINK}"
    }
    return after_angle | {joint.child for joint in joints if joint.child.endswith(_CHILD_FRAME)}


class _Structure:
    """What the joints of a document stand for, given which links are inside a joint."""

    def __init__(self, document: UrdfDocument, inner: Set[str]) -> None:
        self._document = document
        self._inner = inner
        self._below: dict[str, list[UrdfJoint]] = defaultdict(list)
        for joint in document.joints:
            self._below[joint.parent].append(joint)

    def body(self) -> BodyModel:
        document = self._document
        if not document.name:
            raise BodyError("the robot has no name")
        segments = [link for link in document.links if link not in self._inner and not link.endswith(CAMERA_SUFFIX)]
        if document.root not in segments:
            raise BodyError(f"root link {document.root} is named as a camera or as the inside of a joint")
        carrying = set(segments)
        chains = [self._chain(joint) for joint in document.joints if joint.parent in carrying]
        mounts = {
            chain[0].child.removesuffix(CAMERA_SUFFIX): CameraMount(chain[0].parent, chain[0].parent_T_joint)
            for chain in chains
            if _is_camera(chain)
        }
        return BodyModel(
            name=document.name,
            root=document.root,
            segments=tuple(segments),
            joints=(*(_joint(chain) for chain in chains if not _is_camera(chain)), *_loops(document)),
            mounts=mounts,
            standing=document.standing,
        )

    def _chain(self, first: UrdfJoint) -> list[UrdfJoint]:
        """The joints from one segment to the next, or to a camera."""
        chain = [first]
        while (link := chain[-1].child) in self._inner:
            following = self._below[link]
            if len(following) != 1:
                raise BodyError(
                    f"joint {first.name}: {len(following)} joints hang on link {link}, which is inside a joint of a "
                    "body; expected one, which leads on to the joint's child"
                )
            chain += following
        return chain


def _loops(document: UrdfDocument) -> tuple[Joint, ...]:
    if not document.loops.strip():
        return ()
    try:
        return joints_from_yaml(document.loops)
    except BodyError as error:
        raise BodyError(f"<{LOOPS}>: {error}") from error


def _is_camera(chain: Sequence[UrdfJoint]) -> bool:
    if not chain[-1].child.endswith(CAMERA_SUFFIX):
        return False
    if len(chain) > 1 or chain[0].axis is not None:
        raise BodyError(f"link {chain[-1].child}: a camera is fixed to its segment, by one joint")
    return True


def _joint(chain: Sequence[UrdfJoint]) -> Joint:
    """The joint that a chain stands for: angles, and then perhaps a child frame that is not the joint's."""
    moving = [joint for joint in chain if joint.axis is not None]
    slides = [joint.slides for joint in moving]
    fixed = [joint for joint in chain[len(moving) :] if joint.axis is None]
    ends = 1 if moving else 2
    if len(moving) + len(fixed) != len(chain) or slides not in _SLIDES.values() or len(fixed) > ends:
        kinds = ", ".join(f"{joint.name} {_kind(joint)}" for joint in chain)
        raise BodyError(
            f"between segments {chain[0].parent} and {chain[-1].child} there are joints {kinds}; a body has balls "
            "(three turning), hinges (one turning), welds (one fixed) and free joints (three sliding, three turning), "
            "and after any a fixed one at most"
        )
    at_child = fixed[len(fixed) - 1] if len(fixed) == ends else None
    place: dict[str, Any] = {
        "parent": chain[0].parent,
        "child": chain[-1].child,
        "parent_T_joint": chain[0].parent_T_joint,
        "child_T_joint": np.eye(4) if at_child is None else inverse(at_child.parent_T_joint),
    }
    if slides == _SLIDES["free"]:
        return _free(moving, place)
    if slides == _SLIDES["ball"]:
        return _ball(moving, place)
    if moving:
        limits = None if moving[0].limits is None else (moving[0].limits,)
        return Joint(name=moving[0].name, type="hinge", **place, axis=_axis(moving[0]), limits=limits)
    return Joint(name=chain[0].name, type="weld", **place)


def _kind(joint: UrdfJoint) -> str:
    return "fixed" if joint.axis is None else "sliding" if joint.slides else "turning"


def _free(moving: Sequence[UrdfJoint], place: dict[str, Any]) -> Joint:
    """The joint of a place and the angles of a ball; whatever limits there are, it keeps none."""
    sliding, ball = moving[:3], _ball(moving[3:], place)
    named_so = [joint.name for joint in sliding] == [f"{ball.name}_at_{axis}" for axis in "xyz"]
    unturned = all(_is_identity(joint.parent_T_joint) for joint in moving[1:4])
    if not named_so or not unturned or "".join(map(_letter, sliding)) != "xyz":
        raise BodyError(
            f"joints {', '.join(joint.name for joint in moving)}: a free joint slides along x, y and z, unturned, and "
            "then turns as a ball does; all are named FREE_at_x ... FREE_y ..."
        )
    return replace(ball, type="free", sigmas=None, limits=None)


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
