"""A station that looks by itself, in a process of its own, and hears of the body from a solver."""

import numpy as np

from bodycam_ros.body_state import BodyNow, SaidSegments, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.estimation.body_frame import BodyFrame
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.estimation.seen_body import SeenBody
from bodycam_ros.geometry import Array
from bodycam_ros.outside.carried_body import CarriedBody
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station_watch import StationWatch


class LoneStation:
    """Says what each of its images shows of the body.

    Args:
        name: of the station.
        tracker: of the body in its images alone.
        placed: (S, 4, 4) where the body is in the first image, as a person placed it; None where nobody did.
        settings: how well it was placed.
        motion: how suddenly segments change their motion.
    """

    def __init__(
        self, name: str, tracker: RegionTracker, placed: Array | None, settings: RegionSettings, motion: MotionSettings
    ) -> None:
        self._name, self._placed = name, placed
        self._body = tracker.body
        self._watch = StationWatch(tracker, placed, settings, motion)
        self._carried = CarriedBody(motion)
        self._begun = False

    def hear(self, body: BodyNow) -> None:
        """Where the solver has the body at an instant."""
        self._carried.hear(body)

    def knows(self, stamp_ns: int) -> bool:
        """Whether it knows by a solver, or by its own images, where the body is at a time."""
        return self._begun or self._heard(stamp_ns) is not None

    def look(self, image: CameraImage) -> SaidSegments | None:
        """What an image says, which is later than the one before.

        None while nobody knows where the body is, and of an image that cannot be used, which ``StationWatch`` warns of.
        """
        frame = BodyFrame(image.stamp_ns, {}, {self._name: image})
        seen = self._look_on(frame) if self._begun else self._look_first(frame)
        if seen is None:
            return None
        self._begun = True
        self._carried.find(image.stamp_ns, seen.world_T_segment)
        shares = seen.confidence[self._name].tolist()
        confidence = dict(zip(self._body.segments, shares, strict=True))
        return SaidSegments(self._name, image.stamp_ns, tuple(seen.evidence[self._name]), confidence)

    def _heard(self, stamp_ns: int) -> BodyNow | None:
        """What a solver says that cameras see; a guess of what none sees is no place to begin.

        Nor is a single instant: limbs that are looked for hang on a trunk whose motion must be known.
        """
        heard = self._carried.heard_by(stamp_ns)
        if heard is None or not heard.observed.any() or self._carried.heard_by(heard.stamp_ns - 1) is None:
            return None
        return heard

    def _look_on(self, frame: BodyFrame) -> SeenBody | None:
        expected = self._carried.at(frame.stamp_ns)
        return None if expected is None else self._watch.look(frame, *expected, ())

    def _look_first(self, frame: BodyFrame) -> SeenBody | None:
        heard = self._heard(frame.stamp_ns)
        expected = self._carried.at(frame.stamp_ns)
        if heard is not None and expected is not None:
            poses, ahead_s = expected
            known = [
                SegmentPose(self._body.segments[row], poses[row], heard.covariances[row])
                for row in np.flatnonzero(heard.observed).tolist()
            ]
            return self._watch.look(frame, poses, ahead_s, known)
        begun = self._watch.begin(frame)
        if self._placed is None or not begun:
            return None
        poses = self._placed.copy()
        for each in begun:
            poses[self._body.segment_index[each.segment]] = each.world_T_segment
        return self._watch.look(frame, poses, 0.0, ())
