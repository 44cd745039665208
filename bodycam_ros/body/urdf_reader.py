"""A body from the URDF that ``urdf`` wrote of it: other readers have the robot, this one the element with the body."""

from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import body_from_yaml
from bodycam_ros.body.urdf_document import BODY, UrdfDocument
from bodycam_ros.errors import BodyError


def body_from_urdf(text: str) -> BodyModel:
    """The body that a URDF document describes; its joints come in the order of the tree, those that close loops last.

    Raises:
        BodyError: not a URDF, or not of a body; the message names the place in it.
    """
    document = UrdfDocument.parse(text)
    if not document.body.strip():
        raise BodyError(f"this URDF has no <{BODY}>: it is of a robot, or of an earlier version; give the body as YAML")
    try:
        body = body_from_yaml(document.body)
    except BodyError as error:
        raise BodyError(f"<{BODY}>: {error}") from error
    if missing := set(body.segments) - set(document.links):
        raise BodyError(f"<{BODY}>: the URDF has no links {', '.join(sorted(missing))}; write it anew from the body")
    return replace(body, joints=(*body.tree_joints, *body.loop_joints))
