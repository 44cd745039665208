"""Time synchronisation: estimates the clocks of all cameras, a window of images at a time, and corrects their stamps.

Offline, images are kept until the clocks some seconds ahead of them are known; live, they pass at once and are
corrected by what is known so far.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_evidence import CORRELATED, MARGIN_NS, window_evidence
from bodycam_ros.timing.clock_filter import DRIFT_SIGMA, ClockFilter
from bodycam_ros.timing.clock_state import TRIGGER_SIGMA_S, ClockHistory, ClockSettings, ClockState, correct_stamps
from bodycam_ros.timing.stamps import SharedStamps, StampIntervals, Stamps, find_shared_stamps, share_stamps

LOOKAHEAD_S = 8.0
"""How far ahead of the body clocks are estimated offline; four seconds of walking give them to 2 or 3 ms."""

_WINDOW_NS = 4_000_000_000  # of one estimate: 2 s left 2.7 ms where 4 s left 1.8; a jump ends a window in any case
_CATCH_UP = 3  # times the pace at which images come; a window passed on at once would keep those who register waiting
_FIRST_NS, _FIRST_AT_MOST_NS = 1_000_000_000, 5_000_000_000  # of most cameras, or of any, before stamps are compared
_OFF_S, _OFF_SIGMAS = 0.006, 5.0  # a clock that is off by more, and by five sigmas, is reset; three are not rare


@dataclass
class _Camera:
    """Of one camera: images not passed on yet, images of the window, clocks since the beginning, and stamps."""

    queue: deque[LandmarkMatches] = field(default_factory=deque)
    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    intervals: StampIntervals = field(default_factory=StampIntervals)
    first_ns: int = -1
    latest_ns: int = -1
    passed: tuple[int, int] = (-1, -1)

    def add(self, image: LandmarkMatches) -> None:
        self.intervals.add(image.stamp_ns)
        self.latest_ns = image.stamp_ns
        self.first_ns = image.stamp_ns if self.first_ns < 0 else self.first_ns
        self.queue.append(image)
        self.images.append(image)

    def restart(self) -> None:
        """A new epoch: only the clock is kept."""
        self.images.clear()
        self.intervals = StampIntervals()
        self.first_ns = self.latest_ns = -1
        self.clocks = [replace(clock, since_ns=0) for clock in self.clocks[-1:]]

    def stamps_ns(self, from_ns: int = 0, to_ns: int = 2**63 - 1) -> Stamps:
        """Stamps (N) of the latest images [ns]."""
        return np.array([image.stamp_ns for image in self.images if from_ns <= image.stamp_ns < to_ns], np.int64)


class ClockEstimator:
    """Estimates the clocks of a body's cameras, whose stamps increase.

    Args:
        body: calibrated.
        cameras: names, those of the body.
        settings: of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether to let every image pass at once.

    Attributes:
        shared: the cameras that share their stamps; None before enough images have come.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Iterable[str],
        settings: ClockSettings,
        floor: Array,
        live: bool,
    ) -> None:
        self._body, self._sigma, self._floor, self._live = body, settings.sigma, floor, live
        self._cameras = {camera: _Camera() for camera in cameras}
        self._filter = ClockFilter(settings.sigma)
        self._order: list[str] = []
        self._strayed: set[str] = set()
        self._first_ns = self._latest_ns = self._window_ns = self._passed_ns = self._filter_ns = -1
        self._is_provisional = False
        self.shared: SharedStamps | None = None

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
                histories[name] = ClockHistory(name, (first, *clocks[1:]))
        return histories

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
        camera.add(matches)
        if self._first_ns < 0:
            self._first_ns = self._latest_ns = self._window_ns = self._passed_ns = stamp_ns
        advance_ns, self._latest_ns = max(0, stamp_ns - self._latest_ns), max(self._latest_ns, stamp_ns)
        if self.shared is None or self._is_provisional:
            if not self._has_enough():
                return []
            self._initialise()
        while self._latest_ns > self._window_ns + _WINDOW_NS + MARGIN_NS:
            self._estimate_until(self._window_ns + _WINDOW_NS)
        if self._live:
            return self._release(None)
        self._passed_ns = min(self._passed_ns + _CATCH_UP * advance_ns, self._known_until_ns())
        return self._release(self._passed_ns)

    def flush(self) -> list[LandmarkMatches]:
        """All that is left: the recording or the epoch is over or, live, no image has come for a while."""
        if self._first_ns < 0:
            return []
        if self.shared is None or self._is_provisional:
            self._initialise()
            if self._live and not self._has_enough():
                # So few stamps do not decide who shares them. A single image has no period: it is kept.
                self._is_provisional = True
                return self._release(None) if self.sharing or (self.shared and self.shared.period_ns) else []
        while self._latest_ns - self._window_ns > _WINDOW_NS // 4:
            self._estimate_until(self._latest_ns + 1)
        return self._release(None)

    def restart(self) -> None:
        """Begin a new epoch, after ``flush``: clocks are kept."""
        for camera in self._cameras.values():
            camera.restart()
        self._first_ns = self._latest_ns = self._window_ns = self._passed_ns = -1

    def _known_until_ns(self) -> int:
        """Stamp up to which clocks are known well enough to pass images on."""
        # Shared stamps need no correction, unless the present window shows otherwise.
        all_share = self.sharing >= {name for name, camera in self._cameras.items() if camera.queue}
        return self._window_ns - (0 if all_share else round(1e9 * LOOKAHEAD_S))

    def _has_enough(self) -> bool:
        long = sum(0 <= camera.first_ns <= camera.latest_ns - _FIRST_NS for camera in self._cameras.values())
        return 2 * long > len(self._cameras) or self._latest_ns - self._first_ns >= _FIRST_AT_MOST_NS

    def _initialise(self) -> None:
        """Find the cameras that share their stamps, and start to estimate."""
        self._is_provisional = False
        stamps = {name: own for name, camera in self._cameras.items() if len(own := camera.stamps_ns())}
        shared = find_shared_stamps(stamps, self._body.cameras_on(self._body.root), alone=len(self._cameras) == 1)
        self.shared, self._filter, self._filter_ns = shared, ClockFilter(self._sigma), self._first_ns
        self._order, self._strayed = [], set()
        for name in sorted(stamps, key=lambda name: (name != shared.reference, name)):
            self._enter(name, name in shared.cameras)

    def _enter(self, name: str, triggered: bool) -> None:
        self._order.append(name)
        self._filter.add_camera(triggered)
        sigma = TRIGGER_SIGMA_S if triggered else self._sigma
        self._cameras[name].clocks = [ClockState(0, self._first_ns, 0.0, 0.0, sigma, DRIFT_SIGMA)]

    def _stray(self, name: str) -> None:
        """A camera's clock is not what it was estimated to be, and not that of the others."""
        self._filter.free(self._order.index(name))
        self._strayed.add(name)

    def _compare_stamps(self, from_ns: int, to_ns: int) -> None:
        """Which cameras left those that they shared stamps with; do cameras that started late share them?"""
        assert self.shared is not None
        stamps = {name: self._cameras[name].stamps_ns(from_ns, to_ns) for name in self.sharing}
        several = {name: own for name, own in stamps.items() if len(own) > 1}
        if len(several) > 1:
            together = find_shared_stamps(several).cameras or {self._order[self._filter.reference]}
            for name in sorted(set(several) - together):
                self._stray(name)
        for name, camera in self._cameras.items():
            if not camera.clocks and camera.images and camera.latest_ns - camera.first_ns >= _FIRST_NS:
                triggered = any(share_stamps(camera.stamps_ns(), others) for others in several.values())
                if triggered:
                    self.shared = replace(self.shared, cameras=self.shared.cameras | {name})
                self._enter(name, triggered)

    def _estimate_until(self, to_ns: int) -> None:
        """Estimate from the window after the last one; it ends early where a clock may have been set."""
        from_ns, breaks = self._window_ns, dict[str, int]()
        for name, camera in self._cameras.items():
            at_ns = camera.intervals.breaks_ns
            while at_ns and at_ns[0] <= from_ns:
                at_ns.popleft()
            if at_ns and at_ns[0] < to_ns:
                breaks[name] = at_ns[0]
        self._window_ns = min(breaks.values(), default=to_ns)
        if self._window_ns - from_ns >= _WINDOW_NS // 8:
            self._compare_stamps(from_ns, self._window_ns)
            self._update_clocks(from_ns, self._window_ns)
        for name, camera in self._cameras.items():
            if breaks.get(name) == self._window_ns and camera.clocks:
                self._stray(name)
                camera.clocks.append(replace(camera.clocks[-1], since_ns=self._window_ns, at_ns=self._window_ns))
                camera.images = deque(image for image in camera.images if image.stamp_ns >= self._window_ns)
            while camera.images and camera.images[0].stamp_ns < self._window_ns - 2 * MARGIN_NS:
                camera.images.popleft()

    def _update_clocks(self, from_ns: int, to_ns: int) -> None:
        """Estimate all clocks from a window [ns]; a clock that contradicts its estimate is reset, once."""
        self._filter.advance(1e-9 * (to_ns - self._filter_ns))
        self._filter_ns = to_ns
        images = {name: self._cameras[name].images for name in self._order}
        for is_repeated in (False, True):
            offsets = dict(zip(self._order, self._filter.offsets.tolist(), strict=True))
            prior = self._filter.prior_information * CORRELATED
            evidence = window_evidence(self._body, images, offsets, prior, self._floor, (from_ns, to_ns))
            if evidence is None:
                return
            information = evidence.information / CORRELATED
            alone, sigmas = self._filter.innovations(evidence.delays, information)
            off = np.flatnonzero((sigmas > _OFF_SIGMAS) & (np.abs(alone) > _OFF_S)).tolist()
            if is_repeated or not off:
                self._filter.update(evidence.delays, information)
                break
            if 2 * len(off) > len(self._order):
                off = [self._filter.reference]  # most at once: it is the one that they are compared with
            # The intervals are even, so these clocks did not jump: their estimates were wrong.
            for row in off:
                self._stray(self._order[row])
        for row, name in enumerate(self._order):
            clocks = self._cameras[name].clocks
            clocks[-1] = replace(self._clock(row), since_ns=clocks[-1].since_ns)

    def _clock(self, row: int) -> ClockState:
        """The estimate of a clock at the time of the filter."""
        offset, drift = float(self._filter.offsets[row]), float(self._filter.drifts[row])
        offset_sigma, drift_sigma = (float(sigmas[row]) for sigmas in self._filter.sigmas)
        return ClockState(0, self._filter_ns + round(1e9 * offset), offset, drift, offset_sigma, drift_sigma)

    def _release(self, until_ns: int | None) -> list[LandmarkMatches]:
        """Images before a stamp (None: all), in order of corrected stamps."""
        passed = []
        sharing = self.sharing
        for name, camera in self._cameras.items():
            # Triggered cameras stay together: the estimates of their clocks are noise.
            clocks = [] if name in sharing else camera.clocks
            while camera.queue and (until_ns is None or camera.queue[0].stamp_ns < until_ns):
                given = camera.queue.popleft()
                image = correct_stamps(given, clocks, camera.passed)
                camera.passed = given.stamp_ns, image.stamp_ns
                passed.append(image)
        return sorted(passed, key=lambda matches: (matches.stamp_ns, matches.camera))
