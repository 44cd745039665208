"""A keyframe of a worn camera: what it saw, and where it was when it saw it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_bytes, as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.epipolar_matching import axes_along
from bodycam_ros.mapping.growth_settings import GrowthSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.recent_path import steady_pixels
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame


@dataclass(frozen=True)
class WornKeyframe:
    """Features of one image of a registered camera.

    Attributes:
        camera: its name.
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4) where it was.
        position_sigma: how well that is known [m].
        focal_length: pixels per radian on its axis [px].
        bearings: (N, 3) unit rays to the features, in the camera.
        descriptors: (N, 128) uint8 RootSIFT.
        sizes: (N,) sigma, as the angle that it covers [rad].
        landmark_ids: (N,) uint32 landmarks that the features show; ``NO_LANDMARK``: none that is known.
    """

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    position_sigma: float
    focal_length: float
    bearings: NDArray[np.float64]
    descriptors: NDArray[np.uint8]
    sizes: NDArray[np.float64]
    landmark_ids: NDArray[np.uint32]


def worn_keyframe(camera: CameraModel, frame: TrackFrame, matches: LandmarkMatches) -> WornKeyframe | None:
    """The keyframe of an image in which new features were described; None if there are none, or the camera is lost.

    Args:
        camera: its model.
        frame: what the tracker said of the image.
        matches: what the registrar made of it.
    """
    if matches.world_T_camera is None or not len(frame.described):
        return None
    described = frame.described.astype(np.int64)
    readout_time = matches.readout.in_use if matches.readout else 0.0
    pixels = steady_pixels(camera, frame.pixels[described], matches.turning, readout_time)
    ids = np.full(len(described), NO_LANDMARK, np.uint32)
    _, at, of = np.intersect1d(frame.track_ids[described], matches.track_ids, return_indices=True)
    ids[at] = matches.landmark_ids[of]
    position_sigma = float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))
    return keyframe_of_features(
        camera,
        frame.stamp_ns,
        matches.world_T_camera,
        position_sigma,
        pixels,
        frame.descriptors,
        frame.scales,
        ids,
    )


def keyframe_of_features(
    camera: CameraModel,
    stamp_ns: int,
    world_T_camera: NDArray[np.float64],
    position_sigma: float,
    pixels: NDArray[np.float64],
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.float32],
    landmark_ids: NDArray[np.uint32],
) -> WornKeyframe:
    """The keyframe of an image with these features; those outside of the lens's cone are left out.

    Args:
        camera: its model.
        stamp_ns, world_T_camera, position_sigma: of the image, as of ``WornKeyframe``.
        pixels: (N, 2) where the features are, as if all rows were exposed together.
        descriptors, landmark_ids: (N, 128), (N,) as of ``WornKeyframe``.
        scales: (N,) sigma [px].
    """
    bearings, in_view = camera.unproject(pixels)
    return WornKeyframe(
        camera=camera.name,
        stamp_ns=stamp_ns,
        world_T_camera=world_T_camera,
        position_sigma=position_sigma,
        focal_length=float(np.sqrt(camera.fx * camera.fy)),
        bearings=bearings[in_view],
        descriptors=descriptors[in_view],
        sizes=scales[in_view] / scales_at(camera, bearings[in_view, 2]),
        landmark_ids=landmark_ids[in_view],
    )


_CELLS = 8
_WELL_WITHIN = 0.97
"""Of the lens's cone: landmarks are not found at its very rim."""


class KeyframeChoice:
    """Chooses the keyframes of one camera.

    Args:
        camera: its model.
        settings: how far it moves between two.
    """

    def __init__(self, camera: CameraModel, settings: GrowthSettings) -> None:
        self._settings = settings
        self._size = np.array([camera.width, camera.height], np.float64)
        centres = (np.stack(np.meshgrid(*[np.arange(_CELLS)] * 2), axis=-1).reshape(-1, 2) + 0.5) / _CELLS * self._size
        bearings, in_view = camera.unproject(centres)
        self._in_view: NDArray[np.bool_] = in_view & (bearings[:, 2] > np.cos(_WELL_WITHIN * camera.max_angle))
        self._latest_ns: int | None = None
        self._world_T_latest = np.eye(4)

    def taken(self, matches: LandmarkMatches) -> None:
        """The image became a keyframe."""
        if matches.world_T_camera is not None:
            self._latest_ns, self._world_T_latest = matches.stamp_ns, matches.world_T_camera

    def is_due(self, matches: LandmarkMatches) -> bool:
        """Whether the next image should be a keyframe: the camera is registered, sees unknown things, and has moved."""
        pose = matches.world_T_camera
        if pose is None or self.coverage(matches) >= self._settings.covered:
            return False
        if self._latest_ns is None:
            return True
        if 0 <= matches.stamp_ns - self._latest_ns < 1e9 * self._settings.keyframe_gap:
            return False
        return has_moved(self._world_T_latest, pose, self._settings)

    def coverage(self, matches: LandmarkMatches) -> float:
        """Share of the view, 0 to 1, in which landmarks were found."""
        column, row = np.clip((_CELLS * matches.shown / self._size).astype(np.int64), 0, _CELLS - 1).T
        found = np.unique(_CELLS * row + column)
        return float(self._in_view[found].sum() / max(1, self._in_view.sum()))


def has_moved(
    world_T_before: NDArray[np.float64], world_T_camera: NDArray[np.float64], settings: GrowthSettings
) -> bool:
    """Whether a camera is far enough from where its last keyframe was taken, or turned far enough, for another."""
    step = float(np.linalg.norm(world_T_camera[:3, 3] - world_T_before[:3, 3]))
    cosine = 0.5 * (float(np.trace(world_T_before[:3, :3].T @ world_T_camera[:3, :3])) - 1.0)
    return step > settings.keyframe_step or cosine < np.cos(np.radians(settings.keyframe_turn))


def match_keyframes(
    first: WornKeyframe,
    second: WornKeyframe,
    first_rows: NDArray[np.int64],
    second_rows: NDArray[np.int64],
    settings: GrowthSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (M,), (M,) of features, none in two pairs.

    Args:
        first, second: the keyframes, from different places.
        first_rows, second_rows: (A,), (B,) features that are asked.
        settings: tolerances.
    """
    between = second.world_T_camera[:3, 3] - first.world_T_camera[:3, 3]
    axes_world = axes_along(between / np.linalg.norm(between))
    found = match_along_epipolars(
        *_looks(first, first_rows, axes_world),
        *_looks(second, second_rows, axes_world),
        settings.epipolar_px / min(first.focal_length, second.focal_length),
        settings.max_size_ratio,
        settings.ratio,
        settings.max_distance,
    )
    return first_rows[found[:, 0]], second_rows[found[:, 1]]


def _looks(
    keyframe: WornKeyframe, rows: NDArray[np.int64], axes_world: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]:
    """Rays (N, 3) in some axes, sizes (N,) [rad] and descriptors (N, 128) of features."""
    rays = keyframe.bearings[rows] @ keyframe.world_T_camera[:3, :3].T @ axes_world.T
    return as_rows(rays), keyframe.sizes[rows], as_bytes(keyframe.descriptors[rows])


Array = NDArray[np.float64]

_ROUNDS = 3  # the weights, which are distances, settle in two
_LEAST_DISTANCE_M = 0.05
_NEARLY_PARALLEL = 1e-12


@dataclass(frozen=True)
class Rays:
    """Rays to P points, up to V each; the others are padding.

    Attributes:
        centres: (P, V, 3) where they start [m].
        directions: (P, V, 3) unit, in the world.
        focal_lengths: (P, V) pixels per radian of the cameras [px].
        there: (P, V) which are no padding.
    """

    centres: Array
    directions: Array
    focal_lengths: Array
    there: NDArray[np.bool_]


@dataclass(frozen=True)
class Triangulated:
    """P points.

    Attributes:
        points: (P, 3) [m].
        errors_px: (P, V) reprojection errors; zero for padding, infinite behind a camera.
        angles: (P,) the widest between two rays [rad].
    """

    points: Array
    errors_px: Array
    angles: Array


def triangulate(rays: Rays) -> Triangulated:
    """The points that are nearest to their rays in angle.

    The squared distance of x to a ray from c along d is |(I - d d^T)(x - c)|^2; over the squared distance from c it is
    an angle.
    """
    across = np.eye(3) - rays.directions[..., :, None] * rays.directions[..., None, :]
    weights = rays.there * rays.focal_lengths**2
    # From the middle of the cameras, or digits would be lost far from the origin.
    middle = np.einsum("pv,pvi->pi", rays.there, rays.centres) / rays.there.sum(axis=1)[:, None]
    centres = rays.centres - middle[:, None]
    for _ in range(_ROUNDS):
        normal = np.einsum("pv,pvij->pij", weights, across)
        right = np.einsum("pv,pvij,pvj->pi", weights, across, centres)
        scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        points = np.linalg.solve(normal + _NEARLY_PARALLEL * scale * np.eye(3), right[:, :, None])[:, :, 0]
        offsets = points[:, None] - centres
        distances = np.maximum(np.linalg.norm(offsets, axis=2), _LEAST_DISTANCE_M)
        weights = rays.there * (rays.focal_lengths / distances) ** 2
    towards = offsets / distances[:, :, None]
    sines = np.linalg.norm(np.cross(rays.directions, towards), axis=2)
    before = np.einsum("pvi,pvi->pv", rays.directions, towards) > 0.0
    errors = np.where(before, rays.focal_lengths * sines, np.inf)
    cosines = np.einsum("pvi,pwi->pvw", towards, towards)
    both = rays.there[:, :, None] & rays.there[:, None, :]
    narrowest = np.where(both, cosines, 1.0).min(axis=(1, 2))
    return Triangulated(points + middle, np.where(rays.there, errors, 0.0), np.arccos(np.clip(narrowest, -1.0, 1.0)))
