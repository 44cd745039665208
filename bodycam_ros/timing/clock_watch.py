"""Holds what all cameras say until their clocks are known, and corrects their stamps.

Offline it looks some seconds ahead of the body; live it lets everything pass at once and corrects by what it knows.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import CameraPath
from bodycam_ros.timing.clock_filter import ClockFilter
from bodycam_ros.timing.clock_settings import ClockSettings
from bodycam_ros.timing.clock_window import CameraTrack, ClockEvidence, clock_evidence
from bodycam_ros.timing.shared_beat import SharedBeat, shared_beat

_LISTEN_NS = 1_000_000_000
"""Before anything is said of the beat, cameras are listened to for so long."""

_MARGIN_NS = 300_000_000
"""Images beyond the ends of a window, for the paths at its ends and for clocks that are off."""

_SURPRISE = 5.0
_BREAK_NS = 4_000_000
"""An interval between images that is no multiple of the usual one by so much: a clock was set."""

_STEADY_SHARE = 0.9
"""Of a camera's intervals that must be multiples, or its rate varies and a gap says nothing."""


@dataclass(frozen=True)
class ClockState:
    """One camera's clock, from one stamp on.

    Attributes:
        since_ns: first stamp that it holds for, by the camera's own clock [ns].
        at_ns: stamp at which the offset holds [ns].
        offset: by how much the camera's stamps are ahead [s].
        drift: by which that grows per second.
        offset_sigma: [s].
        drift_sigma: [s/s].
    """

    since_ns: int
    at_ns: int
    offset: float
    drift: float
    offset_sigma: float
    drift_sigma: float

    def offset_ns(self, stamp_ns: int) -> int:
        """By how much the clock is ahead at a stamp [ns]."""
        return round(1e9 * (self.offset + self.drift * 1e-9 * (stamp_ns - self.at_ns)))


@dataclass(frozen=True)
class ClockJump:
    """A clock that jumped: which, when by its own stamps [ns], and by how much [s]."""

    camera: str
    stamp_ns: int
    by_s: float


@dataclass
class _Heard:
    held: deque[LandmarkMatches] = field(default_factory=deque)
    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    breaks: deque[int] = field(default_factory=deque)
    intervals: deque[int] = field(default_factory=lambda: deque(maxlen=150))
    latest_ns: int = -1


class ClockWatch:
    """Listens to all cameras of a body.

    Args:
        body: which has been calibrated.
        cameras: names, those of the body.
        settings: what is believed of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether to let everything pass at once.

    Attributes:
        beat: what the stamps say, once they were listened to.
        jumps: clocks that jumped so far.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Iterable[str],
        settings: ClockSettings,
        floor: NDArray[np.float64],
        live: bool,
    ) -> None:
        self._body = body
        self._settings = settings
        self._floor = floor
        self._lookahead_ns = 0 if live else round(1e9 * settings.lookahead)
        self._window_ns = round(1e9 * settings.window)
        self._heard = {camera: _Heard() for camera in cameras}
        self.jumps: list[ClockJump] = []
        self.beat: SharedBeat | None = None
        self._order: tuple[str, ...] = ()
        self._begin()

    def _begin(self) -> None:
        self._filter: ClockFilter | None = None
        self._first_ns = self._latest_ns = -1
        self._window_from_ns = self._filter_ns = -1

    def clocks(self) -> dict[str, ClockState]:
        """Camera -> its clock as it is believed to be now."""
        return {camera: heard.clocks[-1] for camera, heard in self._heard.items() if heard.clocks}

    def join(self, camera: str) -> None:
        """One more camera; it is listened to from the next window on."""
        self._heard.setdefault(camera, _Heard())

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """What one camera says; what may go on by now, stamps corrected, of each camera in order of time."""
        heard = self._heard.get(matches.camera)
        if heard is None:
            return []
        passed = []
        if matches.stamp_ns <= heard.latest_ns - _LISTEN_NS:
            # Time begins anew, as when a bag is played again: what is known of clocks stays.
            passed = self._release(None)
            for other in self._heard.values():
                other.images.clear()
                other.breaks.clear()
                other.latest_ns = -1
            self._first_ns = self._latest_ns = -1
            self._window_from_ns = -1
        self._note_interval(heard, matches)
        heard.latest_ns = matches.stamp_ns
        heard.held.append(matches)
        heard.images.append(matches)
        self._latest_ns = max(self._latest_ns, matches.stamp_ns)
        if self._first_ns < 0:
            self._first_ns = matches.stamp_ns
        if self.beat is None:
            if self._latest_ns - self._first_ns < _LISTEN_NS:
                return passed
            self._listen()
        if self._window_from_ns < 0:
            self._window_from_ns = self._first_ns
        while self._latest_ns > self._window_from_ns + self._window_ns + _MARGIN_NS:
            self._ask(self._window_from_ns, self._window_from_ns + self._window_ns)
        return passed + self._release(self._window_from_ns - self._lookahead_ns if self._lookahead_ns else None)

    def flush(self) -> list[LandmarkMatches]:
        """All that is held; the recording is over."""
        if self.beat is None and self._first_ns >= 0:
            self._listen()
        if self._window_from_ns < 0:
            self._window_from_ns = self._first_ns
        if self._latest_ns - self._window_from_ns > self._window_ns // 4:
            self._ask(self._window_from_ns, self._latest_ns + 1)
        return self._release(None)

    def _listen(self) -> None:
        """Find out who goes with whom, and begin to estimate."""
        stamps = {camera: np.array([m.stamp_ns for m in h.images], np.int64) for camera, h in self._heard.items()}
        self.beat = shared_beat(
            {camera: s for camera, s in stamps.items() if len(s)}, self._body.cameras_on(self._body.root)
        )
        reference = self.beat.reference
        self._order = (reference, *(camera for camera in self._heard if camera != reference))
        self._filter = ClockFilter([camera in self.beat.together for camera in self._order], self._settings)
        self._filter_ns = self._first_ns
        for heard in self._heard.values():
            heard.clocks = [ClockState(0, self._first_ns, 0.0, 0.0, self._settings.sigma, self._settings.drift_sigma)]

    def _note_interval(self, heard: _Heard, matches: LandmarkMatches) -> None:
        """Remember where a camera's clock may have been set: an interval that is no multiple of the usual one."""
        if heard.latest_ns < 0:
            return
        interval = matches.stamp_ns - heard.latest_ns
        if len(heard.intervals) > 20:
            intervals = np.array(heard.intervals)
            period = float(np.median(intervals))
            if (
                np.mean(_off_beat(intervals, period) < _BREAK_NS) > _STEADY_SHARE
                and _off_beat(interval, period) > _BREAK_NS
            ):
                heard.breaks.append(matches.stamp_ns)
                return
        heard.intervals.append(interval)

    def _ask(self, from_ns: int, to_ns: int) -> None:
        """Learn from a window; it is cut where a clock may have been set."""
        cut = min((stamp for h in self._heard.values() for stamp in h.breaks if from_ns < stamp < to_ns), default=None)
        if cut is not None:
            cut_from = {camera for camera, h in self._heard.items() if h.breaks and h.breaks[0] == cut}
            self._ask_within(from_ns, cut)
            for camera in cut_from:
                self._heard[camera].breaks.popleft()
                self._cut(camera, cut)
            self._window_from_ns = cut
            return
        self._ask_within(from_ns, to_ns)
        self._window_from_ns = to_ns
        for heard in self._heard.values():
            while heard.images and heard.images[0].stamp_ns < to_ns - 2 * _MARGIN_NS:
                heard.images.popleft()
            while heard.breaks and heard.breaks[0] < to_ns:
                heard.breaks.popleft()

    def _cut(self, camera: str, stamp_ns: int) -> None:
        """From a stamp on a camera's clock may be another."""
        assert self._filter is not None
        heard = self._heard[camera]
        if camera != self._order[0]:
            self._filter.free(self._order.index(camera))
        heard.clocks.append(replace(heard.clocks[-1], since_ns=stamp_ns, at_ns=stamp_ns))
        heard.images = deque(image for image in heard.images if image.stamp_ns >= stamp_ns)

    def _ask_within(self, from_ns: int, to_ns: int) -> None:
        if self._filter is None or to_ns - from_ns < self._window_ns // 8:
            return
        self._filter.advance(1e-9 * (to_ns - self._filter_ns))
        self._filter_ns = to_ns
        evidence = self._evidence(from_ns, to_ns)
        if evidence is None:
            return
        told = evidence.information / self._settings.instants_alike
        surprises = self._filter.surprises(evidence.delays, told)
        off = [
            int(row)
            for row in np.flatnonzero((surprises > _SURPRISE) & (np.abs(evidence.delays) > self._settings.jump))
            if row != 0
        ]
        if off:
            for row in off:
                self._filter.free(row)
            evidence = self._evidence(from_ns, to_ns) or evidence
            told = evidence.information / self._settings.instants_alike
        self._filter.learn(evidence.delays, told)
        for row, camera in enumerate(self._order):
            self._set(camera, row, to_ns, from_ns if row in off else None)

    def _set(self, camera: str, row: int, at_ns: int, jumped_ns: int | None) -> None:
        """Take over what the filter says of a clock; from a stamp on if it jumped there."""
        assert self._filter is not None
        clocks = self._heard[camera].clocks
        if not clocks:
            return
        offset, drift = float(self._filter.offsets[row]), float(self._filter.drifts[row])
        sigmas = float(self._filter.offset_sigmas[row]), float(self._filter.drift_sigmas[row])
        before = clocks[-1]
        at_own_ns = at_ns + round(1e9 * offset)
        since_ns = before.since_ns
        if jumped_ns is not None and before.offset_sigma < self._settings.sigma / 2:
            since_ns = jumped_ns
            clocks.append(before)
        clocks[-1] = ClockState(since_ns, at_own_ns, offset, drift, *sigmas)
        if len(clocks) > 1 and clocks[-2].since_ns != clocks[-1].since_ns:
            self._note_jump(camera, clocks[-2], clocks[-1])

    def _note_jump(self, camera: str, before: ClockState, after: ClockState) -> None:
        by_s = 1e-9 * (after.offset_ns(after.since_ns) - before.offset_ns(after.since_ns))
        self.jumps = [jump for jump in self.jumps if (jump.camera, jump.stamp_ns) != (camera, after.since_ns)]
        if abs(by_s) > self._settings.jump:
            self.jumps.append(ClockJump(camera, after.since_ns, by_s))

    def _evidence(self, from_ns: int, to_ns: int) -> ClockEvidence | None:
        """What the images of a window say, given the filter's present."""
        assert self._filter is not None
        tracks: dict[str, CameraTrack] = {}
        shifts = np.zeros(len(self._order))
        evidence = None
        for _ in range(2):
            for row, camera in enumerate(self._order):
                ahead_ns = round(1e9 * float(self._filter.offsets[row] + shifts[row]))
                tracks[camera] = self._track(camera, ahead_ns, from_ns, to_ns)
            step_ns = round(1e9 / self._settings.instants)
            stamps = np.arange(from_ns, to_ns, step_ns, dtype=np.int64)
            prior = self._filter.prior_information * self._settings.instants_alike
            found = clock_evidence(self._body, tracks, stamps, self._settings.max_gap, prior, -shifts)
            if found is None:
                return None
            evidence = replace(found, delays=found.delays + shifts)
            if np.abs(found.delays).max() < self._settings.settled:
                break
            shifts = evidence.delays
        return evidence

    def _track(self, camera: str, ahead_ns: int, from_ns: int, to_ns: int) -> CameraTrack:
        images = [
            image
            for image in self._heard[camera].images
            if image.world_T_camera is not None
            and from_ns - _MARGIN_NS <= image.stamp_ns - ahead_ns <= to_ns + _MARGIN_NS
        ]
        if not images:
            return CameraTrack(CameraPath(np.zeros(0, np.int64), np.zeros((0, 4, 4))), np.zeros((0, 6, 6)))
        path = CameraPath(
            np.array([image.stamp_ns - ahead_ns for image in images], np.int64),
            np.stack([image.world_T_camera for image in images if image.world_T_camera is not None]),
        )
        return CameraTrack(path, np.stack([image.pose_covariance for image in images]) + self._floor)

    def _release(self, until_ns: int | None) -> list[LandmarkMatches]:
        """What is held of the time before a stamp (of all time), in order of corrected stamps."""
        passed = []
        for heard in self._heard.values():
            while heard.held and (until_ns is None or heard.held[0].stamp_ns < until_ns):
                passed.append(self._corrected(heard, heard.held.popleft()))
        return sorted(passed, key=lambda matches: (matches.stamp_ns, matches.camera))

    def _corrected(self, heard: _Heard, matches: LandmarkMatches) -> LandmarkMatches:
        if not heard.clocks:
            return matches
        clock = next(clock for clock in reversed(heard.clocks) if clock.since_ns <= matches.stamp_ns)
        ahead_ns = clock.offset_ns(matches.stamp_ns)
        if ahead_ns == 0:
            return matches
        previous_ns = matches.previous_stamp_ns
        return replace(
            matches,
            stamp_ns=matches.stamp_ns - ahead_ns,
            previous_stamp_ns=previous_ns - ahead_ns if previous_ns else 0,
        )


def _off_beat(intervals: NDArray[np.int64] | int, period: float) -> NDArray[np.float64]:
    """How far intervals are from multiples of a period, at least one [ns]."""
    values = np.asarray(intervals, np.float64)
    return np.asarray(np.abs(values - np.maximum(1.0, np.rint(values / period)) * period))


def believed_offsets(clocks: Mapping[str, ClockState]) -> dict[str, float]:
    """Camera -> by how much its clock is ahead [s]."""
    return {camera: clock.offset for camera, clock in clocks.items()}
