"""URDF of a solved bag or a body file."""

import logging
from pathlib import Path

from bodycam_ros.body.average_person import person_masses
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import BODY, urdf_text
from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.sampled_motion import MotionOptions
from bodycam_ros.kinematics.joint import default_sigmas
from bodycam_ros.recording.bag_file import BagFile, is_bag
from bodycam_ros.results.topics import ROBOT, ROBOT_TYPE, published_body

logger = logging.getLogger(__name__)


def write_urdf(body: BodyModel, options: MotionOptions) -> str:
    """The URDF of a body; a warning names what URDF cannot represent.

    Raises:
        BodyError: a mass, but not a person's segments; or names that clash in URDF.
    """
    if own := [joint.name for joint in body.tree_joints if joint.sigmas != default_sigmas(joint.type)]:
        warning = "body %s: joints %s have sigmas of their own, which other programs do not read from a URDF"
        logger.warning(warning, body.name, ", ".join(own))
    if body.loop_joints:
        logger.warning(
            "body %s: joints %s close loops; a URDF is a tree and leaves them open: they are in its element <%s>, "
            "which other programs ignore",
            body.name,
            ", ".join(joint.name for joint in body.loop_joints),
            BODY,
        )
    return urdf_text(body, None if options.mass is None else person_masses(body, options.mass))


def read_source(source: Path) -> BodyModel:
    """The body of a body file, or the one that was published last in a bag.

    Raises:
        BodyError: a body file that is missing or describes no body.
        RecordingError: a bag that cannot be read, or that was not solved.
    """
    if is_body_file(source):
        return read_body(source)
    with BagFile(source) as bag:
        if body := published_body(bag):
            return body
        raise RecordingError(
            f"{source}: nothing on {ROBOT} ({ROBOT_TYPE}); expected a bag that 'bodycam replay' wrote, or a body YAML; "
            f"there are: {', '.join(bag.topics) or 'no topics at all'}"
        )


def is_body_file(source: Path) -> bool:
    """Whether a source is a body file, and not a bag."""
    return not source.is_dir() and not is_bag(source)
