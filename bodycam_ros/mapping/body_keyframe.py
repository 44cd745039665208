"""Keyframes of body cameras: their features, and which images become keyframes while cameras are registered."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.epipolar_matching import PosedFeatures, pose_features
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import steady_pixels
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame

MAX_SIGMA_M = 0.02
"""Largest sigma of a keyframe's position: rays from uncertain positions make no points."""

_MIN_STEP_M = 0.12  # of a camera between its keyframes: 2 deg of parallax at 3 m
_MIN_TURN_COSINE = np.cos(np.radians(20.0))  # of a rotation that makes a keyframe too: SIFT tolerates 30 deg
_CELLS = 8  # rows and columns of the view's grid
_USABLE_VIEW = 0.97  # of the lens's cone: at its rim no landmarks are found


@dataclass(frozen=True)
class BodyKeyframe(PosedFeatures):
    """Features of one image of a registered camera.

    Attributes:
        camera: its name.
        stamp_ns: of the image [ns].
        position_sigma: standard deviation of its position [m].
        landmark_ids: (N,) uint32 landmarks that the features show; ``NO_LANDMARK`` where none is known.
        matched_ids: (M,) uint32 all landmarks that the camera was registered by.
        matched_points: (M, 3) their places [m].
        matched_rays: (M, 3) unit rays to them, in the world's axes.
    """

    camera: str
    stamp_ns: int
    position_sigma: float
    landmark_ids: NDArray[np.uint32]
    matched_ids: NDArray[np.uint32] = field(default_factory=lambda: np.zeros(0, np.uint32))
    matched_points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    matched_rays: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def moved_to(self, world_T_camera: Array) -> "BodyKeyframe":
        """The keyframe at another pose (4, 4); its rays turn with it."""
        turn = self.world_T_camera[:3, :3] @ world_T_camera[:3, :3].T
        return replace(
            self,
            world_T_camera=world_T_camera,
            rays_world=self.rays_world @ turn,
            matched_rays=self.matched_rays @ turn,
        )


@dataclass(frozen=True)
class KeyframeDensity:
    """How many images become keyframes.

    Attributes:
        max_covered: share of the view that shows landmarks, from which on an image adds none.
        min_gap_ns: between keyframes of a camera: SIFT costs as much as ten images of tracking.
    """

    max_covered: float = 0.5
    min_gap_ns: int = 300_000_000


class KeyframeSelection:
    """Chooses the keyframes of one camera.

    Args:
        camera: its model.
        density: how many.
    """

    def __init__(self, camera: CameraModel, density: KeyframeDensity | None = None) -> None:
        self._camera, self._density = camera, density or KeyframeDensity()
        self._cells_per_px = _CELLS / np.array([camera.width, camera.height], np.float64)
        centres = (np.stack(np.meshgrid(*[np.arange(_CELLS)] * 2), axis=-1).reshape(-1, 2) + 0.5) / self._cells_per_px
        bearings, in_view = camera.unproject(centres)
        self._in_view: NDArray[np.bool_] = in_view & (bearings[:, 2] > np.cos(_USABLE_VIEW * camera.max_angle))
        self._world_T_latest: Array | None = None
        self._due_ns: int | None = None

    def take_keyframe(self, frame: TrackFrame, matches: LandmarkMatches) -> BodyKeyframe | None:
        """The keyframe of an image whose new features were described; None if it has none, or is not registered."""
        if not frame.keyframe or matches.world_T_camera is None or not len(frame.described):
            return None
        self._world_T_latest, self._due_ns = matches.world_T_camera, matches.stamp_ns
        camera, described = self._camera, frame.described.astype(np.int64)
        ids = np.full(len(described), NO_LANDMARK, np.uint32)
        _, features, rows = np.intersect1d(frame.track_ids[described], matches.track_ids, return_indices=True)
        ids[features] = matches.landmark_ids[rows]
        pixels = steady_pixels(camera, frame.pixels[described], matches.turning, matches.readout_in_use)
        posed, in_view = pose_features(camera, matches.world_T_camera, pixels, frame.scales, frame.descriptors)
        bearings, fits = camera.unproject(matches.pixels)
        return BodyKeyframe(
            **vars(posed),
            camera=camera.name,
            stamp_ns=matches.stamp_ns,
            position_sigma=matches.position_sigma,
            landmark_ids=ids[in_view],
            matched_ids=matches.landmark_ids[fits],
            matched_points=matches.points_world[fits].astype(np.float64),
            matched_rays=bearings[fits] @ matches.world_T_camera[:3, :3].T,
        )

    def is_due(self, matches: LandmarkMatches) -> bool:
        """Whether a keyframe is wanted: the camera is registered, sees unmapped parts, and has moved.

        It is wanted once; the next one not before some time has passed.
        """
        pose, density = matches.world_T_camera, self._density
        if pose is None or (self._due_ns is not None and 0 <= matches.stamp_ns - self._due_ns < density.min_gap_ns):
            return False
        if self._world_T_latest is not None and not _has_moved(self._world_T_latest, pose):
            return False
        if self._coverage(matches) >= density.max_covered:
            return False
        self._due_ns = matches.stamp_ns
        return True

    def _coverage(self, matches: LandmarkMatches) -> float:
        """Share of the view, 0 to 1, in which landmarks were found."""
        cells = (matches.shown * self._cells_per_px).astype(np.int64)
        column, row = np.minimum(np.maximum(cells, 0), _CELLS - 1).T
        found = np.zeros(_CELLS**2, bool)
        found[_CELLS * row + column] = True
        return int(np.count_nonzero(found & self._in_view)) / max(1, int(np.count_nonzero(self._in_view)))


def _has_moved(world_T_before: Array, world_T_camera: Array) -> bool:
    """Whether a camera has moved or turned far enough from its last keyframe (4, 4) for another."""
    step = float(np.linalg.norm(world_T_camera[:3, 3] - world_T_before[:3, 3]))
    cosine = 0.5 * (float(np.trace(world_T_before[:3, :3].T @ world_T_camera[:3, :3])) - 1.0)
    return step > _MIN_STEP_M or cosine < _MIN_TURN_COSINE
