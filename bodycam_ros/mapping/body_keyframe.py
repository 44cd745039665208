"""Keyframes of body cameras: their features, and which images become keyframes, at once or of a whole recording."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.epipolar_matching import PosedFeatures, pose_features
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import steady_pixels
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame

MAX_SIGMA_M = 0.02
"""Of a keyframe's position: rays from uncertain positions make no points."""

_MAX_COVERED = 0.5  # share of the view that shows landmarks, from which on a camera adds none
_MIN_STEP_M = 0.12  # of a camera between its keyframes: 2 deg of parallax at 3 m
_MIN_TURN_COSINE = np.cos(np.radians(20.0))  # of a rotation that makes a keyframe too: SIFT tolerates 30 deg
_MIN_GAP_NS = 300_000_000  # between keyframes of a camera: SIFT costs as much as ten images of tracking
_CELLS = 8  # rows and columns of the view's grid
_USABLE_VIEW = 0.97  # of the lens's cone: at its rim no landmarks are found

_MAX_COVERED_OFFLINE = 0.8  # share of the view with landmarks of the photographs, from which on an image adds none
_MAX_KEYFRAMES = 300  # of all cameras: each costs 30 kB in the map and a tenth of a second in a round


@dataclass(frozen=True)
class BodyKeyframe(PosedFeatures):
    """Features of one image of a registered camera.

    Attributes:
        camera: its name.
        stamp_ns: of the image [ns].
        position_sigma: standard deviation of its position [m].
        landmark_ids: (N,) uint32 landmarks that the features show; ``NO_LANDMARK`` where none is known.
    """

    camera: str
    stamp_ns: int
    position_sigma: float
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
    posed, in_view = pose_features(camera, world_T_camera, pixels, scales, descriptors)
    return BodyKeyframe(
        **vars(posed),
        camera=camera.name,
        stamp_ns=stamp_ns,
        position_sigma=position_sigma,
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
        self._world_T_latest: Array | None = None
        self._due_ns: int | None = None

    def take_keyframe(self, frame: TrackFrame, matches: LandmarkMatches) -> BodyKeyframe | None:
        """The keyframe of an image whose new features were described; None if it has none, or is not registered."""
        if not frame.keyframe or matches.world_T_camera is None or not len(frame.described):
            return None
        self._world_T_latest, self._due_ns = matches.world_T_camera, matches.stamp_ns
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
        """Whether a keyframe is wanted: the camera is registered, sees unmapped parts, and has moved.

        It is wanted once; the next one not before some time has passed.
        """
        pose = matches.world_T_camera
        if pose is None or self.coverage(matches) >= _MAX_COVERED:
            return False
        if self._due_ns is not None and 0 <= matches.stamp_ns - self._due_ns < _MIN_GAP_NS:
            return False
        if self._world_T_latest is not None and not has_moved(self._world_T_latest, pose):
            return False
        self._due_ns = matches.stamp_ns
        return True

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


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        shares: camera -> share of its images that are registered, in this round or before, 0 to 1.
        share: the same of all images.
        absolute: share of all images with enough landmarks of the photographs to be registered by these alone.
    """

    shares: Mapping[str, float]
    share: float
    absolute: float


@dataclass(frozen=True)
class RegisteredImagePose:
    """The pose of a camera at an image.

    Attributes:
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4).
        position_sigma: [m].
        turning: (3,) angular velocity, in camera axes [rad/s].
        readout_time: of the rows [s]; 0 if unknown.
        coverage: share of the view in which landmarks were found.
        is_absolute: whether landmarks of the photographs alone are enough to register it.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    position_sigma: float
    turning: NDArray[np.float64]
    readout_time: float
    coverage: float
    is_absolute: bool


class RegistrationRecord:
    """All images of a recording in one or several rounds; of an image's registrations the most certain counts.

    Args:
        cameras: models by name.
        min_landmarks: that a registration takes.
    """

    def __init__(self, cameras: Mapping[str, CameraModel], min_landmarks: int) -> None:
        self._min_landmarks = min_landmarks
        self._views = {name: KeyframeSelection(model) for name, model in cameras.items()}
        self._images: dict[str, set[int]] = {name: set() for name in cameras}
        self._registered: dict[str, dict[int, RegisteredImagePose]] = {name: {} for name in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Add the registration of an image."""
        stamp_ns, registered = matches.stamp_ns, self._registered[matches.camera]
        self._images[matches.camera].add(stamp_ns)
        if matches.world_T_camera is None:
            return
        position_sigma = float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))
        if stamp_ns not in registered or position_sigma < registered[stamp_ns].position_sigma:
            registered[stamp_ns] = RegisteredImagePose(
                stamp_ns=stamp_ns,
                world_T_camera=matches.world_T_camera,
                position_sigma=position_sigma,
                turning=matches.turning,
                readout_time=matches.readout.in_use if matches.readout else 0.0,
                coverage=self._views[matches.camera].coverage(matches),
                is_absolute=len(matches.landmark_ids) - matches.grown >= self._min_landmarks,
            )

    def summary(self) -> ExtensionRound:
        """Shares of the images that are registered by now."""
        images = max(1, sum(map(len, self._images.values())))
        poses = {camera: self._in_order(camera) for camera in self._registered}
        everywhere = [pose for of_camera in poses.values() for pose in of_camera]
        return ExtensionRound(
            shares={camera: len(found) / max(1, len(self._images[camera])) for camera, found in poses.items()},
            share=len(everywhere) / images,
            absolute=sum(pose.is_absolute for pose in everywhere) / images,
        )

    def choose_keyframes(self) -> dict[str, list[RegisteredImagePose]]:
        """Camera -> images from places and directions that differ, which show what the photographs do not."""
        chosen = {camera: self._spread(camera) for camera in self._registered}
        total = sum(map(len, chosen.values()))
        if total <= _MAX_KEYFRAMES:
            return chosen
        # Evenly fewer of every camera.
        return {camera: _evenly(poses, _MAX_KEYFRAMES * len(poses) // total) for camera, poses in chosen.items()}

    def _in_order(self, camera: str) -> list[RegisteredImagePose]:
        return [pose for _, pose in sorted(self._registered[camera].items())]

    def _spread(self, camera: str) -> list[RegisteredImagePose]:
        chosen: list[RegisteredImagePose] = []
        for pose in self._in_order(camera):
            if pose.coverage >= _MAX_COVERED_OFFLINE or pose.position_sigma > MAX_SIGMA_M:
                continue
            if not chosen or has_moved(chosen[-1].world_T_camera, pose.world_T_camera):
                chosen.append(pose)
        return chosen


def _evenly(poses: list[RegisteredImagePose], wanted: int) -> list[RegisteredImagePose]:
    rows = np.linspace(0, len(poses) - 1, min(len(poses), max(1, wanted)))
    return [poses[row] for row in np.unique(rows.round().astype(int)).tolist()]
