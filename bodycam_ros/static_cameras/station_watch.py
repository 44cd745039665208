"""Static cameras as the solver asks them: images in, what they say of the body out (B 2)."""

import logging
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyNow, SaidSegments, SegmentPose
from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.motion_model import MotionSettings, motion_sigmas
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.static_cameras import girths
from bodycam_ros.static_cameras.articulated_step import ExpectedBody
from bodycam_ros.static_cameras.limb_search import CarriedBody
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import PlacedBody, placed_segments
from bodycam_ros.static_cameras.station import Image

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
        placed: where the body is at the first image, as a person placed it; None where nobody did.
        motion: how suddenly segments change their motion.
        on_seen: told what an instant's images said, and the stamp of each station's [ns].
    """

    def __init__(
        self,
        tracker: RegionTracker,
        placed: PlacedBody | None,
        motion: MotionSettings,
        on_seen: Callable[[Mapping[str, int], StaticMeasurement], None] = lambda stamps_ns, seen: None,
    ) -> None:
        self._tracker, self._placed = tracker, placed
        self._motion, self._on_seen = motion, on_seen
        self._unreadable: set[str] = set()
        self._has_colours = False

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``StaticCameras.place``: once, and nothing without a placed body, or without an image."""
        pictures = {} if self._placed is None else self._decoded(frame.images)
        if self._placed is None or not pictures:
            return []
        poses = self._tracker.begin(pictures, self._placed.world_T_segment, self._placed.unplaced)
        self._placed, self._has_colours = None, True
        return placed_segments(self._tracker.body, poses)

    def measure(
        self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """As ``StaticCameras.measure``; in the first images a body placed by body cameras is searched as a whole."""
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


class LoneStation:
    """Says what each of its images shows of the body.

    Args:
        name: of the station.
        tracker: of the body in its images alone.
        placed: where the body is in the first image, as a person placed it; None where nobody did.
        motion: how suddenly segments change their motion.
    """

    def __init__(self, name: str, tracker: RegionTracker, placed: PlacedBody | None, motion: MotionSettings) -> None:
        self._name, self._placed = name, placed
        self._body = tracker.body
        self._watch = StationWatch(tracker, placed, motion)
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

    def _look_on(self, frame: BodyFrame) -> StaticMeasurement | None:
        expected = self._carried.at(frame.stamp_ns)
        return None if expected is None else self._watch.measure(frame, *expected, ())

    def _look_first(self, frame: BodyFrame) -> StaticMeasurement | None:
        heard = self._heard(frame.stamp_ns)
        expected = self._carried.at(frame.stamp_ns)
        if heard is not None and expected is not None:
            poses, ahead_s = expected
            known = [
                SegmentPose(self._body.segments[row], poses[row], heard.covariances[row])
                for row in np.flatnonzero(heard.observed).tolist()
            ]
            return self._watch.measure(frame, poses, ahead_s, known)
        begun = self._watch.place(frame)
        if self._placed is None or not begun:
            return None
        poses = self._placed.world_T_segment.copy()
        for each in begun:
            poses[self._body.segment_index[each.segment]] = each.world_T_segment
        return self._watch.measure(frame, poses, 0.0, ())


_WRIST_LIMITS = ((-1.3, 1.3), (-0.3, 0.3), (-0.7, 0.7))
"""[rad] of its angles in the order y, z, x: to the sides, about the forearm, and towards the palm."""


def with_hands(body: BodyModel) -> BodyModel:
    """The body with a hand on each forearm that has none, at a wrist as far from the elbow as the upper arm is long."""
    segments, joints = list(body.segments), list(body.joints)
    for segment in body.segments:
        name = SegmentName(segment)
        hand = f"hand{name.side}"
        if name.kind == "forearm" and hand not in segments:
            segments.append(hand)
            joints.append(_wrist(body, segment, hand, f"wrist{name.side}"))
    return replace(body, segments=tuple(segments), joints=tuple(joints))


def _wrist(body: BodyModel, forearm: str, hand: str, name: str) -> Joint:
    place = rigid(np.eye(3), -_forearm_length(body, forearm) * np.array([0.0, 0.0, 1.0]))
    return Joint(name, forearm, hand, "ball", place, angle_axes="yzx", limits=_WRIST_LIMITS)


def _forearm_length(body: BodyModel, forearm: str) -> float:
    """From elbow to wrist [m], by the length of the upper arm; by the body's stature where there is none."""
    elbow = body.joint_to_parent(forearm)
    upper_arm: Array = np.zeros(3) if elbow is None else elbow.parent_T_joint[:3, 3]
    length = float(np.linalg.norm(upper_arm))
    if elbow is None or SegmentName(elbow.parent).kind != "upper_arm" or length < 0.05:
        return girths.BONES["forearm"] * girths.stature_of(body)
    return length * girths.BONES["forearm"] / girths.BONES["upper_arm"]
