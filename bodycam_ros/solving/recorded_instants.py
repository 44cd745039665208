"""The instants of a recording that wait until they are solved together, and where a block of them ends."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.solving.attachment_watch import Holding
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.pose_memory import ExpectedJoints, ToldJoints

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recorded:
    """What an instant brought, kept for later.

    Attributes:
        factors: group -> factors of it that speak of it alone or of it and earlier ones; "past", "joints" and
            "equipment" are made anew.
        joints: makes the factors of its joints around poses (S, 4, 4), with what is expected of those not seen.
        joints_seen: (J,) whether both segments of a joint were seen.
        joints_turning: (J,) whether both were, or their rotations measured at least.
        told: what static cameras say of joints.
        turns: row of a segment that is not seen, or was not -> its rotation (3, 3) since the instant before.
        missing_ns: stamps before this one at which all cameras were silent.
        refused: cameras that were not believed.
        holding: what held the body to its equipment; None without, or before that was placed.
    """

    factors: Mapping[str, gtsam.NonlinearFactorGraph]
    joints: Callable[[Array, ExpectedJoints], gtsam.NonlinearFactorGraph]
    joints_seen: NDArray[np.bool_]
    joints_turning: NDArray[np.bool_]
    told: ToldJoints
    turns: Mapping[int, Array]
    missing_ns: tuple[int, ...]
    refused: frozenset[str] = frozenset()
    holding: Holding | None = None


@dataclass(frozen=True)
class RecordedInstant:
    """An instant that the forward pass is done with.

    Attributes:
        index: its number in the forward pass; its variables are named by it.
        state: as the forward pass knows it; the solution starts at its poses.
        recorded: what it brought.
    """

    index: int
    state: BodyState
    recorded: Recorded


def known_by_turns(instants: Sequence[RecordedInstant], longest_s: float) -> NDArray[np.bool_]:
    """Which segments (T, S) were seen, or turned by measured rotations since or until they were, not long ago."""
    observed = np.array([instant.state.observed for instant in instants])
    turned = np.zeros_like(observed)
    for place, instant in enumerate(instants):
        turned[place, list(instant.recorded.turns)] = True
    stamps_ns = np.array([instant.state.stamp_ns for instant in instants])
    since = _seen_at(observed, turned, stamps_ns)
    until = -_seen_at(observed[::-1], np.roll(turned[::-1], 1, axis=0), -stamps_ns[::-1])[::-1]
    away_ns = np.minimum(stamps_ns[:, None] - since, until - stamps_ns[:, None])
    return np.asarray(away_ns <= 1e9 * longest_s)


def _seen_at(observed: NDArray[np.bool_], turned: NDArray[np.bool_], stamps_ns: NDArray[np.int64]) -> Array:
    """When (T, S) a segment was seen last, if it has turned by measured rotations ever since; else minus infinity."""
    seen = np.full(observed.shape, -np.inf)
    before = np.full(observed.shape[1], -np.inf)
    for place, stamp_ns in enumerate(stamps_ns):
        before = np.where(observed[place], stamp_ns, np.where(turned[place], before, -np.inf))
        seen[place] = before
    return seen


def border(instants: Sequence[RecordedInstant], earliest_s: float, latest_s: float) -> int:
    """How many instants a block publishes: where the most segments are seen, as late as that, within times [s]."""
    since_s = 1e-9 * np.array([instant.state.stamp_ns - instants[0].state.stamp_ns for instant in instants])
    places = np.flatnonzero((since_s >= earliest_s) & (since_s <= latest_s))
    if not len(places):
        return len(instants)
    seen = [int(instants[int(place)].state.observed.sum()) for place in places]
    return int(places[len(places) - 1 - int(np.argmax(seen[::-1]))]) + 1
