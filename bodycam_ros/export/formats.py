"""What ``bodycam export`` writes: a new format is a new line of the table."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import default_sigmas
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.solved.topics import ROBOT, ROBOT_TYPE, published_robot
from bodycam_ros.whole_file import write_whole

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


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        what: for whom it is, and what it holds.
        content: makes the file's content of a solved bag or a body file.
    """

    what: str
    content: Callable[[Path], str | bytes]


FORMATS: Mapping[str, Format] = {
    "urdf": Format("the body, for RViz and every tool that reads robots", robot_description),
}


def export(source: Path, format_name: str, output: Path) -> None:
    """Write a solved bag or a body file in a format, whole or not at all.

    Args:
        source: what to export.
        format_name: key of ``FORMATS``.
        output: file to write; an earlier one is replaced.

    Raises:
        BodycamError: the source cannot be read or lacks what the format needs, or the output cannot be written.
    """
    write_whole(output, FORMATS[format_name].content(source))
