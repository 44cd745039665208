"""Keyframes of body cameras: which images become keyframes, their features, and matches between two of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.kernels import as_bytes, as_rows
from bodycam_ros.mapping.epipolar_kernels import match_along_epipolars
from bodycam_ros.mapping.epipolar_matching import axes_along
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import steady_pixels
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame

Array = NDArray[np.float64]

_MAX_COVERED = 0.5  # share of the view that shows landmarks, from which on a camera adds none
_MIN_STEP_M = 0.12  # of a camera between its keyframes: 2 deg of parallax at 3 m
_MIN_TURN_COSINE = np.cos(np.radians(20.0))  # of a rotation that makes a keyframe too: SIFT tolerates 30 deg
_MIN_GAP_NS = 300_000_000  # between keyframes of a camera: SIFT costs as much as ten images of tracking
_CELLS = 8  # rows and columns of the view's grid
_USABLE_VIEW = 0.97  # of the lens's cone: at its rim no landmarks are found

_EPIPOLAR_PX = 2.0  # of a match beside its epipolar line: features and poses err
_MAX_SIZE_RATIO = 2.0  # of a feature to the size that the distance of the point predicts
_MAX_RATIO = 0.85  # best to second best distance along the epipolar line (Lowe 2004)
_MAX_DISTANCE = 230.0  # between RootSIFT vectors of length 512


@dataclass(frozen=True)
class BodyKeyframe:
    """Features of one image of a registered camera.

    Attributes:
        camera: its name.
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4).
        position_sigma: standard deviation of its position [m].
        focal_length: pixels per radian on the optical axis [px].
        bearings: (N, 3) unit rays to the features, in camera axes.
        descriptors: (N, 128) uint8 RootSIFT.
        sizes: (N,) SIFT sigma as an angle [rad].
        landmark_ids: (N,) uint32 landmarks that the features show; ``NO_LANDMARK`` where none is known.
    """

    camera: str
    stamp_ns: int
    world_T_camera: Array
    position_sigma: float
    focal_length: float
    bearings: Array
    descriptors: NDArray[np.uint8]
    sizes: Array
    landmark_ids: NDArray[np.uint32]


def make_keyframe(
    camera: CameraModel,
    stamp_ns: int,
    world_T_camera: Array,
    position_sigma: float,
    pixels: Array,
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.float32],
    landmark_ids: NDArray[np.uint32],
) -> BodyKeyframe:
    """The keyframe of an image with these features, without those outside the lens's cone.

    Args:
        camera: its model.
        stamp_ns, world_T_camera, position_sigma, descriptors, landmark_ids: as of ``BodyKeyframe``.
        pixels: (N, 2) of the features, as if all rows were exposed together.
        scales: (N,) SIFT sigma [px].
    """
    bearings, in_view = camera.unproject(pixels)
    return BodyKeyframe(
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


class KeyframeSelection:
    """Chooses the keyframes of one camera.

    Args:
        camera: its model.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._size = np.array([camera.width, camera.height], np.float64)
        centres = (np.stack(np.meshgrid(*[np.arange(_CELLS)] * 2), axis=-1).reshape(-1, 2) + 0.5) / _CELLS * self._size
        bearings, in_view = camera.unproject(centres)
        self._in_view: NDArray[np.bool_] = in_view & (bearings[:, 2] > np.cos(_USABLE_VIEW * camera.max_angle))
        self._latest: tuple[int, Array] | None = None

    def take_keyframe(self, frame: TrackFrame, matches: LandmarkMatches) -> BodyKeyframe | None:
        """The keyframe of an image whose new features were described; None if it has none, or is not registered."""
        if not frame.keyframe or matches.world_T_camera is None or not len(frame.described):
            return None
        self._latest = matches.stamp_ns, matches.world_T_camera
        described = frame.described.astype(np.int64)
        readout_time = matches.readout.in_use if matches.readout else 0.0
        ids = np.full(len(described), NO_LANDMARK, np.uint32)
        _, features, rows = np.intersect1d(frame.track_ids[described], matches.track_ids, return_indices=True)
        ids[features] = matches.landmark_ids[rows]
        return make_keyframe(
            self._camera,
            frame.stamp_ns,
            matches.world_T_camera,
            float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:]))),
            steady_pixels(self._camera, frame.pixels[described], matches.turning, readout_time),
            frame.descriptors,
            frame.scales,
            ids,
        )

    def is_due(self, matches: LandmarkMatches) -> bool:
        """Whether the next image should be a keyframe: the camera is registered, sees unmapped parts, and has moved."""
        pose = matches.world_T_camera
        if pose is None or self.coverage(matches) >= _MAX_COVERED:
            return False
        if self._latest is None:
            return True
        latest_ns, world_T_latest = self._latest
        return not 0 <= matches.stamp_ns - latest_ns < _MIN_GAP_NS and has_moved(world_T_latest, pose)

    def coverage(self, matches: LandmarkMatches) -> float:
        """Share of the view, 0 to 1, in which landmarks were found."""
        column, row = np.clip((_CELLS * matches.shown / self._size).astype(np.int64), 0, _CELLS - 1).T
        found = np.unique(_CELLS * row + column)
        return float(self._in_view[found].sum() / max(1, self._in_view.sum()))


def has_moved(world_T_before: Array, world_T_camera: Array) -> bool:
    """Whether a camera has moved or turned far enough from its last keyframe (4, 4) for another."""
    step = float(np.linalg.norm(world_T_camera[:3, 3] - world_T_before[:3, 3]))
    cosine = 0.5 * (float(np.trace(world_T_before[:3, :3].T @ world_T_camera[:3, :3])) - 1.0)
    return step > _MIN_STEP_M or cosine < _MIN_TURN_COSINE


def match_keyframes(first: BodyKeyframe, second: BodyKeyframe) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (M,), (M,) of features without landmark that match along epipolar lines; none is in two pairs."""
    between = second.world_T_camera[:3, 3] - first.world_T_camera[:3, 3]
    axes_world = axes_along(between / np.linalg.norm(between))
    rows = [np.flatnonzero(keyframe.landmark_ids == NO_LANDMARK) for keyframe in (first, second)]
    found = match_along_epipolars(
        *_features_in(first, rows[0], axes_world),
        *_features_in(second, rows[1], axes_world),
        _EPIPOLAR_PX / min(first.focal_length, second.focal_length),
        _MAX_SIZE_RATIO,
        _MAX_RATIO,
        _MAX_DISTANCE,
    )
    return rows[0][found[:, 0]], rows[1][found[:, 1]]


def _features_in(
    keyframe: BodyKeyframe, rows: NDArray[np.int64], axes_world: Array
) -> tuple[Array, Array, NDArray[np.uint8]]:
    """Rays (N, 3) in some axes, sizes (N,) [rad] and descriptors (N, 128) of features."""
    rays = keyframe.bearings[rows] @ keyframe.world_T_camera[:3, :3].T @ axes_world.T
    return as_rows(rays), keyframe.sizes[rows], as_bytes(keyframe.descriptors[rows])
