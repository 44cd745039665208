"""The URDF of a body file, or of the body that a bag was solved with."""

import logging
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import default_sigmas
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.solved.topics import ROBOT, ROBOT_TYPE, published_robot

logger = logging.getLogger(__name__)

_BAG_SUFFIXES = (".mcap", ".db3")


def robot_description(source: Path) -> str:
    """The URDF of a source: what a bag says on ``/robot_description``, or made of a body file.

    What URDF cannot carry of a body file is left out, with a warning that names it.

    Raises:
        BodyError: a body file that is missing or describes no body.
        RecordingError: a bag that cannot be read, or that nobody solved.
    """
    if source.is_dir() or source.suffix in _BAG_SUFFIXES:
        return _published(source)
    body = read_body(source)
    _warn_of_losses(body, source)
    return urdf_text(body)


def _published(path: Path) -> str:
    with BagFile(path) as bag:
        if text := published_robot(bag):
            return text
        raise RecordingError(
            f"{path}: nothing on {ROBOT} ({ROBOT_TYPE}); expected a bag that 'bodycam replay' wrote, or a body YAML; "
            f"there are: {', '.join(bag.topics) or 'no topics at all'}"
        )


def _warn_of_losses(body: BodyModel, path: Path) -> None:
    if body.loop_joints:
        names = ", ".join(joint.name for joint in body.loop_joints)
        logger.warning("%s: joints %s close loops; a URDF is a tree, so they are left out", path, names)
    own = [joint.name for joint in body.joints if joint.sigmas != default_sigmas(joint.type)]
    if own:
        logger.warning("%s: joints %s have sigmas of their own, which no URDF carries", path, ", ".join(own))
