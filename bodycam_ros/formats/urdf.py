"""URDF of a solved bag or a body file."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bodycam_ros.body.average_person import person_masses
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import BODY, body_from_urdf, urdf_text
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.kinematics.joint import default_sigmas
from bodycam_ros.recording.bag_file import BagFile, is_bag
from bodycam_ros.results.topics import ROBOT, ROBOT_TYPE, published_robot

logger = logging.getLogger(__name__)


def robot_description(source: Path, mass_kg: float | None = None) -> str:
    """The URDF of a source, from ``/robot_description`` of a bag or made of a body file.

    A warning names what URDF cannot represent.

    Args:
        source: bag or body file.
        mass_kg: of the whole person [kg], for links with ``<inertial>``; None: there are none.

    Raises:
        BodyError: a body file that is missing or describes no body, or a body without a person's segments.
        RecordingError: a bag that cannot be read, or that was not solved.
    """
    body, text = _read(source)
    with _source_named(source):
        if body is None and (mass_kg is not None or f"<{BODY}>" in text):
            body = body_from_urdf(text)
        if body is not None and (not text or mass_kg is not None):
            text = urdf_text(body, None if mass_kg is None else person_masses(body, mass_kg))
    if body is None:
        return text
    own = [joint.name for joint in body.tree_joints if joint.sigmas != default_sigmas(joint.type)]
    if own and is_body_file(source):
        warning = "%s: joints %s have sigmas of their own, which other programs do not read from a URDF"
        logger.warning(warning, source, ", ".join(own))
    if body.loop_joints:
        logger.warning(
            "%s: joints %s close loops; a URDF is a tree and leaves them open: they are in its element <%s>, which "
            "other programs ignore",
            source,
            ", ".join(joint.name for joint in body.loop_joints),
            BODY,
        )
    return text


def convert_body(source: Path, write: Callable[[BodyModel], str]) -> str:
    """The text of the body of a bag or a body file; raises as ``robot_description`` does."""
    body, text = _read(source)
    with _source_named(source):
        return write(body or body_from_urdf(text))


def is_body_file(source: Path) -> bool:
    """Whether a source is a body file, and not a bag."""
    return not source.is_dir() and not is_bag(source)


def _read(source: Path) -> tuple[BodyModel | None, str]:
    """The body of a body file, and nothing; or no body, and the URDF that a bag has."""
    if is_body_file(source):
        return read_body(source), ""
    with BagFile(source) as bag:
        if text := published_robot(bag):
            return None, text
        raise RecordingError(
            f"{source}: nothing on {ROBOT} ({ROBOT_TYPE}); expected a bag that 'bodycam replay' wrote, or a body YAML; "
            f"there are: {', '.join(bag.topics) or 'no topics at all'}"
        )


@contextmanager
def _source_named(source: Path) -> Iterator[None]:
    try:
        yield
    except BodyError as error:
        raise BodyError(f"{source}: {error}") from error
