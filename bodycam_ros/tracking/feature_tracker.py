"""One camera's feature tracks: followed from frame to frame, replenished and described on keyframes."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.model import size_mismatch
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.tracking.camera_motion import LONGEST_NS
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings, far_from, thin_out
from bodycam_ros.tracking.optical_flow import follow
from bodycam_ros.tracking.rotation import estimate_rotation
from bodycam_ros.tracking.track_frame import TrackFrame, find_rows

_KEYFRAME_INTERVAL = 30  # [frames] SIFT costs as much as ten frames of tracking
_KEYFRAME_SURVIVAL = 0.55  # share of the last keyframe's tracks below which a keyframe comes early
_KEYFRAME_ROTATION = 0.6  # [rad] since the last keyframe: flow does not follow turning patches exactly
_MIN_KEYFRAME_GAP_NS = 90_000_000  # without features every frame would be a keyframe
_LOST_KEYFRAME_GAP_NS = 180_000_000  # between keyframes of a camera that is not registered
_STARVED_SURVIVAL = 0.25  # share of tracks below which a keyframe comes at once: a fast swing takes nearly all
_MAX_TRACK_AGE_NS = 1_500_000_000  # flow drifts by some hundredths of a pixel a frame
_MIN_DISTANCE_PX = 3.0  # an old track this near to a fresh keypoint ends, and of two fresh ones the weaker
MAX_VIEW_ANGLE_DEG = 86.0
"""Fisheye pictures end near 90 degrees from the axis, and their rim is no feature of the world."""

_RIM_SAMPLES = 1440
"""Between two of them a rim of 2000 px radius bends by 0.005 px."""

_NEAR_PX = 5  # width of the band along the rim that is tested pixel by pixel
_FAR = 4.0  # image sizes from the principal point: farther pixels are moved there


def view_mask(camera: CameraModel, max_view_angle_deg: float = MAX_VIEW_ANGLE_DEG) -> NDArray[np.uint8]:
    """(H, W) mask, 255 where a pixel's bearing is at most this far from the optical axis."""
    max_angle = np.radians(max_view_angle_deg)
    rim = _rim(camera, min(max_angle, camera.max_angle)).round().astype(np.int32)
    mask, near = np.zeros((2, camera.height, camera.width), np.uint8)
    cv2.fillPoly(mask, [rim], 255)
    cv2.polylines(near, [rim], isClosed=True, color=255, thickness=_NEAR_PX)
    rows, columns = np.nonzero(near)
    bearings, valid = camera.unproject(np.column_stack([columns, rows]))
    mask[rows, columns] = np.where(valid & (bearings[:, 2] > np.cos(max_angle)), 255, 0)
    return mask


def _rim(camera: CameraModel, angle: float) -> NDArray[np.float64]:
    """Pixels (N, 2) at an angle to the axis [rad], those far outside the image moved to ``_FAR``."""
    turn = np.linspace(0.0, 2.0 * np.pi, _RIM_SAMPLES, endpoint=False)
    bearings = np.column_stack(
        [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.full(_RIM_SAMPLES, np.cos(angle))]
    )
    centre = np.array([camera.cx, camera.cy])
    outwards = camera.project(bearings)[0] - centre
    reach = np.linalg.norm(outwards, axis=1, keepdims=True)
    farthest = _FAR * (camera.width + camera.height)
    rim: NDArray[np.float64] = centre + outwards * np.minimum(1.0, farthest / np.maximum(reach, 1.0))
    return rim


class FeatureTracker:
    """Tracks features through the images of one camera.

    Args:
        camera: its model; the rotation is estimated on bearings.
        keypoints: settings of the detector.
    """

    def __init__(self, camera: CameraModel, keypoints: KeypointSettings | None = None) -> None:
        self.camera = camera
        self._detector = KeypointDetector(keypoints or KeypointSettings())
        self._mask = view_mask(camera)
        self._image: NDArray[np.uint8] | None = None
        self._stamp_ns = 0
        self._pixels = np.zeros((0, 2), np.float32)
        self._ids = np.zeros(0, np.uint32)
        self._born_ns = np.zeros(0, np.int64)
        self._next_id = 1
        self._keyframe_ns: int | None = None
        self._keyframe_wanted = False
        self._is_lost = False
        self._frames_since_keyframe = 0
        self._tracks_at_keyframe = 0
        self._turned = 0.0
        self._turning = np.zeros(3)  # [rad/ns]

    def track(self, image: NDArray[np.uint8], stamp_ns: int, turn: NDArray[np.float64] | None = None) -> TrackFrame:
        """Follow all tracks into the next image.

        Args:
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.
            turn: (3, 3) rotation current_R_previous, where it is known beforehand.

        Raises:
            RecordingError: the image has another size than the camera model, or its stamp does not advance.
        """
        self.check(image, stamp_ns)
        current_R_previous, rotation_inliers = self._follow_tracks(image, stamp_ns, turn)
        previous_stamp_ns = self._stamp_ns
        self._image = image
        self._stamp_ns = stamp_ns
        keyframe = self._keyframe_is_due()
        fresh = self._replenish(image) if keyframe else {}
        return TrackFrame(
            camera=self.camera.name,
            stamp_ns=stamp_ns,
            previous_stamp_ns=previous_stamp_ns,
            track_ids=self._ids.copy(),
            pixels=self._pixels.copy(),
            keyframe=keyframe,
            current_R_previous=current_R_previous,
            rotation_inliers=rotation_inliers,
            **fresh,
        )

    def prune(self, stamp_ns: int, matched: NDArray[np.uint32]) -> None:
        """Drop the tracks without a landmark, while the camera is registered: most keypoints are no landmarks.

        Live, the result of a registration may come some frames late.

        Args:
            stamp_ns: the registered frame [ns].
            matched: (N,) ids of its tracks with a landmark.
        """
        self._is_lost = False
        self._keep(np.isin(self._ids, matched) | (self._born_ns > stamp_ns))
        if stamp_ns == self._keyframe_ns:
            self._tracks_at_keyframe = len(self._ids)

    def adopt(
        self,
        image: NDArray[np.uint8],
        stamp_ns: int,
        track_ids: NDArray[np.uint32],
        pixels: NDArray[np.float32],
        current_R_previous: NDArray[np.float64],
        afresh: bool = False,
    ) -> None:
        """Continue from an image whose tracks were found by their landmarks.

        Args:
            image, stamp_ns: as of ``track``.
            track_ids: (N,) ascending; of ``new_ids`` or of present tracks.
            pixels: (N, 2) their places.
            current_R_previous: (3, 3) rotation of the camera since the image before.
            afresh: whether these replace a keyframe.
        """
        born_ns = np.full(len(track_ids), stamp_ns)
        if not afresh:
            at, known = find_rows(self._ids, track_ids)
            born_ns[known] = self._born_ns[at[known]]
        if self._image is not None and stamp_ns > self._stamp_ns:
            self._turning = log_so3(current_R_previous) / (stamp_ns - self._stamp_ns)
        self._image, self._stamp_ns = image, stamp_ns
        self._ids, self._born_ns = track_ids.astype(np.uint32), born_ns
        self._pixels = np.ascontiguousarray(pixels, np.float32)
        if afresh:
            self._keyframe_ns = stamp_ns if self._keyframe_ns is None else self._keyframe_ns
            self._tracks_at_keyframe = len(track_ids)
            self._frames_since_keyframe = 0
            self._turned = 0.0

    def new_ids(self, count: int) -> NDArray[np.uint32]:
        """(count,) ids that no track has."""
        ids = np.arange(self._next_id, self._next_id + count, dtype=np.uint32)
        self._next_id += count
        return ids

    @property
    def keyframe_wanted(self) -> bool:
        """Whether the next image is to be a keyframe."""
        return self._keyframe_wanted

    def want_keyframe(self) -> None:
        """Make the next image a keyframe, for a registrar that starts anew."""
        self._keyframe_wanted = True

    def mark_registered(self) -> None:
        """The camera is registered: keyframes need fewer keypoints."""
        self._is_lost = False

    def mark_lost(self) -> None:
        """The camera is not registered: the next image is a keyframe with more keypoints unless one is recent."""
        self._is_lost = True
        self._keyframe_wanted |= self._stamp_ns - (self._keyframe_ns or 0) >= _LOST_KEYFRAME_GAP_NS

    def check(self, image: NDArray[np.uint8], stamp_ns: int) -> None:
        """Raise RecordingError, as ``track``, for an image that cannot follow."""
        expected = (self.camera.height, self.camera.width)
        if image.shape != expected:
            size, of_lens = (image.shape[1], image.shape[0]), (self.camera.width, self.camera.height)
            raise RecordingError(size_mismatch(of_lens, size), self.camera.name)
        if self._image is not None and stamp_ns <= self._stamp_ns:
            raise RecordingError(
                f"stamp {stamp_ns} ns is not later than {self._stamp_ns} ns before it; images must come in "
                "order of time",
                self.camera.name,
            )

    def _follow_tracks(
        self, image: NDArray[np.uint8], stamp_ns: int, turn: NDArray[np.float64] | None
    ) -> tuple[NDArray[np.float64], int]:
        """Move the tracks on and drop the lost ones; the rotation between the frames and its inliers."""
        if self._image is None or len(self._pixels) == 0:
            return np.eye(3), 0
        bearings_previous = self.camera.unproject(self._pixels)[0]
        if turn is None:
            turn = exp_so3(min(stamp_ns - self._stamp_ns, LONGEST_NS) * self._turning)
        predicted = self._predict(bearings_previous, turn)
        pixels, alive = follow(self._image, image, self._pixels, predicted)
        bearings_current, in_view = self.camera.unproject(pixels)
        alive &= in_view & self._in_mask(pixels)
        self._pixels = pixels
        self._keep(alive)
        current_R_previous, agree = estimate_rotation(
            bearings_previous[alive], bearings_current[alive], seed=self._next_id
        )
        self._turning = log_so3(current_R_previous) / (stamp_ns - self._stamp_ns)
        self._turned += float(np.linalg.norm(log_so3(current_R_previous)))
        return current_R_previous, int(agree.sum())

    def _predict(self, bearings_previous: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float32]:
        """Where the tracks would be after a rotation current_R_previous (3, 3) alone."""
        predicted, valid = self.camera.project(bearings_previous @ turn.T)
        usable = valid & self.camera.in_image(predicted)
        return np.where(usable[:, None], predicted, self._pixels).astype(np.float32)

    def _keyframe_is_due(self) -> bool:
        self._frames_since_keyframe += 1
        survivors = len(self._ids)
        due = (
            self._tracks_at_keyframe == 0
            or self._keyframe_wanted
            or self._frames_since_keyframe >= _KEYFRAME_INTERVAL
            or self._turned > _KEYFRAME_ROTATION
            or survivors < _KEYFRAME_SURVIVAL * self._tracks_at_keyframe
        )
        since_keyframe_ns = self._stamp_ns - self._keyframe_ns if self._keyframe_ns is not None else None
        rested = since_keyframe_ns is None or since_keyframe_ns >= _MIN_KEYFRAME_GAP_NS
        starved = survivors < _STARVED_SURVIVAL * self._tracks_at_keyframe
        return due and (rested or starved)

    def _replenish(self, image: NDArray[np.uint8]) -> dict[str, Any]:
        """Start described tracks on fresh SIFT keypoints, as a frame has them; old ones stay where none is fresh."""
        keypoints = self._detector.detect(image, self._mask, self._is_lost)
        fresh = thin_out(keypoints.pixels, keypoints.responses, _MIN_DISTANCE_PX)
        # They stay in the detector's order, which spreads over the picture.
        pixels = keypoints.pixels[fresh]
        young = self._stamp_ns - self._born_ns < _MAX_TRACK_AGE_NS
        self._keep(young & far_from(self._pixels, pixels, _MIN_DISTANCE_PX))

        described = np.arange(len(self._ids), len(self._ids) + len(fresh), dtype=np.uint32)
        new_ids = self.new_ids(len(fresh))
        self._pixels = np.concatenate([self._pixels, pixels])
        self._ids = np.concatenate([self._ids, new_ids])
        self._born_ns = np.concatenate([self._born_ns, np.full(len(fresh), self._stamp_ns)])
        self._keyframe_ns = self._stamp_ns
        self._keyframe_wanted = False
        self._tracks_at_keyframe = len(self._ids)
        self._frames_since_keyframe = 0
        self._turned = 0.0
        return dict(described=described, descriptors=keypoints.descriptors[fresh], scales=keypoints.scales[fresh])

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        self._pixels = self._pixels[kept]
        self._ids = self._ids[kept]
        self._born_ns = self._born_ns[kept]

    def _in_mask(self, pixels: NDArray[np.float32]) -> NDArray[np.bool_]:
        columns, rows = np.rint(pixels).astype(int).T if len(pixels) else (np.zeros(0, int), np.zeros(0, int))
        inside = (columns >= 0) & (columns < self.camera.width) & (rows >= 0) & (rows < self.camera.height)
        seen = np.zeros(len(pixels), bool)
        seen[inside] = self._mask[rows[inside], columns[inside]] > 0
        return seen
