"""Static cameras as the solver asks them: images in, what they say of the body out (B 2)."""

import logging
from collections.abc import Callable, Collection, Mapping

import numpy as np

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.body_frame import BodyFrame
from bodycam_ros.estimation.motion_model import MotionSettings, motion_sigmas
from bodycam_ros.estimation.seen_body import SeenBody
from bodycam_ros.geometry import Array
from bodycam_ros.outside.articulated_step import ExpectedBody
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.start_file import placed_segments
from bodycam_ros.outside.station_view import Image

logger = logging.getLogger(__name__)

_FOLLOWED = np.repeat([0.03, 0.01], 3)
"""[rad], [m] errors of what a prediction goes on from."""


def followed(
    world_T_segment: Array, dt_s: float, motion: MotionSettings, previous_s: float | None = None
) -> ExpectedBody:
    """A body that should be at poses (S, 4, 4) ``dt_s`` after it was seen, and how far it may be from there.

    Its velocity is the mean over ``previous_s`` before that; over as long a time if it is not said.
    """
    sigmas = np.hypot(motion_sigmas(dt_s, previous_s or dt_s, motion), _FOLLOWED)
    return ExpectedBody(world_T_segment, sigmas, float(np.sqrt(2.0) * sigmas[0]))


class StationWatch:
    """Decodes images, and asks them where the body is.

    Args:
        tracker: of the body in all stations' images.
        placed: (S, 4, 4) where the body is at the first image, as a person placed it; None where nobody did.
        settings: how well it was placed.
        motion: how suddenly segments change their motion.
        on_seen: told what an instant's images said, and the stamp of each station's [ns].
    """

    def __init__(
        self,
        tracker: RegionTracker,
        placed: Array | None,
        settings: RegionSettings,
        motion: MotionSettings,
        on_seen: Callable[[Mapping[str, int], SeenBody], None] = lambda stamps_ns, seen: None,
    ) -> None:
        self._tracker, self._placed = tracker, placed
        self._settings, self._motion, self._on_seen = settings, motion, on_seen
        self._unreadable: set[str] = set()
        self._has_colours = False

    def begin(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``Onlookers.begin``: once, and nothing without a placed body, or without an image."""
        pictures = {} if self._placed is None else self._decoded(frame.images)
        if self._placed is None or not pictures:
            return []
        poses = self._tracker.begin(pictures, self._placed)
        self._placed, self._has_colours = None, True
        return placed_segments(self._tracker.body, poses, self._settings)

    def look(self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]) -> SeenBody | None:
        """As ``Onlookers.look``; in its first images a body that worn cameras have placed is looked for as a whole."""
        pictures = self._decoded(frame.images)
        if not pictures:
            return None
        if not self._has_colours and not known:
            return None
        if not self._has_colours:
            expected = self._tracker.find_limbs(pictures, expected, known)
            self._has_colours = True
        seen = self._tracker.look(pictures, followed(expected, dt_s, self._motion), known)
        self._on_seen({name: frame.images[name].stamp_ns for name in pictures}, seen)
        return seen

    def _decoded(self, images: Mapping[str, CameraImage]) -> dict[str, Image]:
        """Pictures of the images that can be decoded; the first of a station that cannot is warned about."""
        pictures = {}
        for name, image in images.items():
            try:
                picture = decode_colour(image)
                self._tracker.check_size(name, picture)
            except RecordingError as error:
                if name not in self._unreadable:
                    logger.warning("%s; it is left out, and so will be others like it", error)
                self._unreadable.add(name)
            else:
                pictures[name] = picture
        return pictures
