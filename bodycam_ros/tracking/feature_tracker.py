"""One camera's feature tracks: followed from frame to frame, replenished and named on keyframes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.settings import setting
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH, KeypointDetector
from bodycam_ros.tracking.optical_flow import OpticalFlowSettings, follow
from bodycam_ros.tracking.replenish import choose_balanced
from bodycam_ros.tracking.rotation import RotationSettings, estimate_rotation
from bodycam_ros.tracking.track_frame import TrackFrame


@dataclass(frozen=True)
class TrackerSettings:
    """How many tracks, how old they may grow, and when to look for new ones."""

    max_tracks: int = setting(
        180, limits=(20, 2000), reason="tracks per camera after a keyframe; about half find a landmark, and 60 landmarks hold a pose to millimetres"
    )
    keyframe_interval: int = setting(
        10, unit="frames", limits=(1, 300), reason="SIFT costs as much as ten frames of tracking; a third of a second between names is bearable"
    )
    keyframe_survival: float = setting(
        0.55, limits=(0.0, 1.0), reason="a keyframe comes early when fewer of the last keyframe's tracks than this share are left"
    )
    min_keyframe_gap: int = setting(3, unit="frames", limits=(1, 60), reason="a camera that sees nothing must not pay for a keyframe on every frame")
    max_track_age: int = setting(
        30, unit="frames", limits=(2, 1000), reason="flow drifts by some hundredths of a pixel a frame; an old track makes room for a fresh feature"
    )
    grid_cell_px: int = setting(64, unit="px", limits=(16, 256), reason="new tracks are shared out over cells of this size")
    min_distance_px: float = setting(5.0, unit="px", limits=(1.0, 50.0), reason="a new track keeps this far from every other")
    contrast_threshold: float = setting(0.02, limits=(0.001, 0.2), reason="SIFT contrast; half of Lowe's value, for dim halls and compressed images")
    max_view_angle_deg: float = setting(
        86.0, unit="deg", limits=(20.0, 110.0), reason="fisheye pictures end near 90 degrees, and their rim is no feature of the world"
    )


class FeatureTracker:
    """Tracks features through the images of one camera.

    Args:
        camera: its model; the rotation is estimated on bearings.
        settings, flow, rotation: settings of the tracker and of its two steps.
    """

    def __init__(
        self,
        camera: CameraModel,
        settings: TrackerSettings | None = None,
        flow: OpticalFlowSettings | None = None,
        rotation: RotationSettings | None = None,
    ) -> None:
        self.camera = camera
        self.settings = settings or TrackerSettings()
        self._flow = flow or OpticalFlowSettings()
        self._rotation = rotation or RotationSettings()
        self._detector = KeypointDetector(self.settings.contrast_threshold)
        self._mask = _view_mask(camera, self.settings.max_view_angle_deg)
        self._image: NDArray[np.uint8] | None = None
        self._stamp_ns = 0
        self._pixels = np.zeros((0, 2), np.float32)
        self._ids = np.zeros(0, np.uint32)
        self._ages = np.zeros(0, np.int64)
        self._next_id = 1
        self._frames_since_keyframe = 0
        self._tracks_at_keyframe = 0
        self._rotation_per_frame = np.eye(3)

    def track(self, image: NDArray[np.uint8], stamp_ns: int) -> TrackFrame:
        """Follow all tracks into the next image.

        Args:
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.

        Raises:
            RecordingError: the image has another size than the camera model, or its stamp does not advance.
        """
        self._check(image, stamp_ns)
        current_R_previous, rotation_inliers = self._follow_tracks(image)
        previous_stamp_ns, self._image, self._stamp_ns = self._stamp_ns, image, stamp_ns
        described = np.zeros(0, np.uint32)
        descriptors = np.zeros((0, DESCRIPTOR_LENGTH), np.uint8)
        scales = np.zeros(0, np.float32)
        keyframe = self._keyframe_is_due()
        if keyframe:
            described, descriptors, scales = self._replenish(image)
        return TrackFrame(
            camera=self.camera.name,
            stamp_ns=stamp_ns,
            previous_stamp_ns=previous_stamp_ns,
            track_ids=self._ids.copy(),
            pixels=self._pixels.copy(),
            described=described,
            descriptors=descriptors,
            scales=scales,
            keyframe=keyframe,
            current_R_previous=current_R_previous,
            rotation_inliers=rotation_inliers,
        )

    def _check(self, image: NDArray[np.uint8], stamp_ns: int) -> None:
        expected = (self.camera.height, self.camera.width)
        if image.shape != expected:
            raise RecordingError(
                f"camera {self.camera.name}: image of {image.shape[1]}x{image.shape[0]} pixels, but its camera_info says "
                f"{expected[1]}x{expected[0]}; record camera_info at the resolution of the images"
            )
        if stamp_ns <= self._stamp_ns:
            raise RecordingError(
                f"camera {self.camera.name}: stamp {stamp_ns} ns is not later than {self._stamp_ns} ns before it; images must come in order of time"
            )

    def _follow_tracks(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], int]:
        """Move the tracks on and drop the lost ones; the rotation between the frames and its inliers."""
        if self._image is None or len(self._pixels) == 0:
            return np.eye(3), 0
        bearings_previous, _ = self.camera.unproject(self._pixels)
        predicted = self._predict(bearings_previous)
        pixels, alive = follow(self._image, image, self._pixels, predicted, self._flow)
        bearings_current, in_view = self.camera.unproject(pixels)
        alive &= in_view & self._in_mask(pixels)
        self._pixels, self._ids, self._ages = pixels[alive], self._ids[alive], self._ages[alive] + 1
        current_R_previous, agree = estimate_rotation(
            bearings_previous[alive], bearings_current[alive], self._rotation, seed=self._next_id
        )
        self._rotation_per_frame = current_R_previous
        return current_R_previous, int(agree.sum())

    def _predict(self, bearings_previous: NDArray[np.float64]) -> NDArray[np.float32]:
        """Where the tracks would be if the camera kept turning as it did."""
        predicted, valid = self.camera.project(bearings_previous @ self._rotation_per_frame.T)
        usable = valid & self.camera.in_image(predicted)
        return np.where(usable[:, None], predicted, self._pixels).astype(np.float32)

    def _keyframe_is_due(self) -> bool:
        self._frames_since_keyframe += 1
        survivors = len(self._ids)
        due = (
            self._tracks_at_keyframe == 0
            or self._frames_since_keyframe >= self.settings.keyframe_interval
            or survivors < self.settings.keyframe_survival * self._tracks_at_keyframe
        )
        return due and (self._next_id == 1 or self._frames_since_keyframe >= self.settings.min_keyframe_gap)

    def _replenish(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint32], NDArray[np.uint8], NDArray[np.float32]]:
        """Start described tracks on fresh SIFT keypoints, most where the image has fewest tracks."""
        young = self._ages < self.settings.max_track_age
        self._pixels, self._ids, self._ages = self._pixels[young], self._ids[young], self._ages[young]
        keypoints = self._detector.detect(image, self._mask)
        chosen = choose_balanced(
            keypoints.pixels, keypoints.responses, self._pixels, image.shape,
            self.settings.max_tracks - len(self._ids), self.settings.grid_cell_px, self.settings.min_distance_px,
        )
        descriptors = self._detector.describe(image, keypoints, chosen)
        described = np.arange(len(self._ids), len(self._ids) + len(chosen), dtype=np.uint32)
        new_ids = np.arange(self._next_id, self._next_id + len(chosen), dtype=np.uint32)
        self._next_id += len(chosen)
        self._pixels = np.concatenate([self._pixels, keypoints.pixels[chosen]])
        self._ids = np.concatenate([self._ids, new_ids])
        self._ages = np.concatenate([self._ages, np.zeros(len(chosen), np.int64)])
        self._tracks_at_keyframe = len(self._ids)
        self._frames_since_keyframe = 0
        return described, descriptors, keypoints.scales[chosen]

    def _in_mask(self, pixels: NDArray[np.float32]) -> NDArray[np.bool_]:
        columns, rows = np.rint(pixels).astype(int).T if len(pixels) else (np.zeros(0, int), np.zeros(0, int))
        inside = (columns >= 0) & (columns < self.camera.width) & (rows >= 0) & (rows < self.camera.height)
        seen = np.zeros(len(pixels), bool)
        seen[inside] = self._mask[rows[inside], columns[inside]] > 0
        return seen


def _view_mask(camera: CameraModel, max_view_angle_deg: float) -> NDArray[np.uint8]:
    """(H, W) mask, 255 where a pixel looks at most this far from the optical axis."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    bearings, valid = camera.unproject(np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64))
    seen = valid & (bearings[:, 2] > np.cos(np.radians(max_view_angle_deg)))
    return np.where(seen, 255, 0).astype(np.uint8).reshape(camera.height, camera.width)
