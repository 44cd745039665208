"""What the solver publishes about the cameras: where lost ones are, contradicted poses, clocks, and read-out times."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.video_mode import VideoMode
from bodycam_ros.messages.clocks import TIMING, TIMING_TYPE, timing_messages
from bodycam_ros.messages.header import MAP_FRAME, header_message
from bodycam_ros.messages.pose import stamped_pose_message
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.nodes.qos import latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.expected_cameras import ExpectedCameras
from bodycam_ros.timing.clock_history import ClockHistory

_STAMPS_OF_RATE = 31


class CameraFeedback:
    """Publishers of ``<camera>/expected_pose``, ``<camera>/doubt`` and ``<camera>/timing``, in the camera's own stamps.

    Args:
        stage: publishes.
        cameras: names.
    """

    def __init__(self, stage: Stage[Any], cameras: Iterable[str]) -> None:
        self._make = stage.make
        self._expected: ExpectedCameras | None = None
        self._body: BodyModel | None = None
        self._doubted_ns: dict[str, int] = {}
        self._stamps_ns: defaultdict[str, list[int]] = defaultdict(list)
        self._histories: dict[str, ClockHistory] = {}
        cameras = tuple(cameras)
        pose = "geometry_msgs/msg/PoseWithCovarianceStamped"
        self._poses = {each: stage.publisher(pose, f"{each}/expected_pose", reliable(1)) for each in cameras}
        self._doubts = {each: stage.publisher("std_msgs/msg/Header", f"{each}/doubt", reliable(1)) for each in cameras}
        # The rows by the body file, and the clock: whoever comes late needs both.
        self._timings = {each: stage.publisher(TIMING_TYPE, f"{each}{TIMING}", latched(2)) for each in cameras}

    def begin(self, body: BodyModel) -> None:
        """There is a body, or another one."""
        self._expected, self._body = ExpectedCameras(body), body
        self._doubted_ns.clear()
        self._stamps_ns.clear()

    def add(self, matches: LandmarkMatches, model: CameraModel | None) -> None:
        """A registration, in order of time; once the rate is known the read-out time of that mode is published."""
        if self._expected is None or self._body is None:
            return
        self._expected.hear(matches)
        camera, stamps_ns = matches.camera, self._stamps_ns[matches.camera]
        if model is None or len(stamps_ns) >= _STAMPS_OF_RATE or camera not in self._body.mounts:
            return
        stamps_ns.append(matches.stamp_ns)
        if len(stamps_ns) == _STAMPS_OF_RATE:
            rate = 1e9 / float(np.median(np.diff(stamps_ns)))
            readout = self._body.mounts[camera].readout_in(VideoMode(model.width, model.height, model.fx, rate))
            if readout is not None:
                self._timings[camera].publish(timing_message(self._make, camera, SaidTiming(0, "body", readout)))

    def publish(self, state: BodyState, pipeline: SkeletonPipeline) -> None:
        """Where the lost cameras are by the latest instant, and whose registrations the body contradicts."""
        clocks = pipeline.instants.watch.clocks
        for expected in self._expected.of(state, clocks) if self._expected is not None else ():
            message = stamped_pose_message(self._make, expected.stamp_ns, expected.world_T_camera, expected.covariance)
            self._poses[expected.camera].publish(message)
        for camera, refusal in pipeline.doubted.items():
            stamp_ns = refusal.until_ns
            if stamp_ns != self._doubted_ns.get(camera):
                self._doubted_ns[camera] = stamp_ns
                own_ns = stamp_ns + (clocks[camera].offset_ns(stamp_ns) if camera in clocks else 0)
                self._doubts[camera].publish(header_message(self._make, own_ns, MAP_FRAME))

    def publish_clocks(self, histories: Mapping[str, ClockHistory]) -> None:
        """The clocks that have changed: each holds from the stamp on at which it was learned."""
        for camera, history in histories.items():
            if history == self._histories.get(camera) or camera not in self._timings:
                continue
            self._histories[camera] = history
            now = replace(history.latest, since_ns=max(history.latest.since_ns, history.latest.at_ns))
            # Without rows: the registration knows them, and would count them twice.
            for _, message in timing_messages(self._make, ClockHistory(camera, (now,))):
                self._timings[camera].publish(message)
