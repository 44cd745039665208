"""Several cameras on one segment as one virtual camera (A eq. 6-7).

It is at the segment's reference camera, so its frame is the segment's until the N-pose gives a better one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse, nearest_rotation, rigid, robust_average_pose


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """The cameras of one segment, fused.

    Attributes:
        virtual_T_camera: camera -> (4, 4) its mount; the identity for the reference camera.
        world_T_virtual: (T, 4, 4) its pose; the identity where it is unknown.
        known: (T) whether any of the cameras is.
    """

    virtual_T_camera: Mapping[str, Array]
    world_T_virtual: Array
    known: NDArray[np.bool_]


def fuse_cameras(names: Sequence[str], world_T_camera: Array, known: NDArray[np.bool_]) -> VirtualCamera:
    """Fuse the cameras of one segment.

    Args:
        names: (K) of the cameras, for messages.
        world_T_camera: (T, K, 4, 4) their poses.
        known: (T, K) whether each is; the reference is the one that is known most often.

    Raises:
        RangeOfMotionError: a camera is never known together with the reference camera.
    """
    reference = int(np.argmax(known.sum(axis=0)))
    virtual_T_camera = {name: np.eye(4) for name in names}
    for k, name in enumerate(names):
        if k == reference:
            continue
        together = known[:, [reference, k]].all(axis=1)
        if not together.any():
            raise RangeOfMotionError(
                f"cameras {names[reference]} and {name} are on one segment but were never registered at the same time, "
                "so their relative pose is unknown; repeat the recording where both see the mapped place"
            )
        relative = inverse(world_T_camera[together, reference]) @ world_T_camera[together, k]
        virtual_T_camera[name] = robust_average_pose(relative)  # A eq. 6
    # A eq. 7: each camera gives a pose of the virtual one.
    poses = world_T_camera @ inverse(np.stack([virtual_T_camera[name] for name in names]))
    return VirtualCamera(virtual_T_camera, _average(poses, known), np.asarray(known.any(axis=1)))


def _average(poses: Array, known: NDArray[np.bool_]) -> Array:
    """Average (T, 4, 4) over the known ones (T, K) of poses (T, K, 4, 4); the identity where none is."""
    total = known.sum(axis=1)
    share = known / np.maximum(total, 1)[:, None]
    R = np.einsum("tk,tkij->tij", share, poses[:, :, :3, :3])
    R[total == 0] = np.eye(3)
    return rigid(nearest_rotation(R), np.einsum("tk,tki->ti", share, poses[:, :, :3, 3]))
