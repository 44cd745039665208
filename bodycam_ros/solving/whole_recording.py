"""The whole recording, solved from both sides: each instant knows what came after it as well as what came before.

The forward pass gives start values and says which cameras are believed. Its instants wait here until there are enough
for a block, or the recording is over, and are solved together, with joints and motion around the estimate. Blocks
overlap: the end of one is solved again with what follows, from poses that stay as they were published.
"""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.solving.back_end import BackEndError
from bodycam_ros.solving.block_solver import Block, BlockSolver, solve_block
from bodycam_ros.solving.body_factors import BodyFactors
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.bridge import bridge
from bodycam_ros.solving.camera_evidence import SegmentTurn
from bodycam_ros.solving.equipment_recorded import RecordedEquipment
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.pose_memory import ExpectedJoints, PoseMemory
from bodycam_ros.solving.recorded_instants import RecordedInstant, border, known_by_turns
from bodycam_ros.solving.recorded_poses import RecordedPoses
from bodycam_ros.solving.smooth_motion import MotionLimits, SmoothMotion
from bodycam_ros.solving.smoother_settings import SmootherSettings
from bodycam_ros.solving.start_poses import hung

logger = logging.getLogger(__name__)

_HELD = 8
"""Instants before a block that stay as they were published: those that motion and turns of its first ones speak of."""
_MADE_ANEW = ("past", "joints", "equipment")
_HELD_SIGMA = 1e-5  # [rad, m] of these: next to a camera, not at all
_BEGIN_SIGMA = 5.0  # [rad, m] of where a recording begins: so vague that it only makes the problem solvable
_MOST_STEPS = 15  # Gauss-Newton takes two where cameras see, and some more for limbs that begin far off

Array = NDArray[np.float64]


class WholeRecording:
    """Keeps instants until they are solved together.

    Args:
        body: segments and joints.
        factors: names the variables.
        memory: of the poses that the forward pass has seen; asked again once it has seen more.
        motion: how suddenly the segments move.
        density: (6) of accelerations, for covariances of instants that are bridged.
        turn_sigma: of a measured rotation [rad].
        settings: length of the blocks.
        on_progress: told the share of the instants kept that is solved.
        equipment: what the body is coupled to.

    Attributes:
        bridged: instants without any image that were filled in.
        solve: solves a block; another one may take its place, to be compared.
    """

    def __init__(
        self,
        body: BodyModel,
        factors: BodyFactors,
        memory: PoseMemory,
        motion: MotionSettings,
        density: Array,
        turn_sigma: float,
        settings: SmootherSettings,
        on_progress: Callable[[float], None] = lambda share: None,
        equipment: RecordedEquipment | None = None,
    ) -> None:
        self._body, self._factors, self._memory, self._motion = body, factors, memory, motion
        self._equipment = equipment
        self._density, self._turn_sigma = density, turn_sigma
        self._settings, self._on_progress = settings, on_progress
        self.solve: BlockSolver = solve_block
        self._poses = RecordedPoses(memory)
        self._waiting: list[RecordedInstant] = []
        self._published: deque[RecordedInstant] = deque(maxlen=_HELD)
        self._ends = body.joint_ends
        self._below = body.rows_below
        self.bridged, self._unsolved = 0, 0

    def add(self, instant: RecordedInstant, following: Sequence[BodyState]) -> list[BodyState]:
        """The next instant; returns the states of a block once it is long enough. What follows comes by itself."""
        self._waiting.append(instant)
        waits_s = 1e-9 * (instant.state.stamp_ns - self._waiting[0].state.stamp_ns)
        block_s, overlap_s = self._settings.block, self._settings.overlap
        # Its end may be put anywhere within one overlap, and another one follows it.
        if waits_s < block_s + 2.0 * overlap_s:
            return []
        return self._solve(border(self._waiting, block_s, block_s + overlap_s))

    def flush(self) -> list[BodyState]:
        """All that is left: nothing follows."""
        return self._solve(len(self._waiting)) if self._waiting else []

    def _solve(self, count: int) -> list[BodyState]:
        """Solve all that waits, and publish the first ``count``."""
        held = len(self._published)
        instants = [*self._published, *self._waiting]
        try:
            solved = self._solve_together(instants, held)[held:]
        except BackEndError as error:
            if not self._unsolved:
                logger.warning(
                    "from %d ns on the recording is as one pass has it: %s", instants[0].state.stamp_ns, error
                )
            self._unsolved += count
            solved = np.array([instant.state.world_T_segment for instant in self._waiting])
        states = [
            replace(
                instant.state,
                world_T_segment=poses,
                equipment=self._equipment.report(instant, poses) if self._equipment else None,
            )
            for instant, poses in zip(self._waiting, solved, strict=True)
        ]
        self._poses.keep(held + count)
        published = self._with_bridges(states, count)
        for instant, state in zip(self._waiting[:count], states[:count], strict=True):
            self._published.append(replace(instant, state=state))
        # The next block starts from what this one has found out.
        self._waiting = [
            replace(instant, state=state) for instant, state in zip(self._waiting[count:], states[count:], strict=True)
        ]
        return published

    def _solve_together(self, instants: Sequence[RecordedInstant], held: int) -> Array:
        """Poses (T, S, 4, 4); of those held they stay as they are."""
        first_key = self._factors.key(instants[0].index, 0)
        stamps_ns = np.array([instant.state.stamp_ns for instant in instants])
        start = np.array([instant.state.world_T_segment for instant in instants])
        if self._equipment:
            start = np.concatenate([start[:held], self._equipment.start(instants, start)[held:]])
        expected = self._expect_again(instants, start)
        if self._equipment:
            start = self._hang_again(instants, start, expected)
        steps_done = 0

        def joints(around: Array) -> gtsam.NonlinearFactorGraph:
            graph = gtsam.NonlinearFactorGraph()
            for instant, poses, each in zip(instants, around, expected, strict=True):
                graph.push_back(instant.recorded.joints(poses, each))
                if self._equipment:
                    graph.push_back(self._equipment.joints(instant, poses))
            return graph

        def on_step() -> None:
            nonlocal steps_done
            steps_done += 1
            self._on_progress(1.0 - 0.5**steps_done)

        motion = MotionLimits.of(self._motion, len(self._body.segments))
        if self._equipment:
            motion = self._equipment.motion(instants, self._motion)
        block = Block(first_key, self._fixed(instants, held), joints, SmoothMotion(motion, stamps_ns))
        self._on_progress(0.0)
        poses = self.solve(block, start, _MOST_STEPS, on_step)
        self._on_progress(1.0)
        return poses

    def _fixed(self, instants: Sequence[RecordedInstant], held: int) -> gtsam.NonlinearFactorGraph:
        """All that does not depend on the estimate."""
        graph = gtsam.NonlinearFactorGraph()
        begin = instants[0]
        first_key = self._factors.key(begin.index, 0)
        for instant in instants:
            for name, factors in instant.recorded.factors.items():
                if name not in _MADE_ANEW:
                    graph.push_back(_within(factors, first_key))
        for instant in instants[1:]:
            graph.push_back(self._factors.turns(instant.index, self._turns_until_seen(instant)))
        for instant in instants[:held]:
            poses = dict(enumerate(instant.state.world_T_segment))
            graph.push_back(self._factors.anchor(instant.index, poses, np.full(6, _HELD_SIGMA)))
        if not held:
            poses = dict(enumerate(begin.state.world_T_segment))
            graph.push_back(self._factors.anchor(begin.index, poses, np.full(6, _BEGIN_SIGMA)))
        return graph

    def _turns_until_seen(self, instant: RecordedInstant) -> Iterable[tuple[int, SegmentTurn]]:
        """How segments turned until they were seen again, which goes backwards: the forward pass has no use for it."""
        for row, turn in instant.recorded.turns.items():
            if instant.state.observed[row]:
                yield instant.index - 1, SegmentTurn(self._body.segments[row], turn, self._turn_sigma)

    def _expect_again(self, instants: Sequence[RecordedInstant], poses: Array) -> list[ExpectedJoints]:
        """What is expected of unseen joints by all that was seen; nothing, where measured turns tell.

        Of joints that static cameras see it is what these say.
        """
        memory = self._memory.asked_again()
        known = np.asarray(known_by_turns(instants, self._memory.turning_time)[:, self._ends].all(axis=2))
        rotations = self._body.joint_rotations(poses)
        again, before_ns = [], instants[0].state.stamp_ns
        for instant, at, told in zip(instants, rotations, known, strict=True):
            recorded = instant.recorded
            dt_s = 1e-9 * (instant.state.stamp_ns - before_ns)
            before_ns = instant.state.stamp_ns
            expected = memory.expect(at, recorded.joints_seen, recorded.joints_turning, dt_s)
            again.append(expected.silenced(told[expected.rows]))
        expected_joints = self._poses.expect(
            np.array([instant.state.stamp_ns for instant in instants]),
            rotations,
            np.array([instant.recorded.joints_seen for instant in instants]) | self._memory.machine,
            again,
        )
        return [each.told(instant.recorded.told) for instant, each in zip(instants, expected_joints, strict=True)]

    def _hang_again(
        self, instants: Sequence[RecordedInstant], start: Array, expected: Sequence[ExpectedJoints]
    ) -> Array:
        """Start values (T, S, 4, 4) in which limbs hang as is expected of them by now, if nothing of them was seen.

        A joint that was never seen begins bent: a straight leg that a loop shortens might fold the wrong way.
        """
        hanging = []
        middle, known_joints = self._memory.middle_of_limits, self._memory.ever_seen
        start_rotations = self._body.joint_rotations(start)
        for instant, poses, rotations, each in zip(instants, start, start_rotations, expected, strict=True):
            rotations[each.rows] = np.where(known_joints[each.rows, None, None], each.rotations, middle[each.rows])
            children = self._ends[each.rows, 1]
            known = np.ones(len(poses), bool)
            limbs = [self._below[row] for row in children.tolist() if row in self._below]
            known[[limb[0] for limb in limbs if not instant.state.observed[limb].any()]] = False
            hanging.append(hung(self._body, poses, rotations, known))
        return np.array(hanging)

    def _with_bridges(self, states: Sequence[BodyState], count: int) -> list[BodyState]:
        """The first states, and between them those of the stamps at which all cameras were silent."""
        published = []
        before = [instant.state for instant in self._published][-2:]
        for place, (instant, state) in enumerate(zip(self._waiting[:count], states[:count], strict=True)):
            if instant.recorded.missing_ns and before:
                bridged = bridge(
                    self._body, before, states[place : place + 2], instant.recorded.missing_ns, self._density
                )
                self.bridged += len(bridged)
                published += bridged
            published.append(state)
            before = [*before[-1:], state]
        return published


def _within(factors: gtsam.NonlinearFactorGraph, first_key: int) -> gtsam.NonlinearFactorGraph:
    """Those factors that speak of no variable before the first: what they tie an instant to has been published."""
    if min(factors.keyVector(), default=first_key) >= first_key:
        return factors
    kept = gtsam.NonlinearFactorGraph()
    for place in range(factors.size()):
        factor = factors.at(place)
        if min(factor.keys()) >= first_key:
            kept.push_back(factor)
    return kept
