"""A forearm that slid along its own axis, up a sleeve (B eq. 8 decides).

Contours do not measure where along its axis a forearm is: before a shirt of the same colour the upper arm has none, and
forearm and sleeve part where a joint connects them, which no line measures. So the elbow goes astray, up to 20 cm, by
itself. Pixels tell: those beyond the elbow have the sleeve's colours.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import LEFT, RIGHT
from bodycam_ros.geometry import Array, shortest_turn

SLID_M = 0.12
"""How far towards the hand an elbow is tried; half of the way is enough for contours to find the rest."""

_FOUND_M = 0.05
"""From the elbow to where it is found again, from which on it had slid [m]."""

_LEAST_GAIN = 0.03
"""Share of the arm's pixels that images must explain more. 2 of 226 right limbs had as much, with 4 and 139 pixels."""

_LEAST_PIXELS = 200.0
"""Pixels of an arm in all images, at half their resolution, of which fewer decide nothing."""

_EVERY = 2  # frames: a try costs as much as the fit of a frame
_NOTHING = 1e-9

Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SlidArm:
    """An arm that had slid.

    Attributes:
        poses: (S, 4, 4) of the body with the arm where images explain it better.
        arm: (3,) its rows.
    """

    poses: Array
    arm: Rows


class SlidArms:
    """Tries arms further down, one in every second frame.

    Args:
        body: segments; its arms are those that have a hand.
    """

    def __init__(self, body: BodyModel) -> None:
        self._arms = arms_of(body)
        self._frames = 0

    def find(
        self,
        poses: Array,
        excluded: Mask,
        explain: Callable[[Array], Array],
        refine: Callable[[Array], Array],
    ) -> SlidArm | None:
        """The arm of this frame, if images explain it better elsewhere.

        Args:
            poses: (S, 4, 4) of the body as it was fitted.
            excluded: (S,) segments that are not tried.
            explain: poses (S, 4, 4) -> (2, S) pixels that segments explain, and all of theirs.
            refine: poses (S, 4, 4) near the given ones that fit the images.
        """
        self._frames += 1
        number, rest = divmod(self._frames, _EVERY)
        if rest or not self._arms:
            return None
        arm = self._arms[number % len(self._arms)]
        explained, pixels = explain(poses)
        if excluded[arm].any() or pixels[arm].sum() < _LEAST_PIXELS:
            return None
        found = refine(slide(poses, arm))
        if np.linalg.norm(found[arm[1], :3, 3] - poses[arm[1], :3, 3]) < _FOUND_M:
            return None
        gain = float(explain(found)[0].sum() - explained.sum())
        return SlidArm(found, arm) if gain > _LEAST_GAIN * pixels[arm].sum() else None


def arms_of(body: BodyModel) -> list[Rows]:
    """Rows of the segments of each whole arm of a body: upper arm, forearm and hand."""
    rows = body.segment_index
    arms = [[f"{kind}{side}" for kind in ("upper_arm", "forearm", "hand")] for side in (LEFT, RIGHT)]
    return [np.array([rows[name] for name in arm]) for arm in arms if all(name in rows for name in arm)]


def slide(poses: Array, arm: Rows, along_m: float = SLID_M) -> Array:
    """Poses (S, 4, 4) with an arm's elbow further towards its hand [m]; the forearm keeps its direction."""
    upper_arm, forearm, hand = arm
    shoulder, elbow, wrist = poses[arm, :3, 3]
    tried = elbow + along_m * _unit(wrist - elbow) - shoulder
    before = elbow - shoulder
    moved = poses.copy()
    moved[upper_arm, :3, :3] = shortest_turn(before, tried) @ poses[upper_arm, :3, :3]
    moved[[forearm, hand], :3, 3] += np.linalg.norm(before) * _unit(tried) - before
    return moved


def _unit(vector: Array) -> Array:
    unit: Array = vector / max(float(np.linalg.norm(vector)), _NOTHING)
    return unit
