"""How well images support each segment of a body where it is, and each camera; how wrong a surface may be."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName, mirrored
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.static_camera import RegionEvidence

Mask = NDArray[np.bool_]

CONFIRMED = 0.62
"""Support from which on a segment that was searched for is confirmed."""

_RATE = 0.1
"""Share of a frame in a smoothed support."""

_MIN_SUPPORT, _MIN_HEAD_SUPPORT, _MIN_OUTER_SUPPORT = 0.4, 0.33, 0.5
"""Support below which a segment is taken to be elsewhere, the same of a head, and of a forearm with its hand or a shin
with its foot, on average: of 718 states of arms that were off by more than 15 cm 94 % had less, of right ones 1 %
(of one demo with noise in its start, by which it was chosen)."""

_OUTER = {"hand": "forearm", "foot": "shin"}

_MIRRORED_RATE = 0.2
"""Share of a frame in a smoothed support by the colours of the opposite limb."""

_ALIKE = 0.73
"""Support by the colours of the opposite limb where light is even (``dev_outside_board``); Pose2Sim's man has 0.42."""

_LEAST_ALIKE = {"upper_arm": 0.55, "shin": 0.62, "foot": 0.55}
"""Kind of segment that the first images did not show -> share of what the recording's limbs have of that support, below
which it is elsewhere. Colours that are learned at a wrong place support that place; clothes are alike on both sides.
Forearms and hands cannot be told apart by it. Nor can limbs that the first images show: light differs, and feet of
Pose2Sim's man, which are right, have a support of 0.15."""

_CONFIRMED_ALIKE = 0.75
"""The share of a segment that the first images did not show, from which on it is confirmed."""

_WEAK = 0.75
"""Support below which a limb is elsewhere where what hangs on it is."""

_MIN_LINES, _MIN_PIXELS = 4, 60  # of fewer lines, or pixels at half the resolution, no share can be computed
_PAUSE = 30  # frames between two searches; twice as many after each failure

_CAMERA_RATIO = 0.6
"""Share of lines that measure something, over the median of the other cameras: a camera 24 cm off had 0.41, a good one
before a cluttered wall 0.85."""
_MIN_CAMERAS = 3  # needed to identify a wrong one

_FAR_M, _FAR_RAD = 0.1, 0.7  # by which a limb jumps that was elsewhere before

_LIMB_SIGMAS = (0.05, 0.05, 0.12, 0.01, 0.01, 0.01)
_SURFACE_SIGMAS = {
    "head": (0.13, 0.1, 0.5, 0.01, 0.01, 0.01),
    "torso": (0.07, 0.15, 0.1, 0.01, 0.01, 0.01),
    "pelvis": (0.07, 0.15, 0.1, 0.01, 0.01, 0.01),
    "upper_arm": (0.05, 0.05, 0.5, 0.01, 0.01, 0.01),
    "foot": (0.18, 0.05, 0.08, 0.01, 0.01, 0.01),
}
"""[rad], [m] of a segment by static cameras that last for a recording: its surface is another. A contour hardly
measures the turn of a limb or a head about its long axis, z, and of a foot about x; a forearm that is nearly straight
on measures no turn of an upper arm."""


def surface_variances(body: BodyModel) -> Array:
    """(S, 6) variances of the errors in segments' axes that a wrong surface leaves for a whole recording."""
    kinds = [SegmentName(segment).kind for segment in body.segments]
    return np.array([_SURFACE_SIGMAS.get(kind, _LIMB_SIGMAS) for kind in kinds]) ** 2


def measure_support(measured: Collection[RegionEvidence], explained: Array, pixels: Array) -> Array:
    """Support (S,) of segments in the images of a frame, up to 1; NaN of segments that are hidden.

    The mean of two shares: of a segment's lines that measure something, and of its pixels that have its colours rather
    than those beside it, less those that have not (B eq. 8).

    Args:
        measured: of each image.
        explained, pixels: (S,), (S,) of all images together, as of ``RegionModel.explain_pixels``.
    """
    lines = sum((regions.lines for regions in measured), np.zeros(len(pixels), np.int64))
    asked = sum((regions.asked for regions in measured), np.zeros(len(pixels), np.int64))
    support: Array = 0.5 * (lines / np.maximum(asked, 1) + explained / np.maximum(pixels, 1.0))
    support[(asked < _MIN_LINES) | (pixels < _MIN_PIXELS)] = np.nan
    return support


class SegmentSupport:
    """The support of each segment, smoothed over frames.

    Args:
        body: segments and joints.

    Attributes:
        unconfirmed: (S,) segments that were searched for, and that the images have not confirmed since.
        unseen: (S,) segments that the first images did not show, and that none has confirmed since, neither by their
            own colours nor by those of the opposite limb: they are where the start has them, and colours that are
            learned there may be those of what is behind them.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self.unconfirmed = np.zeros(len(body.segments), bool)
        self.unseen = np.zeros(len(body.segments), bool)
        self._began = False
        self._smoothed = np.full(len(body.segments), np.nan)
        kinds = np.array([SegmentName(segment).kind for segment in body.segments])
        pairs = [(a, b) for a, b in body.joint_ends.tolist() if _OUTER.get(kinds[b]) == kinds[a]]
        self._pairs = np.array(pairs, np.int64).reshape(-1, 2)
        self._least = np.where(kinds == "head", _MIN_HEAD_SUPPORT, _MIN_SUPPORT)
        self._least[self._pairs] = _MIN_OUTER_SUPPORT
        self._beside = body.named(body.equipment_segments)
        self._hidden_first = self.unseen
        self._since_search = self._pause = _PAUSE
        self._opposite = opposite_rows(body)
        self._has_opposite = self._opposite != np.arange(len(body.segments))
        self._least_alike = np.array([_LEAST_ALIKE.get(kind, -np.inf) for kind in kinds])
        self._alike = self._smoothed.copy()
        self._most_alike = np.nan

    def update(self, support: Array, alike: Array) -> None:
        """Add the support in a frame (S,), and that by the colours of the opposite limbs (S,)."""
        if not self._began:
            self.unseen, self._began = np.isnan(support) & ~self._beside, True
            self._hidden_first = self.unseen
        self._smoothed = _smoothed(self._smoothed, support, _RATE)
        self._alike = _smoothed(self._alike, alike, _MIRRORED_RATE)
        shown = self._has_opposite & ~self._hidden_first & ~self._hidden_first[self._opposite]
        if len(known := self._alike[shown & np.isfinite(self._alike)]):
            self._most_alike = np.fmax(self._most_alike, np.median(known))
        confirmed = self._smoothed >= CONFIRMED
        has_like = self._has_opposite & ~self.unseen[self._opposite]
        self.unconfirmed = self.unconfirmed & ~confirmed
        still = self.unseen & ~(confirmed & (~has_like | (self._alike >= _CONFIRMED_ALIKE * self._usual)))
        # A shin points to where its foot is: neither is confirmed while the foot is seen, and is not.
        inner, outer = self._pairs.T
        still[inner] |= self.unseen[inner] & still[outer] & np.isfinite(self._smoothed[outer])
        self.unseen = still

    @property
    def false(self) -> Mask:
        """(S,) segments that are not where the body has them, and their descendants."""
        support = self._smoothed.copy()
        both = support[self._pairs]
        support[self._pairs] = np.where(np.isnan(both), both[:, ::-1], both).mean(axis=1, keepdims=True)
        return with_descendants(self._body, (support < self._least) | self.unconfirmed, ~self._beside)

    @property
    def _usual(self) -> float:
        """How alike the limbs are that the first images show on both sides: one side may be in the shade.

        The most so far, as limbs that are lost are less alike.
        """
        return _ALIKE if np.isnan(self._most_alike) else min(_ALIKE, float(self._most_alike))

    @property
    def unlike(self) -> Mask:
        """(S,) segments that the first images did not show and that are unlike the opposite limb, and descendants.

        The opposite is one that the images support, and better.
        """
        own = self._smoothed
        other_is_right = (own[self._opposite] >= own) & ~self.false[self._opposite] & ~self.unseen[self._opposite]
        is_unlike = (self._alike < self._least_alike * self._usual) & other_is_right & self._hidden_first
        return with_descendants(self._body, is_unlike, ~self._beside)

    @property
    def unsupported(self) -> Mask:
        """(S,) segments that are false, unseen or unlike, and limbs of weak support that these hang on.

        A limb points to where the next one is: where that is elsewhere, the limb often is, too.
        """
        unsupported = self.false | self.unseen | self.unlike
        is_weak = self._has_opposite & (self._smoothed < _WEAK)
        for parent, child in self._body.joint_ends[::-1].tolist():
            unsupported[parent] |= unsupported[child] & is_weak[parent] & ~self._beside[child]
        return unsupported

    @property
    def not_yet_shown(self) -> Mask:
        """(S,) segments that are unseen, and that no image contradicts."""
        return self.unseen & ~self.false & ~self.unlike

    def next_search(self) -> Mask:
        """(S,) segments to search for in this frame: false ones, at intervals that grow while searches fail."""
        missing = self.false
        self._since_search += 1
        if not missing.any():
            self._pause = _PAUSE
        elif self._since_search > self._pause:
            self._since_search, self._pause = 0, 2 * self._pause
            return missing
        return np.zeros_like(missing)

    def start_again(self, found: Mask) -> None:
        """Forget what images before showed of segments (S,) that a search has found elsewhere."""
        self._smoothed[found] = self._alike[found] = np.nan
        self.unconfirmed = self.unconfirmed & ~found


def is_far(poses: Array, others: Array) -> Mask:
    """(S,) segments at poses (S, 4, 4) whose origin or long axis is far from others'."""
    off_m = np.linalg.norm(poses[:, :3, 3] - others[:, :3, 3], axis=1)
    along = np.sum(poses[:, :3, 2] * others[:, :3, 2], axis=1)
    far: Mask = (off_m > _FAR_M) | (along < np.cos(_FAR_RAD))
    return far


def with_descendants(body: BodyModel, segments: Mask, within: Mask) -> Mask:
    """The segments (S,) ``within`` (S,) some, and those that hang on them."""
    chosen = segments & within
    for parent, child in body.joint_ends.tolist():
        chosen[child] |= chosen[parent] & within[child]
    return chosen


def opposite_rows(body: BodyModel) -> NDArray[np.int64]:
    """(S,) row of the same segment on the other side; its own of one that has none."""
    rows = body.segment_index
    return np.array([rows.get(mirrored(name) or name, row) for row, name in enumerate(body.segments)], np.int64)


def _smoothed(before: Array, now: Array, rate: float) -> Array:
    """Smoothed values (S,) with those of a frame, of which NaN add nothing."""
    begun = np.where(np.isnan(before), now, before)
    return np.where(np.isnan(now), begun, begun + rate * (now - begun))


class CameraSupport:
    """The share of each camera's lines that measure something, smoothed over frames."""

    def __init__(self) -> None:
        self._smoothed: dict[str, float] = {}

    def update(self, measured: Mapping[str, RegionEvidence]) -> None:
        """Add a frame, by camera."""
        for name, regions in measured.items():
            share = float(regions.lines.sum()) / max(int(regions.asked.sum()), 1)
            before = self._smoothed.get(name, share)
            self._smoothed[name] = before + _RATE * (share - before)

    @property
    def misplaced(self) -> frozenset[str]:
        """Cameras whose images do not show the body where the others have it."""
        known = self._smoothed
        if len(known) < _MIN_CAMERAS:
            return frozenset()
        return frozenset(
            name
            for name, share in known.items()
            if share < _CAMERA_RATIO * np.median([other for each, other in known.items() if each != name])
        )
