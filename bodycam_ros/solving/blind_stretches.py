"""A limb that is blind for a while, from both of its sides: held back until it is seen again, then closed.

While a camera is not registered its segment goes on by the rotation between images (A eq. 2 and the second term of eq.
8), which drifts, and jumps once the camera is registered again. Offline nobody waits, so the instants of such a stretch
are kept until its end. There the same rotations are gone through backwards, and both ways are averaged by how far each
has come. What follows from joints alone has no rotation to go back by, and stays as it is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.start_poses import hung

_GUESSED_RAD = 0.3
"""What a limb may turn by, unexpectedly, from an instant to the next at which not even its rotation is measured."""

Array = NDArray[np.float64]


@dataclass
class _Held:
    """An instant that waits.

    Attributes:
        state: of the body.
        turns: row of a segment -> its rotation (3, 3) since the instant before, of those that were not seen at either.
        blind: rows of the segments that no camera sees, nor any segment below them.
    """

    state: BodyState
    turns: Mapping[int, Array]
    blind: frozenset[int]


class BlindStretches:
    """Holds states back while a limb is blind, and mends them when it is seen again.

    Only a limb that nothing below tells of is mended: of a thigh above a shin that is seen the joints know more, and of
    a leg whose foot a loop holds on a pedal.

    Args:
        body: segments and joints.
        longest_s: how long a state is held back at most; what was blind for longer is mended in its latest part.
        turn_sigma: of a rotation between two instants [rad].
    """

    def __init__(self, body: BodyModel, longest_s: float, turn_sigma: float) -> None:
        self._body = body
        self._longest_ns = 1e9 * longest_s
        self._turn_variance, self._guess_variance = turn_sigma**2, _GUESSED_RAD**2
        self._below = _free_limbs(body)
        self._held: list[_Held] = []
        self._seen: set[int] = set()

    def add(self, state: BodyState, turns: Mapping[int, Array]) -> list[BodyState]:
        """The next state; returns what need not wait any more.

        Args:
            state: later than the one before.
            turns: row of a segment -> how it turned since the state before, (3, 3), in the segment's frame then.
        """
        if not self._longest_ns:
            return [state]
        blind_before = self._held[-1].blind if self._held else frozenset[int]()
        blind = frozenset(row for row, below in self._below.items() if not state.observed[below].any())
        self._held.append(_Held(state, turns, blind))
        for row in sorted(blind_before - blind):
            self._close(row)
        self._seen |= self._below.keys() - blind
        if not any(self._turns_since_seen(row) for row in blind):
            return self._let_go(len(self._held))
        return self._let_go(sum(state.stamp_ns - held.state.stamp_ns > self._longest_ns for held in self._held))

    def flush(self) -> list[BodyState]:
        """All that is left: nothing follows."""
        return self._let_go(len(self._held))

    def _let_go(self, count: int) -> list[BodyState]:
        states = [held.state for held in self._held[:count]]
        del self._held[:count]
        return states

    def _turns_since_seen(self, row: int) -> bool:
        """Whether a blind segment has turned by measured rotations, or may: of the first state nobody knows yet."""
        begin = self._begin(row, len(self._held))
        is_first = row not in self._seen and len(self._held) == 1
        return is_first or any(row in held.turns for held in self._held[begin:])

    def _begin(self, row: int, end: int) -> int:
        """The first of the held instants from which on a segment was blind without a break, until before ``end``."""
        begin = end
        while begin and row in self._held[begin - 1].blind:
            begin -= 1
        return begin

    def _close(self, row: int) -> None:
        """Mend a segment that was blind until before the latest instant."""
        end = len(self._held) - 1
        begin = self._begin(row, end)
        # A limb that was never seen yet is a guess, and no side to come from.
        variance = 0.0 if row in self._seen else np.inf
        forward = []
        for held in self._held[begin:end]:
            variance += self._turn_variance if row in held.turns else self._guess_variance
            forward.append(variance)
        world_R_back, backward = self._held[end].state.world_T_segment[row, :3, :3], 0.0
        for place in range(end - 1, begin - 1, -1):
            turn = self._held[place + 1].turns.get(row)
            if turn is None:
                return
            world_R_back, backward = world_R_back @ turn.T, backward + self._turn_variance
            before = forward[place - begin]
            share = 1.0 if np.isinf(before) else before / (before + backward)
            self._turn(self._held[place], row, world_R_back, share)

    def _turn(self, held: _Held, row: int, world_R_segment: Array, share: float) -> None:
        """Turn a segment by a share of the way to a rotation (3, 3); what is below keeps its own, and hangs on it."""
        poses = held.state.world_T_segment.copy()
        own = poses[row, :3, :3]
        poses[row, :3, :3] = own @ exp_so3(share * log_so3(own.T @ world_R_segment))
        known = np.ones(len(poses), bool)
        known[self._below[row]] = False
        held.state = replace(
            held.state, world_T_segment=hung(self._body, poses, self._body.joint_rotations(poses), known)
        )


def _free_limbs(body: BodyModel) -> dict[int, list[int]]:
    """Row of a segment -> rows of it and of all below it; without what a loop holds, the root, and roots beside it."""
    held = {body.segment_index[name] for joint in body.loop_joints for name in (joint.parent, joint.child)}
    return {row: rows for row, rows in body.rows_below.items() if not held.intersection(rows)}
