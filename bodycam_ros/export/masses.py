"""What segments weigh, which no body file says: their surface of capsules, filled with water."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.mass import Mass
from bodycam_ros.body.segment_shape import JOINT_RADIUS_M
from bodycam_ros.geometry import Array
from bodycam_ros.outside.capsules import capsule_surfaces

_DENSITY = 1000.0  # [kg / m^3]
_BALL_KG = _DENSITY * 4.0 / 3.0 * np.pi * JOINT_RADIUS_M**3


def masses(body: BodyModel) -> dict[str, Mass]:
    """Segment -> its mass; one without a surface has that of a ball at its joint."""
    found = {segment: _of_mesh(surface.vertices[surface.faces]) for segment, surface in capsule_surfaces(body).items()}
    ball = Mass(_BALL_KG, np.zeros(3), 0.4 * _BALL_KG * JOINT_RADIUS_M**2 * np.eye(3))
    return {segment: found.get(segment, ball) for segment in body.segments}


def _of_mesh(corners: Array) -> Mass:
    """Of closed parts whose faces have corners (F, 3, 3), by the tetrahedra to the origin.

    The second moment of a tetrahedron with a corner at the origin is V / 20 (sum of c c' + s s'), with s the sum of its
    other corners c.
    """
    volumes = np.linalg.det(corners) / 6.0
    sums = corners.sum(axis=1)
    volume = float(volumes.sum())
    centre = (volumes @ sums) / (4.0 * volume)
    moments = np.einsum("f,fki,fkj->ij", volumes, corners, corners) + np.einsum("f,fi,fj->ij", volumes, sums, sums)
    about_centre = _DENSITY * (moments / 20.0 - volume * np.outer(centre, centre))
    return Mass(_DENSITY * volume, centre, np.trace(about_centre) * np.eye(3) - about_centre)
