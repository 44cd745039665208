"""Time synchronisation: estimates the clocks of all cameras, a window of images at a time, and corrects their stamps.

Offline, images are kept until the clocks some seconds ahead of them are known; live, they pass at once and are
corrected by what is known so far.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_evidence import MARGIN_NS, clock_evidence
from bodycam_ros.timing.clock_filter import DRIFT_SIGMA, ClockFilter
from bodycam_ros.timing.clock_state import TRIGGER_SIGMA_S, ClockHistory, ClockSettings, ClockState, clock_at
from bodycam_ros.timing.stamps import SharedStamps, Stamps, find_break, find_shared_stamps, share_stamps

LOOKAHEAD_S = 8.0
"""How far ahead of the body clocks are estimated offline; four seconds of walking give them to 2 or 3 ms."""

ALL_NS = 2**63 - 1
"""Later than any stamp [ns]."""

_WINDOW_NS = 4_000_000_000  # of one estimate: 2 s left 2.7 ms where 4 s left 1.8; a jump ends a window in any case
_FIRST_NS, _FIRST_AT_MOST_NS = 1_000_000_000, 5_000_000_000  # of most cameras, or of any, before stamps are compared


@dataclass
class _Camera:
    """One camera: images of the window, clocks since the beginning, latest stamp as given and corrected."""

    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    passed: tuple[int, int] = (-1, -1)

    def forget(self, before_ns: int) -> None:
        """Drop images of the window before a stamp [ns]."""
        while self.images and self.images[0].stamp_ns < before_ns:
            self.images.popleft()

    def stamps_ns(self, from_ns: int = 0, to_ns: int = ALL_NS) -> Stamps:
        """Stamps (N) of the latest images [ns]."""
        return np.array([image.stamp_ns for image in self.images if from_ns <= image.stamp_ns < to_ns], np.int64)

    @property
    def is_long(self) -> bool:
        """Whether its images are of a time in which stamps can be compared."""
        return bool(self.images) and self.images[-1].stamp_ns - self.images[0].stamp_ns >= _FIRST_NS


@dataclass(frozen=True)
class KnownClocks:
    """Clocks of a recording that are not estimated any more.

    Attributes:
        shared: the cameras that share their stamps.
        clocks: camera -> its clock, from one stamp on each.
    """

    shared: SharedStamps
    clocks: Mapping[str, tuple[ClockState, ...]]


class ClockEstimator:
    """Estimates the clocks of a body's cameras, whose stamps increase.

    Args:
        body: calibrated.
        cameras: names, those of the body.
        settings: of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether to let every image pass at once.
        known: clocks that a first pass over the recording found, which stay as they are; None to estimate them.

    Attributes:
        shared: the cameras that share their stamps, and always did; None before enough images have come.
        latest_ns: the latest stamp [ns]; -1 before the first.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Iterable[str],
        settings: ClockSettings,
        floor: Array,
        live: bool,
        known: "KnownClocks | None" = None,
    ) -> None:
        self._body = body
        self._floor = floor
        self._live = live
        self._cameras = {camera: _Camera() for camera in cameras}
        self._sigma, self._filter = settings.sigma, ClockFilter(settings.sigma)
        self._first_ns = self.latest_ns = self._window_ns = self._filter_ns = -1
        self._is_over = False
        self._names = set[str]()  # of the cameras with images in this epoch
        self._is_known = known is not None
        self.shared: SharedStamps | None = None if known is None else known.shared
        for camera, clocks in known.clocks.items() if known else ():
            if camera in self._cameras:
                self._cameras[camera].clocks = [*clocks]

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
                    since_ns = clocks[0].since_ns
                    clocks = [replace(clocks[-1], since_ns=since_ns, offset=0.0, drift=0.0, offset_sigma=sigma)]
                histories[name] = ClockHistory(name, tuple(clocks))
        return histories

    @property
    def sharing(self) -> frozenset[str]:
        """Cameras that share their stamps with most others, and always did."""
        return self.shared.cameras if self.shared else frozenset()

    @property
    def free(self) -> frozenset[str]:
        """The other cameras, which take their images at times of their own; all before stamps are compared."""
        return frozenset(self._cameras) - self.sharing

    @property
    def known_ns(self) -> int:
        """Images before this stamp can be corrected as well as they ever will [ns]."""
        if (
            not self._cameras
            or self._is_known
            or self._is_over
            or (self._live and not (self.shared is None and self._first_ns >= 0))
        ):
            return ALL_NS
        if self.shared is None:
            return -1
        # Shared stamps need no correction, unless the present window shows otherwise.
        return self._window_ns - (0 if self.sharing >= self._names else round(1e9 * LOOKAHEAD_S))

    def add(self, matches: LandmarkMatches) -> None:
        """Add an image, later than those of its camera before."""
        camera, stamp_ns = self._cameras.get(matches.camera), matches.stamp_ns
        if self._is_known:
            self.latest_ns = max(self.latest_ns, stamp_ns)
            return
        if camera is None:
            return
        camera.images.append(matches)
        self._names.add(matches.camera)
        if self._first_ns < 0:
            self._first_ns = self._window_ns = stamp_ns
        self.latest_ns = max(self.latest_ns, stamp_ns)
        if self.shared is None:
            is_enough = 2 * sum(each.is_long for each in self._cameras.values()) > len(self._cameras)
            if not is_enough and self.latest_ns - self._first_ns < _FIRST_AT_MOST_NS:
                return
            self._initialise()
        while self.latest_ns > self._window_ns + _WINDOW_NS + MARGIN_NS:
            self._estimate_until(self._window_ns + _WINDOW_NS)

    def flush(self) -> None:
        """The recording or the epoch is over or, live, no image has come for a while: nothing will be known better."""
        if self._is_known:
            return
        if self.shared is None and self._first_ns >= 0:
            self._initialise()
            if self._live and not (self.shared and self.shared.period_ns):
                self.shared = None  # single images have no period: they are kept
        while self.shared and self.latest_ns - self._window_ns > _WINDOW_NS // 4:
            self._estimate_until(self.latest_ns + 1)
        self._is_over = not self._live

    def restart(self) -> None:
        """Begin a new epoch, after ``flush``: clocks are kept."""
        if self._is_known:
            self.latest_ns = -1
            return
        self._cameras = {name: _Camera(clocks=camera.clocks[-1:]) for name, camera in self._cameras.items()}
        self._first_ns = self.latest_ns = self._window_ns = -1
        self._is_over = False
        self._names.clear()

    def _initialise(self) -> None:
        """Find the cameras that share their stamps, and start to estimate."""
        stamps = {name: own for name, camera in self._cameras.items() if len(own := camera.stamps_ns())}
        shared = find_shared_stamps(stamps, self._body.cameras_on(self._body.root), alone=len(stamps) == 1)
        self.shared, self._filter, self._filter_ns = shared, ClockFilter(self._sigma), self._first_ns
        for name in sorted(stamps, key=lambda name: (name != shared.reference, name)):
            self._enter(name, name in shared.cameras)

    def _enter(self, name: str, triggered: bool) -> None:
        self._filter.add_camera(name, triggered)
        camera, sigma = self._cameras[name], TRIGGER_SIGMA_S if triggered else self._sigma
        camera.clocks = [ClockState(camera.images[0].stamp_ns, self._first_ns, 0.0, 0.0, sigma, DRIFT_SIGMA)]

    def _stray(self, names: Iterable[str]) -> None:
        """Cameras do not share their stamps with the others any more."""
        assert self.shared is not None
        self.shared = replace(self.shared, cameras=self.shared.cameras - {*names})

    def _free(self, names: Iterable[str]) -> None:
        """The clocks of cameras are unknown."""
        self._stray(names := list(names))
        for name in names:
            self._filter.free(self._filter.cameras.index(name))

    def _compare_stamps(self, from_ns: int, to_ns: int) -> None:
        """Which cameras left those that they shared stamps with; do cameras that started late share them?"""
        assert self.shared is not None
        stamps = {name: self._cameras[name].stamps_ns(from_ns, to_ns) for name in self.sharing}
        several = {name: own for name, own in stamps.items() if len(own) > 1}
        if len(several) > 1:
            together = find_shared_stamps(several).cameras or {self._filter.cameras[self._filter.reference]}
            self._free(sorted(set(several) - together))
        for name, camera in self._cameras.items():
            if not camera.clocks and camera.is_long:
                triggered = any(share_stamps(camera.stamps_ns(), others) for others in several.values())
                if triggered:
                    self.shared = replace(self.shared, cameras=self.shared.cameras | {name})
                self._enter(name, triggered)

    def _estimate_until(self, to_ns: int) -> None:
        """Estimate from the window after the last one; it ends early where a clock may have been set."""
        from_ns = self._window_ns
        breaks = {name: find_break(camera.stamps_ns(to_ns=to_ns)) for name, camera in self._cameras.items()}
        self._window_ns = min((at_ns for at_ns in breaks.values() if at_ns and at_ns > from_ns), default=to_ns)
        if self._window_ns - from_ns >= _WINDOW_NS // 8:
            self._compare_stamps(from_ns, self._window_ns)
            self._update_clocks(from_ns, self._window_ns)
        for name, camera in self._cameras.items():
            if breaks[name] == self._window_ns and camera.clocks:
                self._free([name])
                camera.clocks.append(replace(camera.clocks[-1], since_ns=self._window_ns, at_ns=self._window_ns))
                camera.forget(self._window_ns)
            camera.forget(self._window_ns - 2 * MARGIN_NS)

    def _update_clocks(self, from_ns: int, to_ns: int) -> None:
        """Estimate all clocks from a window [ns]."""
        clocks, images = self._filter, {name: camera.images for name, camera in self._cameras.items()}
        clocks.advance(1e-9 * (to_ns - self._filter_ns))
        self._filter_ns = to_ns
        linearise = partial(clock_evidence, self._body, images, floor=self._floor, window_ns=(from_ns, to_ns))
        # Their intervals are even, so clocks that were reset did not jump: their estimates were wrong.
        self._stray(clocks.update(linearise))
        estimates = np.column_stack([clocks.offsets, clocks.drifts, *clocks.sigmas]).tolist()
        for name, estimate in zip(clocks.cameras, estimates, strict=True):
            own = self._cameras[name].clocks
            own[-1] = ClockState(own[-1].since_ns, to_ns + round(1e9 * estimate[0]), *estimate)

    def corrected(self, matches: LandmarkMatches) -> LandmarkMatches:
        """The next image of a camera, with stamps of the body's time by the clock that was valid then."""
        camera, image = self._cameras.get(matches.camera), matches
        if camera is None:
            return matches
        # Triggered cameras stay together: the estimates of their clocks are noise.
        if camera.clocks and matches.camera not in self.sharing:
            clock, previous_ns = clock_at(camera.clocks, matches.stamp_ns), matches.previous_stamp_ns
            given_ns, passed_ns = camera.passed
            if previous_ns == given_ns:
                previous_ns = passed_ns  # the very stamp that was passed on, whatever is known of the clock by now
            elif previous_ns:
                previous_ns -= clock.offset_ns(previous_ns)
            stamp_ns = matches.stamp_ns - clock.offset_ns(matches.stamp_ns)
            image = replace(matches, stamp_ns=stamp_ns, previous_stamp_ns=previous_ns)
        camera.passed = matches.stamp_ns, image.stamp_ns
        return image
