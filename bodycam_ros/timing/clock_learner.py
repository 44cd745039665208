"""Learns the clocks of all cameras, a window of images at a time."""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_filter import ClockFilter
from bodycam_ros.timing.clock_state import ClockSettings, ClockState
from bodycam_ros.timing.clock_window import CameraTrack, ClockEvidence, clock_evidence
from bodycam_ros.timing.instant_sampler import CameraPath

MARGIN_NS = 300_000_000
"""Images beyond the ends of a window, for the paths at its ends and for clocks that are off."""

_SURPRISE = 5.0
"""Sigmas; tracks keep their errors, so three are not rare."""

_MOST_TURNS = 6
"""Of a window with clocks that moved; each leaves a fifth of what a clock is off by."""

_TRACKS_A_STEP = 8
"""Paths of cameras that are made in one step of the work."""

Images = Mapping[str, Sequence[LandmarkMatches]]


class ClockLearner:
    """Offsets and drifts of cameras against the reference, the first that is admitted.

    Args:
        body: which has been calibrated.
        settings: what is believed of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        start_ns: when it begins [ns].

    Attributes:
        cameras: that were admitted.
        strayed: cameras whose clock turned out to be one of its own.
    """

    def __init__(self, body: BodyModel, settings: ClockSettings, floor: NDArray[np.float64], start_ns: int) -> None:
        self._body, self._settings, self._floor = body, settings, floor
        self._filter = ClockFilter(settings)
        self._at_ns = start_ns
        self.cameras: list[str] = []
        self.strayed: set[str] = set()

    @property
    def reference(self) -> str:
        """The camera whose clock is the body's."""
        return self.cameras[self._filter.reference]

    def admit(self, camera: str, triggered: bool) -> None:
        """Learn the clock of one more camera, which shares its stamps with the reference's group or does not."""
        self.cameras.append(camera)
        self._filter.grow(triggered)

    def stray(self, camera: str) -> None:
        """A camera's clock is not what it was taken for, and not that of the others."""
        self._filter.free(self.cameras.index(camera))
        self.strayed.add(camera)

    def learn(self, images: Images, from_ns: int, to_ns: int) -> Generator[None, None, dict[str, ClockState]]:
        """Learn from a window of images, a few milliseconds at a time; nobody may be admitted or stray meanwhile.

        Args:
            images: camera -> its images, in order of time, some beyond both ends.
            from_ns, to_ns: the window [ns].

        Returns:
            Camera -> its clock, as if it had never been set; empty where nothing could be learned.
        """
        self._filter.advance(1e-9 * (to_ns - self._at_ns))
        self._at_ns = to_ns
        evidence = yield from self._evidence(images, from_ns, to_ns)
        if evidence is None:
            return {}
        told = evidence.information / self._settings.instants_alike
        alone, surprises = self._filter.surprises(evidence.delays, told)
        off = np.flatnonzero((surprises > _SURPRISE) & (np.abs(alone) > self._settings.jump)).tolist()
        if 2 * len(off) > len(self.cameras):
            off = [self._filter.reference]  # All at once: it is the one that they are compared with.
        if off:
            # Their stamps went on evenly, so these clocks are what they were: what was believed of them was wrong.
            for row in off:
                self.stray(self.cameras[row])
            evidence = (yield from self._evidence(images, from_ns, to_ns)) or evidence
            told = evidence.information / self._settings.instants_alike
        self._filter.learn(evidence.delays, told)
        return {camera: self._clock(row) for row, camera in enumerate(self.cameras)}

    def _clock(self, row: int) -> ClockState:
        """What is believed of a clock at the time of the filter."""
        of = self._filter
        offset = float(of.offsets[row])
        at_ns = self._at_ns + round(1e9 * offset)
        return ClockState(
            0, at_ns, offset, float(of.drifts[row]), float(of.offset_sigmas[row]), float(of.drift_sigmas[row])
        )

    def _evidence(self, images: Images, from_ns: int, to_ns: int) -> Generator[None, None, ClockEvidence | None]:
        """What a window says beyond what is believed; clocks that are far off are asked again."""
        evidence = None
        shifts = np.zeros(len(self.cameras))
        stamps_ns = np.arange(from_ns, to_ns, round(1e9 / self._settings.instants), dtype=np.int64)
        prior = self._filter.prior_information * self._settings.instants_alike
        for _ in range(_MOST_TURNS):
            tracks = {}
            for row, camera in enumerate(self.cameras):
                ahead_ns = round(1e9 * float(self._filter.offsets[row] + shifts[row]))
                tracks[camera] = self._track(images.get(camera, ()), ahead_ns, from_ns, to_ns)
                if row % _TRACKS_A_STEP == _TRACKS_A_STEP - 1:
                    yield
            found = yield from clock_evidence(self._body, tracks, stamps_ns, self._settings.max_gap, prior, -shifts)
            if found is None:
                return None
            evidence = replace(found, delays=found.delays + shifts)
            if np.abs(found.delays).max() < self._settings.settled:
                break
            shifts = evidence.delays
        return evidence

    def _track(self, images: Sequence[LandmarkMatches], ahead_ns: int, from_ns: int, to_ns: int) -> CameraTrack:
        near = [
            image
            for image in images
            if image.world_T_camera is not None
            and from_ns - MARGIN_NS <= image.stamp_ns - ahead_ns <= to_ns + MARGIN_NS
        ]
        poses = [image.world_T_camera for image in near if image.world_T_camera is not None]
        path = CameraPath(
            np.array([image.stamp_ns - ahead_ns for image in near], np.int64), np.array(poses).reshape(-1, 4, 4)
        )
        covariances = np.array([image.pose_covariance for image in near]).reshape(-1, 6, 6)
        return CameraTrack(path, covariances + self._floor)


T = TypeVar("T")


def at_once(work: Generator[None, None, T]) -> T:
    """Do all of it; what it returns."""
    while True:
        try:
            next(work)
        except StopIteration as done:
            result: T = done.value
            return result
