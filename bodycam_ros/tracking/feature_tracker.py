"""One camera's feature tracks: followed from frame to frame, replenished and named on keyframes."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.model import mode_of_size
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.settings import setting
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH, KeypointDetector, KeypointSettings, far_from, thin_out
from bodycam_ros.tracking.optical_flow import OpticalFlowSettings, follow
from bodycam_ros.tracking.rotation import RotationSettings, estimate_rotation
from bodycam_ros.tracking.track_frame import LONGEST_NS, TrackFrame


@dataclass(frozen=True)
class TrackerSettings:
    """How many tracks, how old they may grow, and when to look for new ones."""

    keyframe_interval: int = setting(
        30,
        unit="frames",
        limits=(1, 300),
        reason="SIFT costs as much as ten frames of tracking, and a camera that hardly turns keeps its tracks",
    )
    keyframe_survival: float = setting(
        0.55,
        limits=(0.0, 1.0),
        reason="a keyframe comes early when fewer of the last keyframe's tracks than this share are left",
    )
    keyframe_rotation: float = setting(
        0.6,
        unit="rad",
        limits=(0.01, 6.3),
        reason="a keyframe comes early once the camera turned this far: flow does not follow turning patches exactly",
    )
    min_keyframe_gap: float = setting(
        0.09,
        unit="s",
        limits=(0.0, 5.0),
        reason="a camera that sees nothing must not pay for a keyframe on every frame; at ten images a second one that "
        "turns quickly needs just that",
    )
    lost_keyframe_gap: float = setting(
        0.18,
        unit="s",
        limits=(0.0, 5.0),
        reason="a camera that the registration has lost is described again so soon: the next image may show more",
    )
    starved_survival: float = setting(
        0.25,
        limits=(0.0, 1.0),
        reason="keyframe at once, however soon after the last, when fewer than this share of its tracks survive",
    )
    max_track_age: float = setting(
        1.5,
        unit="s",
        limits=(0.05, 60.0),
        reason="flow drifts by some hundredths of a pixel a frame; an old track ends at the next keyframe",
    )
    min_distance_px: float = setting(
        3.0,
        unit="px",
        limits=(1.0, 50.0),
        reason="an old track this near to a fresh keypoint gives way to it, and of two fresh ones the weaker",
    )
    max_view_angle_deg: float = setting(
        86.0,
        unit="deg",
        limits=(20.0, 110.0),
        reason="fisheye pictures end near 90 degrees, and their rim is no feature of the world",
    )


_RIM_SAMPLES = 1440
"""Between two of them a rim of 2000 px radius bends by 0.005 px."""

_NEAR_PX = 5  # width of the band along the rim whose pixels are asked
_FAR = 4.0  # image sizes from the principal point: what is farther is drawn there


def view_mask(camera: CameraModel, max_view_angle_deg: float) -> NDArray[np.uint8]:
    """(H, W) mask, 255 where a pixel looks at most this far from the optical axis."""
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
    """Pixels (N, 2) of all that is at an angle to the axis [rad], drawn in to where it is surely out of the image."""
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
        settings, keypoints, flow, rotation: settings of the tracker and of its steps.
    """

    def __init__(
        self,
        camera: CameraModel,
        settings: TrackerSettings | None = None,
        keypoints: KeypointSettings | None = None,
        flow: OpticalFlowSettings | None = None,
        rotation: RotationSettings | None = None,
    ) -> None:
        self.camera = camera
        self.settings = settings or TrackerSettings()
        self._flow = flow or OpticalFlowSettings()
        self._rotation = rotation or RotationSettings()
        self._detector = KeypointDetector(keypoints or KeypointSettings())
        self._mask = view_mask(camera, self.settings.max_view_angle_deg)
        self._image: NDArray[np.uint8] | None = None
        self._stamp_ns = 0
        self._pixels = np.zeros((0, 2), np.float32)
        self._bearings = np.zeros((0, 3))
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

    def track(self, image: NDArray[np.uint8], stamp_ns: int) -> TrackFrame:
        """Follow all tracks into the next image.

        Args:
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.

        Raises:
            RecordingError: the image has another size than the camera model, or its stamp does not advance.
        """
        self.check(image, stamp_ns)
        current_R_previous, rotation_inliers = self._follow_tracks(image, stamp_ns)
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

    def prune(self, stamp_ns: int, named: NDArray[np.uint32]) -> None:
        """Drop the tracks that the registrar found no landmark for; call it while the camera is registered.

        Most keypoints are none of the map's landmarks, and to follow them would cost more than all the others. A live
        graph may be some frames late with this: unnamed tracks take no part in a pose.

        Args:
            stamp_ns: the frame that the registrar speaks of [ns].
            named: (N,) ids of the tracks that carried a landmark in it.
        """
        self._is_lost = False
        self._keep(np.isin(self._ids, named) | (self._born_ns > stamp_ns))
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
        """Go on from an image in which somebody else has found what to track.

        Args:
            image, stamp_ns: as of ``track``.
            track_ids: (N,) ascending; those of ``new_ids`` or of tracks that are there.
            pixels: (N, 2) where they are.
            current_R_previous: (3, 3) rotation of the camera since the image before.
            afresh: whether these are all that is needed, as after a keyframe.
        """
        at = np.searchsorted(self._ids, track_ids)
        known = at < len(self._ids)
        known[known] = self._ids[at[known]] == track_ids[known]
        born_ns = np.full(len(track_ids), stamp_ns)
        if not afresh:
            born_ns[known] = self._born_ns[at[known]]
        if self._image is not None and stamp_ns > self._stamp_ns:
            self._turning = log_so3(current_R_previous) / (stamp_ns - self._stamp_ns)
        self._image, self._stamp_ns = image, stamp_ns
        self._ids, self._born_ns = track_ids.astype(np.uint32), born_ns
        self._pixels = np.ascontiguousarray(pixels, np.float32)
        self._bearings = self.camera.unproject(self._pixels)[0]
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
        """Whether somebody asked that the next image be a keyframe."""
        return self._keyframe_wanted

    def want_keyframe(self) -> None:
        """Make the next image a keyframe, for a registrar that knows nothing of the tracks so far."""
        self._keyframe_wanted = True

    def lost(self) -> None:
        """Somebody could not register the images.

        The next is a keyframe, unless there was one lately, and keyframes have more keypoints to find the camera by.
        """
        self._is_lost = True
        self._keyframe_wanted |= self._stamp_ns - (self._keyframe_ns or 0) >= 1e9 * self.settings.lost_keyframe_gap

    def check(self, image: NDArray[np.uint8], stamp_ns: int) -> None:
        """Refuse what is no next image of this camera; raises RecordingError as ``track``."""
        expected = (self.camera.height, self.camera.width)
        if image.shape != expected:
            size, of_lens = (image.shape[1], image.shape[0]), (self.camera.width, self.camera.height)
            raise RecordingError(
                f"camera {self.camera.name}: image of {size[0]}x{size[1]} pixels, but its camera_info says "
                f"{of_lens[0]}x{of_lens[1]}, {mode_of_size(of_lens, size)}"
            )
        if self._image is not None and stamp_ns <= self._stamp_ns:
            raise RecordingError(
                f"camera {self.camera.name}: stamp {stamp_ns} ns is not later than {self._stamp_ns} ns before it; "
                "images must come in order of time"
            )

    def _follow_tracks(self, image: NDArray[np.uint8], stamp_ns: int) -> tuple[NDArray[np.float64], int]:
        """Move the tracks on and drop the lost ones; the rotation between the frames and its inliers."""
        if self._image is None or len(self._pixels) == 0:
            return np.eye(3), 0
        bearings_previous = self._bearings
        predicted = self._predict(bearings_previous, stamp_ns - self._stamp_ns)
        pixels, alive = follow(self._image, image, self._pixels, predicted, self._flow)
        bearings_current, in_view = self.camera.unproject(pixels)
        alive &= in_view & self._in_mask(pixels)
        self._pixels, self._bearings = pixels, bearings_current
        self._keep(alive)
        current_R_previous, agree = estimate_rotation(
            bearings_previous[alive], bearings_current[alive], self._rotation, seed=self._next_id
        )
        self._turning = log_so3(current_R_previous) / (stamp_ns - self._stamp_ns)
        self._turned += float(np.linalg.norm(log_so3(current_R_previous)))
        return current_R_previous, int(agree.sum())

    def _predict(self, bearings_previous: NDArray[np.float64], passed_ns: int) -> NDArray[np.float32]:
        """Where the tracks would be if the camera kept turning as it did."""
        predicted, valid = self.camera.project(
            bearings_previous @ exp_so3(min(passed_ns, LONGEST_NS) * self._turning).T
        )
        usable = valid & self.camera.in_image(predicted)
        return np.where(usable[:, None], predicted, self._pixels).astype(np.float32)

    def _keyframe_is_due(self) -> bool:
        self._frames_since_keyframe += 1
        survivors = len(self._ids)
        due = (
            self._tracks_at_keyframe == 0
            or self._keyframe_wanted
            or self._frames_since_keyframe >= self.settings.keyframe_interval
            or self._turned > self.settings.keyframe_rotation
            or survivors < self.settings.keyframe_survival * self._tracks_at_keyframe
        )
        since_keyframe_ns = self._stamp_ns - self._keyframe_ns if self._keyframe_ns is not None else None
        rested = since_keyframe_ns is None or since_keyframe_ns >= 1e9 * self.settings.min_keyframe_gap
        # Where a fast swing takes nearly all tracks at once, the few that are left will not reach the next keyframe.
        starved = survivors < self.settings.starved_survival * self._tracks_at_keyframe
        return due and (rested or starved)

    def _replenish(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint32], NDArray[np.uint8], NDArray[np.float32]]:
        """Start described tracks on fresh SIFT keypoints; old tracks stay where there is no fresh one."""
        keypoints = self._detector.detect(image, self._mask, self._is_lost)
        fresh = thin_out(keypoints.pixels, keypoints.responses, self.settings.min_distance_px)
        # They stay in the detector's order: a registrar that looks only some of them up asks all parts of the picture.
        pixels = keypoints.pixels[fresh]
        young = self._stamp_ns - self._born_ns < 1e9 * self.settings.max_track_age
        self._keep(young & far_from(self._pixels, pixels, self.settings.min_distance_px))

        described = np.arange(len(self._ids), len(self._ids) + len(fresh), dtype=np.uint32)
        new_ids = self.new_ids(len(fresh))
        self._pixels = np.concatenate([self._pixels, pixels])
        self._bearings = np.concatenate([self._bearings, self.camera.unproject(pixels)[0]])
        self._ids = np.concatenate([self._ids, new_ids])
        self._born_ns = np.concatenate([self._born_ns, np.full(len(fresh), self._stamp_ns)])
        self._keyframe_ns = self._stamp_ns
        self._keyframe_wanted = False
        self._tracks_at_keyframe = len(self._ids)
        self._frames_since_keyframe = 0
        self._turned = 0.0
        return described, keypoints.descriptors[fresh], keypoints.scales[fresh]

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        self._pixels, self._bearings = self._pixels[kept], self._bearings[kept]
        self._ids, self._born_ns = self._ids[kept], self._born_ns[kept]

    def _in_mask(self, pixels: NDArray[np.float32]) -> NDArray[np.bool_]:
        columns, rows = np.rint(pixels).astype(int).T if len(pixels) else (np.zeros(0, int), np.zeros(0, int))
        inside = (columns >= 0) & (columns < self.camera.width) & (rows >= 0) & (rows < self.camera.height)
        seen = np.zeros(len(pixels), bool)
        seen[inside] = self._mask[rows[inside], columns[inside]] > 0
        return seen
