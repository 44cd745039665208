"""The body of a solved bag or a body file for programs that read robots, and what goes beside it."""

import logging
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import indent

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import joints_text
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body.urdf_document import BODY
from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.errors import BodyError, OutputError, RecordingError
from bodycam_ros.formats.mjcf import mjcf_text
from bodycam_ros.kinematics.joint import Joint, default_sigmas
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.topics import ROBOT, ROBOT_TYPE, published_robot
from bodycam_ros.static_cameras.body_from_outside import person_masses

logger = logging.getLogger(__name__)

LOOPS_SUFFIX = ".loops.yaml"
"""Of the file beside a URDF that has the joints that close loops."""

_BAG_SUFFIXES = (".mcap", ".db3")
LOOPS_HEADER = "# Joints that close loops, which the URDF beside this leaves open, as in a body file of bodycam.\n"


def robot_description(source: Path, mass_kg: float | None = None) -> dict[str, str]:
    """The URDF of a source: what a bag says on ``/robot_description``, or made of a body file; and its loops.

    What URDF cannot carry is said, in a warning that names it.

    Args:
        source: bag or body file.
        mass_kg: of the whole person [kg], for links with ``<inertial>``; None: there are none.

    Raises:
        BodyError: a body file that is missing or describes no body, or a body that no person's masses fit.
        RecordingError: a bag that cannot be read, or that nobody solved.
    """
    if not is_bag(source):
        body = read_body(source)
        _warn_of_sigmas(body, source)
        with _named(source):
            return {"": _with_masses(body, mass_kg), **_loops_file(body.loop_joints, source)}
    text = _published(source)
    with _named(source):
        loops = body_from_urdf(text).loop_joints if f"<{BODY}>" in text else ()
        if mass_kg is not None:
            text = _with_masses(body_from_urdf(text), mass_kg)
        return {"": text, **_loops_file(loops, source)}


def _with_masses(body: BodyModel, mass_kg: float | None) -> str:
    return urdf_text(body, person_masses(body, mass_kg) if mass_kg is not None else None)


def mjcf(source: Path) -> dict[str, str]:
    """The MJCF of a source, a solved bag or a body file, with its loops.

    Raises:
        BodyError: a body file that is missing or describes no body, or one that MJCF cannot hold.
        RecordingError: a bag that cannot be read, or that nobody solved.
    """
    if not is_bag(source):
        body = read_body(source)
        with _named(source):
            return {"": mjcf_text(body)}
    text = _published(source)
    with _named(source):
        return {"": mjcf_text(body_from_urdf(text))}


def is_bag(source: Path) -> bool:
    """Whether a source is a bag, and not a body file."""
    return source.is_dir() or source.suffix in _BAG_SUFFIXES


def _published(path: Path) -> str:
    with BagFile(path) as bag:
        if text := published_robot(bag):
            return text
        raise RecordingError(
            f"{path}: nothing on {ROBOT} ({ROBOT_TYPE}); expected a bag that 'bodycam replay' wrote, or a body YAML; "
            f"there are: {', '.join(bag.topics) or 'no topics at all'}"
        )


@contextmanager
def _named(source: Path) -> Iterator[None]:
    """Say where a body is from that is wrong."""
    try:
        yield
    except BodyError as error:
        raise BodyError(f"{source}: {error}") from error


def _loops_file(loops: Sequence[Joint], source: Path) -> dict[str, str]:
    if not loops:
        return {}
    logger.warning(
        "%s: joints %s close loops; a URDF is a tree and leaves them open: they are in its element <%s>, which other "
        "programs pass over, and in a file *%s beside it",
        source,
        ", ".join(joint.name for joint in loops),
        BODY,
        LOOPS_SUFFIX,
    )
    return {LOOPS_SUFFIX: f"{LOOPS_HEADER}joints:\n{indent(joints_text(loops), '  ')}"}


def _warn_of_sigmas(body: BodyModel, path: Path) -> None:
    own = [joint.name for joint in body.tree_joints if joint.sigmas != default_sigmas(joint.type)]
    if own:
        logger.warning("%s: joints %s have sigmas of their own, which no URDF carries", path, ", ".join(own))


def stale_loops(output: Path, written: Collection[Path]) -> Path | None:
    """The loops of an earlier URDF of this name, if the one to be has none: they would be taken for its own."""
    path = output.with_suffix(LOOPS_SUFFIX)
    try:
        is_ours = path not in written and path.is_file() and path.read_bytes().startswith(LOOPS_HEADER.encode())
    except OSError:
        return None
    return path if is_ours else None


def remove_stale(path: Path) -> None:
    """Remove the loops of an earlier URDF.

    Raises:
        OutputError: they cannot be.
    """
    try:
        path.unlink()
    except OSError as error:
        raise OutputError(f"{path}: is of an earlier URDF, and cannot be removed: {error.strerror or error}") from error
    logger.warning("%s: removed; it was of an earlier URDF, and the one beside it closes no loops", path)
