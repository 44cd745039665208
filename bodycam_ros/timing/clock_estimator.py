"""Time synchronisation: estimates the clocks of all cameras, a window of images at a time, and corrects their stamps.

Offline, images are kept until the clocks some seconds ahead of them are known; live, they pass at once and are
corrected by what is known so far.
"""

import math
from collections import deque
from collections.abc import Collection, Generator, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_evidence import CORRELATED, MARGIN_NS, ClockEvidence, window_evidence
from bodycam_ros.timing.clock_filter import DRIFT_SIGMA, ClockFilter
from bodycam_ros.timing.clock_state import (
    TRIGGER_SIGMA_S,
    ClockHistory,
    ClockJump,
    ClockSettings,
    ClockState,
    correct_stamps,
)
from bodycam_ros.timing.inertial_clocks import InertialClock, camera_clocks
from bodycam_ros.timing.stamps import CommonTime, SharedStamps, StampIntervals, Stamps, find_shared_stamps, share_stamps

LOOKAHEAD_S = 8.0
"""How far ahead of the body clocks are estimated offline; four seconds of walking give them to 2 or 3 ms."""

_WINDOW_NS = 4_000_000_000  # of one estimate: 2 s left 2.7 ms where 4 s left 1.8; a jump ends a window in any case
_FIRST_NS, _FIRST_AT_MOST_NS = 1_000_000_000, 5_000_000_000  # of most cameras, or of any, before stamps are compared
_JUMP_S, _SURPRISE = 0.006, 5.0  # a clock that is off by more, and by five sigmas, is reset; three are not rare
_LATENCY_S = 0.001  # by which a sensor's delay to its camera may differ from that of the calibration


@dataclass
class _Camera:
    """Images not passed on yet, images to learn from, clocks since the beginning, and stamps of one camera."""

    queue: deque[LandmarkMatches] = field(default_factory=deque)
    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    intervals: StampIntervals = field(default_factory=StampIntervals)
    first_ns: int = -1
    latest_ns: int = -1
    passed: tuple[int, int] = (-1, -1)
    readout: tuple[float, float] = (math.nan, math.nan)

    def add(self, image: LandmarkMatches) -> None:
        self.intervals.add(image.stamp_ns)
        self.latest_ns = image.stamp_ns
        self.first_ns = image.stamp_ns if self.first_ns < 0 else self.first_ns
        if not math.isnan(image.readout_sigma):
            self.readout = image.readout_time, image.readout_sigma
        self.queue.append(image)
        self.images.append(image)

    def restart(self) -> None:
        """Its time goes back: only its clock is kept."""
        self.images.clear()
        self.intervals = StampIntervals()
        self.first_ns = self.latest_ns = -1
        self.clocks = [replace(clock, since_ns=0) for clock in self.clocks[-1:]]

    def stamps_ns(self, from_ns: int = 0) -> Stamps:
        """Stamps (N) of the latest images [ns]."""
        return np.array([image.stamp_ns for image in self.images if image.stamp_ns >= from_ns], np.int64)


class ClockEstimator:
    """Estimates the clocks of a body's cameras.

    Args:
        body: calibrated.
        cameras: names, those of the body.
        settings: of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether to let every image pass at once.
        imus: camera -> samples of its inertial sensor; clocks of cameras with calibrated sensors start from theirs.

    Attributes:
        shared: the cameras that share their stamps; None before enough images have come.
        jumps: clocks that jumped so far.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Iterable[str],
        settings: ClockSettings,
        floor: Array,
        live: bool,
        imus: Mapping[str, ImuSamples] | None = None,
    ) -> None:
        self._imus, self._initial = imus or {}, dict[str, InertialClock]()
        self._body, self._sigma, self._floor, self._live = body, settings.sigma, floor, live
        self._cameras = {camera: _Camera() for camera in cameras}
        self._time = CommonTime()
        self._filter = ClockFilter(settings.sigma)
        self._order: list[str] = []
        self._strayed: set[str] = set()
        self._first_ns = self._window_ns = self._filter_ns = -1
        self._learning: Generator[None, None, None] | None = None
        self._continued_ns = -1
        self._is_provisional = False
        self.shared: SharedStamps | None = None
        self.jumps: list[ClockJump] = []

    @property
    def clocks(self) -> dict[str, ClockState]:
        """Camera -> its present clock."""
        return {name: camera.clocks[-1] for name, camera in self._cameras.items() if camera.clocks}

    @property
    def corrections(self) -> dict[str, ClockState]:
        """Camera -> its present clock, of those whose stamps are corrected."""
        return {name: clock for name, clock in self.clocks.items() if name not in self.sharing}

    @property
    def histories(self) -> dict[str, ClockHistory]:
        """Camera -> its clock as its stamps were corrected; those of cameras that share their stamps were not."""
        histories = {}
        for name, camera in self._cameras.items():
            if clocks := camera.clocks:
                if name in self.sharing:
                    sigma = max(clocks[-1].offset_sigma, abs(clocks[-1].offset))
                    clocks = [replace(clocks[-1], since_ns=0, offset=0.0, drift=0.0, offset_sigma=sigma)]
                first = replace(clocks[0], since_ns=max(clocks[0].since_ns, camera.first_ns))
                histories[name] = ClockHistory(name, (first, *clocks[1:]), *camera.readout)
        return histories

    @property
    def strangers(self) -> Set[str]:
        """Cameras of another time than most: their clocks cannot be estimated."""
        return self._time.strangers

    @property
    def moves(self) -> int:
        """How often the time of most cameras went elsewhere."""
        return self._time.moves

    @property
    def is_initialising(self) -> bool:
        """Whether images have come, but not enough to compare stamps."""
        return self.shared is None and self._first_ns >= 0

    @property
    def sharing(self) -> frozenset[str]:
        """Cameras that share their stamps with most others, and always did."""
        return self.shared.cameras - self._strayed if self.shared else frozenset()

    def join(self, camera: str) -> None:
        """Use one more camera."""
        self._cameras.setdefault(camera, _Camera())

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """Add an image; images that are ready, their stamps corrected, of each camera in order of time."""
        camera, stamp_ns = self._cameras.get(matches.camera), matches.stamp_ns
        if camera is None:
            return []
        passed = []
        if stamp_ns <= camera.latest_ns - _FIRST_NS:
            passed = self._release(None, [matches.camera])
            camera.restart()
        if self._time.add(matches.camera, stamp_ns, len(self._cameras)):
            passed += self._restart()
        if matches.camera in self.strangers:
            return [*passed, matches]
        camera.add(matches)
        if self._first_ns < 0:
            self._first_ns = self._window_ns = stamp_ns
        if self.shared is None or self._is_provisional:
            if not self._has_enough(stamp_ns):
                return passed
            self._initialise()
        elif not camera.clocks and stamp_ns - camera.images[0].stamp_ns >= _FIRST_NS:
            self._admit(matches.camera)
        while (self._time.latest_ns or 0) > self._window_ns + _WINDOW_NS + MARGIN_NS:
            self._estimate_until(self._window_ns + _WINDOW_NS)
        period_ns = self.shared.period_ns if self.shared else 0
        if self._learning is not None and stamp_ns - self._continued_ns >= period_ns:
            # Live, the body does not wait for a window: one step of it per state.
            self._continued_ns = stamp_ns
            if next(self._learning, True):
                self._learning = None
        return passed + self._release(self._known_until_ns())

    def flush(self) -> list[LandmarkMatches]:
        """All that is left: the recording is over or, live, no image has come for a while."""
        if (self.shared is None or self._is_provisional) and self._first_ns >= 0:
            is_early = self._live and not self._has_enough(self._time.latest_ns or 0)
            self._initialise()
            if is_early:
                # So few stamps do not decide who shares them. A single image has no period: it is kept.
                self._is_provisional = True
                return self._release(None) if self.sharing or (self.shared and self.shared.period_ns) else []
        self._finish()
        latest_ns = self._time.latest_ns
        while latest_ns is not None and latest_ns - self._window_ns > _WINDOW_NS // 4:
            self._estimate_until(latest_ns + 1)
            self._finish()
        return self._release(None)

    def _known_until_ns(self) -> int | None:
        """Stamp up to which clocks are known well enough to pass images on; None: pass all."""
        if self._live:
            return None
        # Shared stamps need no correction, unless the present window shows otherwise.
        all_share = self.sharing >= {name for name, camera in self._cameras.items() if camera.queue}
        return self._window_ns - (0 if all_share else round(1e9 * LOOKAHEAD_S))

    def _has_enough(self, stamp_ns: int) -> bool:
        long = sum(0 <= camera.first_ns <= camera.latest_ns - _FIRST_NS for camera in self._cameras.values())
        return 2 * long > len(self._cameras) or stamp_ns - self._first_ns >= _FIRST_AT_MOST_NS

    def _restart(self) -> list[LandmarkMatches]:
        """The time of most cameras is elsewhere: clocks are kept, images are passed on."""
        self._finish()
        passed = self._release(None)
        for camera in self._cameras.values():
            camera.restart()
        self._first_ns = self._window_ns = -1
        return passed

    def _initialise(self) -> None:
        """Find the cameras that share their stamps, and start to estimate."""
        self._is_provisional = False
        stamps = {name: own for name, camera in self._cameras.items() if len(own := camera.stamps_ns())}
        shared = find_shared_stamps(stamps, self._body.cameras_on(self._body.root), alone=len(self._cameras) == 1)
        self.shared, self._filter, self._filter_ns = shared, ClockFilter(self._sigma), self._first_ns
        self._order, self._strayed = [], set()
        if set(self._cameras) - shared.cameras and self._imus:
            clocks = camera_clocks(self._body, self._imus)
            if (reference := clocks.get(shared.reference)) is not None:
                self._initial = {
                    name: InertialClock(clock.offset - reference.offset, float(np.hypot(clock.sigma, reference.sigma)))
                    for name, clock in clocks.items()
                    if name != shared.reference
                }
        for name in sorted(stamps, key=lambda name: (name != shared.reference, name)):
            self._enter(name, name in shared.cameras)

    def _admit(self, name: str) -> None:
        """A camera that started late: does it share its stamps with the others?"""
        assert self.shared is not None
        own = self._cameras[name].stamps_ns()
        others = [self._cameras[other].stamps_ns(int(own[0])) for other in self.sharing]
        triggered = any(len(stamps) > 1 and share_stamps(own, stamps) for stamps in others)
        if triggered:
            self.shared = replace(self.shared, cameras=self.shared.cameras | {name})
        self._enter(name, triggered)

    def _enter(self, name: str, triggered: bool) -> None:
        self._finish()
        self._order.append(name)
        known = None if triggered else self._initial.get(name)
        offset, sigma = (known.offset, known.sigma + _LATENCY_S) if known else (0.0, self._sigma)
        self._filter.add_camera(triggered, offset, sigma)
        sigma = TRIGGER_SIGMA_S if triggered else sigma
        self._cameras[name].clocks = [ClockState(0, self._first_ns, offset, 0.0, sigma, DRIFT_SIGMA)]

    def _stray(self, name: str) -> None:
        """A camera's clock is not what it was estimated to be, and not that of the others."""
        self._filter.free(self._order.index(name))
        self._strayed.add(name)

    def _estimate_until(self, to_ns: int) -> None:
        """Estimate from the window after the last one; it ends early where a clock may have been set."""
        self._finish()
        from_ns = self._window_ns
        breaks = {name: camera.intervals.first_break(from_ns, to_ns) for name, camera in self._cameras.items()}
        cut_ns = min((stamp for stamp in breaks.values() if stamp is not None), default=None)
        until_ns = to_ns if cut_ns is None else cut_ns
        if until_ns - from_ns >= _WINDOW_NS // 8:
            self._find_strays(from_ns, until_ns)
            images = {name: list(self._cameras[name].images) for name in self._order}
            self._learning = self._learn(images, from_ns, until_ns)
            if not self._live or cut_ns is not None:
                self._finish()
        self._window_ns = until_ns
        for name, camera in self._cameras.items():
            if cut_ns is not None and breaks[name] == cut_ns and camera.clocks:
                self._stray(name)
                camera.clocks.append(replace(camera.clocks[-1], since_ns=cut_ns, at_ns=cut_ns))
                camera.images = deque(image for image in camera.images if image.stamp_ns >= cut_ns)
            while camera.images and camera.images[0].stamp_ns < until_ns - 2 * MARGIN_NS:
                camera.images.popleft()

    def _finish(self) -> None:
        """Complete the window that is under way."""
        for _ in self._learning or ():
            pass
        self._learning = None

    def _find_strays(self, from_ns: int, to_ns: int) -> None:
        """Cameras whose stamps drift away from those that they shared."""
        stamps = {name: self._cameras[name].stamps_ns(from_ns) for name in self.sharing}
        several = {name: own[own < to_ns] for name, own in stamps.items() if np.sum(own < to_ns) > 1}
        if len(several) > 1:
            together = find_shared_stamps(several).cameras or {self._order[self._filter.reference]}
            for name in sorted(set(several) - together):
                self._stray(name)

    def _learn(
        self, images: Mapping[str, Sequence[LandmarkMatches]], from_ns: int, to_ns: int
    ) -> Generator[None, None, None]:
        """Estimate all clocks from a window, some milliseconds at a time; no camera enters or strays meanwhile.

        Args:
            images: camera -> its images, in order of time, some beyond both ends.
            from_ns, to_ns: the window [ns].
        """
        self._filter.advance(1e-9 * (to_ns - self._filter_ns))
        self._filter_ns = to_ns
        evidence = yield from self._evidence(images, from_ns, to_ns)
        if evidence is None:
            return
        alone, surprises = self._filter.innovations(evidence.delays, evidence.information / CORRELATED)
        off = np.flatnonzero((surprises > _SURPRISE) & (np.abs(alone) > _JUMP_S)).tolist()
        if 2 * len(off) > len(self._order):
            off = [self._filter.reference]  # most at once: it is the one that they are compared with
        if off:
            # The intervals are even, so these clocks did not jump: their estimates were wrong.
            for row in off:
                self._stray(self._order[row])
            evidence = (yield from self._evidence(images, from_ns, to_ns)) or evidence
        self._filter.update(evidence.delays, evidence.information / CORRELATED)
        for row, name in enumerate(self._order):
            self._set_clock(name, self._clock(row))

    def _evidence(
        self, images: Mapping[str, Sequence[LandmarkMatches]], from_ns: int, to_ns: int
    ) -> Generator[None, None, ClockEvidence | None]:
        offsets = dict(zip(self._order, self._filter.offsets.tolist(), strict=True))
        prior = self._filter.prior_information * CORRELATED
        return window_evidence(self._body, images, offsets, prior, self._floor, (from_ns, to_ns))

    def _clock(self, row: int) -> ClockState:
        """The estimate of a clock at the time of the filter."""
        offset, drift = float(self._filter.offsets[row]), float(self._filter.drifts[row])
        offset_sigma, drift_sigma = (float(sigmas[row]) for sigmas in self._filter.sigmas)
        return ClockState(0, self._filter_ns + round(1e9 * offset), offset, drift, offset_sigma, drift_sigma)

    def _set_clock(self, name: str, clock: ClockState) -> None:
        """Use an estimate for all the time since the clock was set, and note by how much it jumped then."""
        clocks = self._cameras[name].clocks
        since_ns = clocks[-1].since_ns
        clocks[-1] = replace(clock, since_ns=since_ns)
        if len(clocks) > 1:
            by_s = 1e-9 * (clocks[-1].offset_ns(since_ns) - clocks[-2].offset_ns(since_ns))
            self.jumps = [jump for jump in self.jumps if (jump.camera, jump.stamp_ns) != (name, since_ns)]
            if abs(by_s) > max(_JUMP_S, 3.0 * clock.offset_sigma):
                self.jumps.append(ClockJump(name, since_ns, by_s))

    def _release(self, until_ns: int | None, names: Collection[str] | None = None) -> list[LandmarkMatches]:
        """Images before a stamp (None: all) of some or all cameras, in order of corrected stamps."""
        passed = []
        sharing = self.sharing
        for name in self._cameras if names is None else names:
            camera = self._cameras[name]
            # Triggered cameras stay together: the estimates of their clocks are noise.
            clocks = [] if name in sharing else camera.clocks
            while camera.queue and (until_ns is None or camera.queue[0].stamp_ns < until_ns):
                given = camera.queue.popleft()
                image = correct_stamps(given, clocks, camera.passed)
                camera.passed = given.stamp_ns, image.stamp_ns
                passed.append(image)
        return sorted(passed, key=lambda matches: (matches.stamp_ns, matches.camera))
