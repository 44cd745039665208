"""The first motion of a body (A 4.2): the root where its cameras are, the other segments by their rotations alone."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.articulation import ArticulatedMotion, articulated
from bodycam_ros.calibration.virtual_camera import VirtualCamera
from bodycam_ros.geometry import inverse

Array = NDArray[np.float64]


def first_motion(
    body: BodyModel,
    cameras: tuple[str, ...],
    virtual: Mapping[str, VirtualCamera],
    rest_T_virtual: Mapping[str, Array],
    rows: NDArray[np.intp],
) -> ArticulatedMotion:
    """Follow the virtual cameras with a body; where one is not known, as it was at the nearest instant.

    Args:
        body: whose zero is the N-pose.
        cameras: (C) names, in the order of the motion's.
        virtual: segment -> its virtual camera.
        rest_T_virtual: segment -> (4, 4) pose of its virtual camera in the N-pose; the rotation in the N-pose's axes.
        rows: instants to take.
    """
    rotations = np.stack(
        [virtual[segment].filled()[rows, :3, :3] @ rest_T_virtual[segment][:3, :3].T for segment in body.segments],
        axis=1,
    )
    camera = body.cameras_on(body.root)[0]
    root_T_virtual = body.mounts[camera].segment_T_camera @ inverse(virtual[body.root].virtual_T_camera[camera])
    root_positions = (virtual[body.root].filled()[rows] @ inverse(root_T_virtual))[:, :3, 3]
    return articulated(body, cameras, root_positions, rotations)
