"""A static camera alone, live: each of its images measures the segments that it shows.

The solver's state is accurate but late; the camera's own measurements since then are recent but of one view. So the
body is predicted from the solver's state by the motion that the camera has measured since, and from there at constant
velocity.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body_state import BodyFrame, BodyNow, SaidSegments, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.estimation.motion_model import MotionSettings, orthonormal, predict
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.static_measurement import StationWatch

_REMEMBERED = 100
"""Steps and poses: some seconds, more than a solver is behind."""

_LONGEST_S = 0.5
"""For so long a body goes on by itself; after a longer pause it is looked for where it was."""


@dataclass(frozen=True, eq=False)
class _Step:
    """How a station saw the body move: poses at the end are those at the beginning @ motion (S, 4, 4)."""

    begin_ns: int
    end_ns: int
    motion: Array

    @property
    def seconds(self) -> float:
        return 1e-9 * (self.end_ns - self.begin_ns)

    def after(self, stamp_ns: int) -> Array:
        """The part of the motion that comes after a time."""
        share = (self.end_ns - max(stamp_ns, self.begin_ns)) / (self.end_ns - self.begin_ns)
        return self.motion if share >= 1.0 else exp_se3(share * log_se3(self.motion))


class CarriedBody:
    """Carries a body on from what is heard and seen of it.

    Args:
        motion: how a velocity fades.
    """

    def __init__(self, motion: MotionSettings) -> None:
        self._motion = motion
        self._heard: deque[BodyNow] = deque(maxlen=_REMEMBERED)
        self._steps: deque[_Step] = deque(maxlen=_REMEMBERED)
        self._found: tuple[int, Array] | None = None

    def hear(self, body: BodyNow) -> None:
        """Where the body was; what was said of a later time is forgotten: time has begun anew."""
        while self._heard and self._heard[-1].stamp_ns >= body.stamp_ns:
            self._heard.pop()
        self._heard.append(body)

    def find(self, stamp_ns: int, world_T_segment: Array) -> None:
        """The station has found the body at poses (S, 4, 4), later than the time before."""
        latest = self._latest(stamp_ns)
        if latest is not None and latest[0] < stamp_ns:
            self._steps.append(_Step(latest[0], stamp_ns, inverse(latest[1]) @ world_T_segment))
        self._found = stamp_ns, world_T_segment

    def heard_by(self, stamp_ns: int) -> BodyNow | None:
        """The latest that was heard of a time not after this one."""
        return next((body for body in reversed(self._heard) if body.stamp_ns <= stamp_ns), None)

    def at(self, stamp_ns: int) -> tuple[Array, float] | None:
        """Poses (S, 4, 4) at a time, and for how long the body goes on by itself until then [s]; None if unknown."""
        latest = self._latest(stamp_ns)
        if latest is None:
            return None
        latest_ns, poses = latest
        ahead_s = 1e-9 * (stamp_ns - latest_ns)
        if ahead_s > _LONGEST_S:
            return poses, _LONGEST_S
        before = self.heard_by(latest_ns - 1)
        heard = self.heard_by(latest_ns)
        if heard is not None and heard.stamp_ns == latest_ns:
            if before is None:
                return poses, ahead_s
            before_s = 1e-9 * (latest_ns - before.stamp_ns)
            return predict(before.world_T_segment, poses, before_s, ahead_s), ahead_s
        if not self._steps:
            return poses, ahead_s
        step = self._steps[-1]
        return predict(poses @ inverse(step.motion), poses, step.seconds, ahead_s), ahead_s

    def _latest(self, stamp_ns: int) -> tuple[int, Array] | None:
        """The latest time up to this one of which something is known, and the poses (S, 4, 4) then."""
        heard = self.heard_by(stamp_ns)
        if heard is None:
            return self._found
        if self._found is None or self._found[0] <= heard.stamp_ns:
            return heard.stamp_ns, heard.world_T_segment
        if not self._steps or heard.stamp_ns < self._steps[0].begin_ns:
            return self._found
        poses = heard.world_T_segment
        for step in self._steps:
            if step.end_ns > heard.stamp_ns:
                poses = poses @ step.after(heard.stamp_ns)
        return self._found[0], orthonormal(poses)


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
