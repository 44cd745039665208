"""Holds what all cameras say until their clocks are known, and corrects their stamps.

Offline it looks some seconds ahead of the body; live it lets everything pass at once and corrects by what it knows.
"""

import math
from collections import deque
from collections.abc import Collection, Generator, Iterable, Set
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_learner import MARGIN_NS, ClockLearner, Images, at_once
from bodycam_ros.timing.clock_state import ClockHistory, ClockJump, ClockSettings, ClockState, corrected
from bodycam_ros.timing.clock_window import CommonTime, SharedBeat, go_together, shared_beat

_BREAK_NS, _BREAK_SHARE = 4_000_000, 0.2
"""So far from a multiple, or by such a share of it where images come faster; ordinary stamps wander by less."""

_STEADY_SHARE = 0.9
"""Of the intervals that must be multiples, or the camera's rate varies and a gap says nothing."""

_LEAST, _MOST = 20, 150


class Intervals:
    """The latest intervals between a camera's images, and where they broke."""

    def __init__(self) -> None:
        self._latest_ns = -1
        self._intervals: deque[int] = deque(maxlen=_MOST)
        self._breaks: deque[int] = deque(maxlen=_MOST)

    def add(self, stamp_ns: int) -> None:
        """The next image."""
        interval = stamp_ns - self._latest_ns
        first, self._latest_ns = self._latest_ns < 0, stamp_ns
        if first:
            return
        if (
            self._intervals
            and abs(interval - self._intervals[-1]) > min(_BREAK_NS, _BREAK_SHARE * self._intervals[-1])
            and self._is_break(interval)
        ):
            self._breaks.append(stamp_ns)
        else:
            self._intervals.append(interval)

    def _is_break(self, interval: int) -> bool:
        if len(self._intervals) < _LEAST:
            return False
        usual = np.array(self._intervals, np.float64)
        period = float(np.median(usual))
        least_ns = min(_BREAK_NS, _BREAK_SHARE * period)
        off = np.abs(usual - np.maximum(1.0, np.rint(usual / period)) * period)
        off_now = abs(interval - max(1.0, round(interval / period)) * period)
        return bool(off_now > least_ns and np.mean(off < least_ns) > _STEADY_SHARE)

    def first_break(self, after_ns: int, before_ns: int) -> int | None:
        """The first stamp between two that comes at an odd interval [ns]; those before are forgotten."""
        while self._breaks and self._breaks[0] <= after_ns:
            self._breaks.popleft()
        return self._breaks[0] if self._breaks and self._breaks[0] < before_ns else None


@dataclass
class HeardCamera:
    """One camera: what is held, what may still be learned from, its clocks since the beginning, its intervals."""

    held: deque[LandmarkMatches] = field(default_factory=deque)
    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    intervals: Intervals = field(default_factory=Intervals)
    first_ns: int = -1
    latest_ns: int = -1
    passed: tuple[int, int] = (-1, -1)
    readout_time: float = math.nan
    readout_sigma: float = math.nan

    def begin_anew(self) -> None:
        """Its time goes back: only what is known of its clock stays."""
        self.images.clear()
        self.intervals = Intervals()
        self.first_ns = self.latest_ns = -1
        self.clocks = [replace(clock, since_ns=0) for clock in self.clocks[-1:]]

    def stamps_ns(self, from_ns: int = 0) -> NDArray[np.int64]:
        """Stamps (N) of the latest images [ns]."""
        return np.array([image.stamp_ns for image in self.images if image.stamp_ns >= from_ns], np.int64)


_LISTEN_NS = 1_000_000_000
"""Before anything is said of the beat, most cameras are listened to for so long."""

_LISTEN_AT_MOST_NS = 5_000_000_000
"""Cameras that are silent are not waited for any longer."""


class ClockWatch:
    """Listens to all cameras of a body.

    Args:
        body: which has been calibrated.
        cameras: names, those of the body.
        settings: what is believed of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether to let everything pass at once.

    Attributes:
        beat: what the stamps said, once they were listened to.
        jumps: clocks that jumped so far.
    """

    def __init__(
        self, body: BodyModel, cameras: Iterable[str], settings: ClockSettings, floor: NDArray[np.float64], live: bool
    ) -> None:
        self._body, self._settings, self._floor = body, settings, floor
        self._lookahead_ns = 0 if live else round(1e9 * settings.lookahead)
        self._window_ns = round(1e9 * settings.window)
        self._heard = {camera: HeardCamera() for camera in cameras}
        self._learner: ClockLearner | None = None
        self._first_ns = self._window_from_ns = -1
        self._learning: Generator[None, None, None] | None = None
        self._went_on_ns = -1
        self._is_guess = False
        self._time = CommonTime()
        self._astray: deque[LandmarkMatches] = deque()
        self.jumps: list[ClockJump] = []
        self.beat: SharedBeat | None = None

    @property
    def clocks(self) -> dict[str, ClockState]:
        """Camera -> its clock as it is believed to be now."""
        return {camera: heard.clocks[-1] for camera, heard in self._heard.items() if heard.clocks}

    @property
    def timings(self) -> dict[str, ClockHistory]:
        """Camera -> how its clock went, as its stamps were corrected: those who share their stamps were left alone."""
        timings = {}
        sharing = self.sharing
        for camera, heard in self._heard.items():
            if (clocks := heard.clocks) and camera in sharing:
                sigma = max(clocks[-1].offset_sigma, abs(clocks[-1].offset))
                clocks = [replace(clocks[-1], since_ns=0, offset=0.0, drift=0.0, offset_sigma=sigma)]
            if clocks:
                begun = replace(clocks[0], since_ns=max(clocks[0].since_ns, heard.first_ns))
                timings[camera] = ClockHistory(camera, (begun, *clocks[1:]), heard.readout_time, heard.readout_sigma)
        return timings

    @property
    def strangers(self) -> Set[str]:
        """Cameras that are of another time than most: nothing can be learned of their clocks."""
        return self._time.strangers

    @property
    def moves(self) -> int:
        """How often the time of most cameras went elsewhere."""
        return self._time.moves

    @property
    def is_listening(self) -> bool:
        """Whether cameras speak, but nothing of it has gone on yet."""
        return self.beat is None and self._first_ns >= 0

    @property
    def sharing(self) -> frozenset[str]:
        """Cameras that share their stamps with most others, and always did."""
        if self.beat is None or self._learner is None:
            return frozenset()
        return self.beat.together - self._learner.strayed

    def join(self, camera: str) -> None:
        """Listen to one more camera."""
        self._heard.setdefault(camera, HeardCamera())

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """What one camera says; what may go on by now, stamps corrected, of each camera in order of time."""
        heard = self._heard.get(matches.camera)
        passed: list[LandmarkMatches] = []
        if heard is None:
            return passed
        if matches.stamp_ns <= heard.latest_ns - _LISTEN_NS:
            passed = self._release(None, [heard])
            heard.begin_anew()
        moves = self._time.moves
        self._time.add(matches.camera, matches.stamp_ns, len(self._heard))
        if matches.camera in self.strangers:
            return passed + self._keep_stranger(matches)
        if self._time.moves > moves:
            passed += self._begin_anew()
            first, self._astray = self._astray, deque()
            passed += [said for image in first for said in self.add(image)]
        heard.intervals.add(matches.stamp_ns)
        heard.latest_ns = matches.stamp_ns
        heard.first_ns = matches.stamp_ns if heard.first_ns < 0 else heard.first_ns
        if not math.isnan(matches.readout_sigma):
            heard.readout_time, heard.readout_sigma = matches.readout_time, matches.readout_sigma
        heard.held.append(matches)
        heard.images.append(matches)
        if self._first_ns < 0:
            self._first_ns = self._window_from_ns = matches.stamp_ns
        if self._learner is None or self._is_guess:
            if not self._has_listened(matches.stamp_ns):
                return passed
            self._listen()
        elif not heard.clocks and matches.stamp_ns - heard.images[0].stamp_ns >= _LISTEN_NS:
            self._admit(matches.camera)
        while (self._time.latest_ns or 0) > self._window_from_ns + self._window_ns + MARGIN_NS:
            self._learn_until(self._window_from_ns + self._window_ns)
        self._go_on(matches.stamp_ns)
        return passed + self._release(self._known_until_ns())

    def _known_until_ns(self) -> int | None:
        """Up to which stamp clocks are known well enough, and what is held may go on; None for all that there is."""
        if not self._lookahead_ns:
            return None
        # Those who share their stamps need no correction, unless the window that is under way tells otherwise.
        all_share = self.sharing >= {camera for camera, heard in self._heard.items() if heard.held}
        return self._window_from_ns - (0 if all_share else self._lookahead_ns)

    def flush(self) -> list[LandmarkMatches]:
        """All that is held; the recording is over, or, live, nobody has spoken for a while."""
        if (self._learner is None or self._is_guess) and self._first_ns >= 0:
            self._listen()
            if not self._lookahead_ns and not self._has_listened(self._time.latest_ns or 0):
                # So few stamps must not say for ever who goes with whom. Of one image there is no beat: it is held.
                self._is_guess = True
                return self._release(None) if self.beat and (self.beat.together or self.beat.period_ns) else []
        self._finish()
        latest_ns = self._time.latest_ns
        while latest_ns is not None and latest_ns - self._window_from_ns > self._window_ns // 4:
            self._learn_until(latest_ns + 1)
            self._finish()
        return self._release(None) + list(self._astray)

    def _keep_stranger(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """A clock that was never set goes its own way; or it is the first to go where all will, and waits for them."""
        if not self._lookahead_ns:
            return [matches]
        self._astray.append(matches)
        return [self._astray.popleft()] if len(self._astray) > self._time.most_votes(len(self._heard)) else []

    def _has_listened(self, stamp_ns: int) -> bool:
        """Whether most cameras were heard for long enough, or one for so long that the others are not waited for."""
        long_enough = sum(0 <= heard.first_ns <= heard.latest_ns - _LISTEN_NS for heard in self._heard.values())
        return 2 * long_enough > len(self._heard) or stamp_ns - self._first_ns >= _LISTEN_AT_MOST_NS

    def _begin_anew(self) -> list[LandmarkMatches]:
        """Time is elsewhere, as when a bag is played again: what is known of clocks stays; what was held goes on."""
        self._finish()
        passed = self._release(None)
        for heard in self._heard.values():
            heard.begin_anew()
        self._first_ns = self._window_from_ns = -1
        return passed

    def _listen(self) -> None:
        """Find out who goes with whom, and begin to learn."""
        self._is_guess = False
        stamps = {camera: own for camera, heard in self._heard.items() if len(own := heard.stamps_ns())}
        self.beat = shared_beat(stamps, self._body.cameras_on(self._body.root), alone=len(self._heard) == 1)
        self._learner = ClockLearner(self._body, self._settings, self._floor, self._first_ns)
        for camera in sorted(stamps, key=lambda camera: (camera != self.beat.reference, camera)):  # type: ignore[union-attr]
            self._enter(camera, camera in self.beat.together)

    def _admit(self, camera: str) -> None:
        """A camera that came late: does it share its stamps with the others?"""
        assert self.beat is not None
        own = self._heard[camera].stamps_ns()
        others = [self._heard[other].stamps_ns(int(own[0])) for other in self.sharing]
        triggered = any(len(stamps) > 1 and go_together(own, stamps) for stamps in others)
        if triggered:
            self.beat = replace(self.beat, together=self.beat.together | {camera})
        self._enter(camera, triggered)

    def _enter(self, camera: str, triggered: bool) -> None:
        assert self._learner is not None
        self._finish()
        self._learner.admit(camera, triggered)
        sigma = self._settings.trigger_sigma if triggered else self._settings.sigma
        self._heard[camera].clocks = [ClockState(0, self._first_ns, 0.0, 0.0, sigma, self._settings.drift_sigma)]

    def _learn_until(self, to_ns: int) -> None:
        """Learn from the window that begins where the last one ended; it ends early where a clock may have been set."""
        assert self._learner is not None
        self._finish()
        from_ns = self._window_from_ns
        breaks = {camera: heard.intervals.first_break(from_ns, to_ns) for camera, heard in self._heard.items()}
        cut_ns = min((stamp for stamp in breaks.values() if stamp is not None), default=None)
        until_ns = to_ns if cut_ns is None else cut_ns
        if until_ns - from_ns >= self._window_ns // 8:
            self._look_for_strays(from_ns, until_ns)
            images = {camera: list(heard.images) for camera, heard in self._heard.items()}
            self._learning = self._learn(images, from_ns, until_ns)
            if self._lookahead_ns or cut_ns is not None:
                self._finish()
        self._window_from_ns = until_ns
        for camera, heard in self._heard.items():
            if cut_ns is not None and breaks[camera] == cut_ns and heard.clocks:
                # From here on its clock may be another.
                self._learner.stray(camera)
                heard.clocks.append(replace(heard.clocks[-1], since_ns=cut_ns, at_ns=cut_ns))
                heard.images = deque(image for image in heard.images if image.stamp_ns >= cut_ns)
            while heard.images and heard.images[0].stamp_ns < until_ns - 2 * MARGIN_NS:
                heard.images.popleft()

    def _learn(self, images: Images, from_ns: int, to_ns: int) -> Generator[None, None, None]:
        assert self._learner is not None
        clocks = yield from self._learner.learn(images, from_ns, to_ns)
        for camera, clock in clocks.items():
            self._set(camera, clock)

    def _go_on(self, stamp_ns: int) -> None:
        """Live, the body must not wait for a window that is learned: there is one step of it at each instant."""
        if self._learning is None or 0 <= stamp_ns - self._went_on_ns < (self.beat.period_ns if self.beat else 0):
            return
        self._went_on_ns = stamp_ns
        try:
            next(self._learning)
        except StopIteration:
            self._learning = None

    def _finish(self) -> None:
        """Learn what is left of the window that is being learned."""
        if self._learning is not None:
            at_once(self._learning)
            self._learning = None

    def _look_for_strays(self, from_ns: int, to_ns: int) -> None:
        """Whose stamps wander away from those that they were the same as: a clock of its own drifts."""
        assert self._learner is not None
        stamps = {camera: self._heard[camera].stamps_ns(from_ns) for camera in self.sharing}
        lively = {camera: own[own < to_ns] for camera, own in stamps.items() if np.sum(own < to_ns) > 1}
        if len(lively) < 2:
            return
        together = shared_beat(lively).together or {self._learner.reference}
        for camera in sorted(set(lively) - together):
            self._learner.stray(camera)

    def _set(self, camera: str, clock: ClockState) -> None:
        """Take over what was learned of a clock, for all the time since it was set."""
        clocks = self._heard[camera].clocks
        clocks[-1] = replace(clock, since_ns=clocks[-1].since_ns)
        if len(clocks) > 1:
            self._note_jump(camera, clocks[-2], clocks[-1])

    def _note_jump(self, camera: str, before: ClockState, after: ClockState) -> None:
        by_s = 1e-9 * (after.offset_ns(after.since_ns) - before.offset_ns(after.since_ns))
        self.jumps = [jump for jump in self.jumps if (jump.camera, jump.stamp_ns) != (camera, after.since_ns)]
        if abs(by_s) > max(self._settings.jump, 3.0 * after.offset_sigma):
            self.jumps.append(ClockJump(camera, after.since_ns, by_s))

    def _release(self, until_ns: int | None, of: Collection[HeardCamera] | None = None) -> list[LandmarkMatches]:
        """What is held of the time before a stamp (of all time), of some or all, in order of corrected stamps."""
        passed = []
        sharing = self.sharing
        for camera, heard in self._heard.items():
            if not heard.held or (of is not None and heard not in of):
                continue
            # Those that are triggered together stay together: what is learned of their clocks is noise.
            clocks = [] if camera in sharing else heard.clocks
            while heard.held and (until_ns is None or heard.held[0].stamp_ns < until_ns):
                given = heard.held.popleft()
                image = corrected(given, clocks, heard.passed)
                heard.passed = given.stamp_ns, image.stamp_ns
                passed.append(image)
        return sorted(passed, key=lambda matches: (matches.stamp_ns, matches.camera))
