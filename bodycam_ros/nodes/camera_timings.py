"""What the solver publishes about the cameras' timing: their clocks, and how long their rows are read out."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.video_mode import VideoMode
from bodycam_ros.messages.clocks import TIMING, TIMING_TYPE, timing_messages
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.nodes.qos import latched
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_history import ClockHistory

_STAMPS_OF_RATE = 31


class CameraTimings:
    """Publishers of ``<camera>/timing``, in the camera's own stamps.

    Args:
        stage: publishes.
        cameras: names.
    """

    def __init__(self, stage: Stage[Any], cameras: Iterable[str]) -> None:
        self._make = stage.make
        self._body: BodyModel | None = None
        self._stamps_ns: defaultdict[str, list[int]] = defaultdict(list)
        self._histories: dict[str, ClockHistory] = {}
        # The rows by the body file, and the clock: whoever comes late needs both.
        self._publishers = {each: stage.publisher(TIMING_TYPE, f"{each}{TIMING}", latched(2)) for each in cameras}

    def begin(self, body: BodyModel) -> None:
        """There is a body, or another one."""
        self._body = body
        self._stamps_ns.clear()

    def add(self, matches: LandmarkMatches, model: CameraModel | None) -> None:
        """A registration; once the camera's rate is known, the body's read-out time of that video mode is published."""
        camera, stamps_ns = matches.camera, self._stamps_ns[matches.camera]
        if self._body is None or model is None or len(stamps_ns) >= _STAMPS_OF_RATE or camera not in self._body.mounts:
            return
        stamps_ns.append(matches.stamp_ns)
        if len(stamps_ns) == _STAMPS_OF_RATE:
            rate = 1e9 / float(np.median(np.diff(stamps_ns)))
            readout = self._body.mounts[camera].readout_in(VideoMode(model.width, model.height, model.fx, rate))
            if readout is not None:
                self._publishers[camera].publish(timing_message(self._make, camera, SaidTiming(0, "body", readout)))

    def publish_clocks(self, histories: Mapping[str, ClockHistory]) -> None:
        """The clocks that have changed: each holds from the stamp on at which it was learned."""
        for camera, history in histories.items():
            if history == self._histories.get(camera) or camera not in self._publishers:
                continue
            self._histories[camera] = history
            now = replace(history.latest, since_ns=max(history.latest.since_ns, history.latest.at_ns))
            # Without rows: the registration knows them, and would count them twice.
            for _, message in timing_messages(self._make, ClockHistory(camera, (now,))):
                self._publishers[camera].publish(message)
