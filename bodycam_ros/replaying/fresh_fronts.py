"""Fronts of cameras that begin anew at given times, so that a stretch of a recording is registered as in the whole.

A tracker prefers the landmarks that it found before, for as long as it runs: two that began at different times find
others, and poses differ by millimetres ever after, however long both have run. So each camera has a second front a
moment before every such time, which takes over then. A stretch that begins there has the same one, to the last bit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.tracking.track_frame import TrackFrame

LEAD_NS, TAKES_OVER_NS = 1_500_000_000, 500_000_000
"""How long before a time the second front begins, and takes over [ns].

Within a second it has found the camera, and which landmarks can be seen; half a second later the solver has forgotten
what was before (0.0003 cm after 0.3 s).
"""

Processed = tuple[TrackFrame, LandmarkMatches, BodyKeyframe | None]


@dataclass
class _Camera:
    """Its front, the next one while that warms up, and times that it has still to begin anew for, ascending [ns]."""

    front: CameraFront
    waiting_ns: list[int]
    fresh: CameraFront | None = None


class FreshFronts:
    """One camera's front after the other.

    Args:
        make: makes the front of a camera of its name, with its read-out time as far as it is known.
        anew_ns: times that fronts begin anew for, ascending [ns]; none where they never do.
        readouts: camera -> its read-out time before the first image.
        carries_readouts: a new front begins with the read-out time that the one before found; else with ``readouts``.
    """

    def __init__(
        self,
        make: Callable[[str, Readout | None], CameraFront],
        anew_ns: Sequence[int],
        readouts: dict[str, Readout | None],
        carries_readouts: bool,
    ) -> None:
        self._make, self._readouts, self._carries = make, readouts, carries_readouts
        self._cameras = {name: _Camera(make(name, readout), [*anew_ns]) for name, readout in readouts.items()}

    def process(self, name: str, image: NDArray[np.uint8], stamp_ns: int) -> Processed:
        """Track and register the next image of a camera, as ``CameraFront.process``."""
        camera = self._cameras[name]
        while camera.waiting_ns and stamp_ns >= camera.waiting_ns[0] - TAKES_OVER_NS:
            camera.waiting_ns.pop(0)
            # After a pause of its images there is no second front yet, and the first of a stretch is the second.
            camera.front, camera.fresh = camera.fresh or self._next_of(name), None
        if camera.waiting_ns and stamp_ns >= camera.waiting_ns[0] - LEAD_NS:
            camera.fresh = camera.fresh or self._next_of(name)
            camera.fresh.process(image, stamp_ns)
        return camera.front.process(image, stamp_ns)

    def _next_of(self, name: str) -> CameraFront:
        found = self._cameras[name].front.known.registered.readout
        return self._make(name, found if self._carries else self._readouts[name])
