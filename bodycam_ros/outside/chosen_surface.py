"""Which surface of a body is taken: the one that is asked for, that of its file, or capsules."""

import logging
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.surface import Surface
from bodycam_ros.outside.surface_folder import read_surfaces

logger = logging.getLogger(__name__)


def surfaces_of(body: BodyModel, body_path: Path, folder: Path | None = None) -> dict[str, Surface]:
    """Segment -> its surface: from the folder if there is one, else from the body's own, else capsules.

    Segments that a folder has no mesh of have no surface: static cameras do not see them.

    Args:
        body: alone, or coupled to its equipment, which has a surface where the folder has meshes of it.
        body_path: the file that the body is from; the folder that it names lies beside it.
        folder: of meshes, as the user asks for.

    Raises:
        BodyError: the folder cannot be used; the message names what is wrong with it.
    """
    if folder is None and body.surface is not None:
        folder = body_path.parent / body.surface
    if folder is None:
        return capsule_surfaces(body)
    surfaces = read_surfaces(folder, body)
    if lacking := [segment for segment in body.segments if segment not in {*surfaces, *body.equipment_segments}]:
        logger.warning("%s: has no mesh of %s; static cameras do not see them", folder, ", ".join(lacking))
    return surfaces
