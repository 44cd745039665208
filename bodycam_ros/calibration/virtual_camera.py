"""Several cameras on one segment as one virtual camera (A 4.2, eq. 6-7).

The virtual camera stands where the segment's reference camera does, so its frame is the segment's until the N-pose
gives a better one.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse, log_so3, nearest_rotation, rigid, robust_average_pose
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_ENOUGH_FOR_A_MAJORITY = 3
_ROUNDING = 1e-9  # [m], [rad]


@dataclass(frozen=True)
class VirtualCameraSettings:
    """Which camera of a segment is left out of the virtual one."""

    far_off: float = setting(
        4.0,
        limits=(1.0, 1000.0),
        reason="times that cameras of a segment usually differ from their nearest; of three or more, one that differs "
        "more is left out at that instant",
    )


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """The cameras of one segment, fused.

    Attributes:
        virtual_T_camera: camera -> (4, 4) where it sits; the identity for the reference camera.
        world_T_virtual: (T, 4, 4) its pose; the identity where it is not known.
        known: (T) whether any of the cameras is.
    """

    virtual_T_camera: Mapping[str, Array]
    world_T_virtual: Array
    known: NDArray[np.bool_]

    def filled(self) -> Array:
        """Its poses (T, 4, 4), where it is not known those of the nearest instant at which it is."""
        rows = np.flatnonzero(self.known)
        nearest = np.abs(np.arange(len(self.known))[:, None] - rows).argmin(axis=1)
        poses: Array = self.world_T_virtual[rows[nearest]]
        return poses


def fuse_cameras(
    names: tuple[str, ...], world_T_camera: Array, weights: Array, settings: VirtualCameraSettings
) -> VirtualCamera:
    """Fuse the cameras of one segment.

    Args:
        names: (K) of the cameras, for messages.
        world_T_camera: (T, K, 4, 4) their poses.
        weights: (T, K) how much each counts, 1 for one that sits still, 0 where it is not known; the reference is the
            weightiest.
        settings: which camera is left out.

    Raises:
        RangeOfMotionError: a camera is never known together with the reference camera.
    """
    reference = int(np.argmax(weights.sum(axis=0)))
    virtual_T_camera = {name: np.eye(4) for name in names}
    for k, name in enumerate(names):
        if k != reference:
            pair = [reference, k]
            virtual_T_camera[name] = average_relative_pose(
                names[reference], name, world_T_camera[:, pair], weights[:, pair]
            )
    # A eq. 7: each camera says where the virtual one is.
    said = world_T_camera @ inverse(np.stack([virtual_T_camera[name] for name in names]))
    return VirtualCamera(virtual_T_camera, weighted_average_poses(said, weights, settings), weights.max(axis=1) > 0)


def average_relative_pose(reference: str, camera: str, world_T_pair: Array, weights: Array) -> Array:
    """Pose reference_T_camera (4, 4), the robust average over time of A eq. 6.

    Args:
        reference, camera: names, for messages.
        world_T_pair: (T, 2, 4, 4) poses of the two.
        weights: (T, 2) how much each counts at each instant; zero where it is not known.

    Raises:
        RangeOfMotionError: the two are never known together.
    """
    together = weights.min(axis=1)
    if not together.any():
        raise RangeOfMotionError(
            f"cameras {reference} and {camera} are on one segment but were never registered at the same time, so "
            "nothing tells how they sit to each other; repeat the recording where both see the mapped place"
        )
    # Where a strap slipped, only the time that counts in full says where the camera sits.
    best = together >= together.max()
    relative = inverse(world_T_pair[best, 0]) @ world_T_pair[best, 1]
    return robust_average_pose(relative)


def weighted_average_poses(poses: Array, weights: Array, settings: VirtualCameraSettings) -> Array:
    """Average (T, 4, 4) over the K of poses (T, K, 4, 4) with weights (T, K); the identity where all weights are zero.

    Of three or more, one far from all others is left out.
    """
    if poses.shape[1] >= _ENOUGH_FOR_A_MAJORITY:
        weights = weights * _near_another(poses, weights, settings.far_off)
    total = weights.sum(axis=1)
    share = weights / np.where(total > 0, total, 1.0)[:, None]
    R = np.einsum("tk,tkij->tij", share, poses[:, :, :3, :3])
    t = np.einsum("tk,tki->ti", share, poses[:, :, :3, 3])
    R[total == 0] = np.eye(3)
    return rigid(nearest_rotation(R), t)


def _near_another(poses: Array, weights: Array, far_off: float) -> NDArray[np.bool_]:
    """(T, K) whether a pose is about as near to another of its instant as poses are on the whole."""
    seen = weights > 0
    pairs = seen[:, :, None] & seen[:, None, :] & ~np.eye(poses.shape[1], dtype=bool)
    between = inverse(poses)[:, :, None] @ poses[:, None]
    near = np.ones(seen.shape, dtype=bool)
    for distances in (
        np.linalg.norm(between[..., :3, 3], axis=-1),
        np.linalg.norm(log_so3(between[..., :3, :3]), axis=-1),
    ):
        to_nearest = np.where(pairs, distances, np.inf).min(axis=2)
        told = np.isfinite(to_nearest)
        if told.any():
            near &= ~told | (to_nearest <= far_off * np.median(to_nearest[told]) + _ROUNDING)
    # Where none is near another nothing says which is wrong.
    near[~(near & seen).any(axis=1)] = True
    return near
