"""One state of the window: its measurements and factors, and what its publication waits for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.attachments import ActiveAttachments
from bodycam_ros.estimation.coordinates import Chart
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.estimation.factors.joint_rotations import JointRotations
from bodycam_ros.estimation.factors.motion import Motion
from bodycam_ros.estimation.factors.segment_steps import SegmentStep
from bodycam_ros.estimation.static_evidence import StaticObservation
from bodycam_ros.geometry import Array

Mask = NDArray[np.bool_]

_BLOCK_S, _OVERLAP_S = 15.0, 1.5  # a whole recording is solved in blocks, each with so much of what follows: memory
_BLIND_WAIT_S = 10.0  # a state waits this long at most for cameras that see again; offline, for those of a limb, too


@dataclass(frozen=True, eq=False)
class Measurements:
    """All measurements of one state.

    Attributes:
        cameras: poses of segments.
        expected: rotations of unobserved joints.
        closed: attachment that closes a loop now -> sigmas from which on it counts less.
        keypoints: of joints, in images of static cameras.
    """

    cameras: SegmentPoses
    expected: JointRotations
    closed: Mapping[str, float] = field(default_factory=dict)
    keypoints: JointKeypoints = field(default_factory=JointKeypoints.nothing)


@dataclass(eq=False)
class SolvedState:
    """One state of the window.

    Attributes:
        number: of the state, from the first of the recording on.
        stamp_ns: its time [ns].
        stamps_ns: camera -> stamp of its own image [ns].
        chart: vectors about the coordinates that fitted its measurements first.
        dt_s: since the state before [s]; 0 at a first state.
        motion: prior since the state before; None at a first state.
        steps: measurements between the state before and this one.
        measured: measurements of this state.
        joints_observed: (J,) whether body cameras observe both segments.
        turning: (J,) whether the rotations of both are measured at least.
        static: what static cameras observed.
        observed: (S,) whether a body camera on the segment, or a static camera, observes it.
        cameras_used: accepted cameras.
        converged: whether the fit did.
        active: which attachments of equipment are; None without equipment, or before it is placed.
        square_root: (2K, 2K) of its information when it was the newest.
        unobserved: (J,) joints that a later frame may still determine, by the rotations measured until then.
        is_unmeasured: whether neither this state nor a later one was observed.
        is_published: whether it has been published.
    """

    number: int
    stamp_ns: int
    stamps_ns: Mapping[str, int]
    chart: Chart
    dt_s: float
    motion: Motion | None
    steps: tuple[SegmentStep, ...]
    measured: Measurements
    joints_observed: Mask
    turning: Mask
    static: StaticObservation
    observed: Mask
    cameras_used: int
    converged: bool
    active: ActiveAttachments | None
    square_root: Array
    unobserved: Mask = field(init=False)
    is_unmeasured: bool = field(init=False)
    is_published: bool = False

    def __post_init__(self) -> None:
        self.unobserved, self.is_unmeasured = ~self.joints_observed, not self.is_observed

    @property
    def covariance(self) -> Array:
        """(2K, 2K) of velocities, then coordinates, given all until this state.

        It is published as it is. Later states make it smaller than errors are: cameras err alike in all of them, and a
        limb that none observes does not move as smoothly as the prior has it (a leg without images: 1.4 times).
        """
        inverse_root = np.linalg.inv(self.square_root)
        return np.asarray(inverse_root @ inverse_root.T, np.float64)

    @property
    def is_observed(self) -> bool:
        """Whether any camera was accepted."""
        return bool(self.observed.any())

    @property
    def is_waiting(self) -> bool:
        """Whether later frames may still determine what was not observed."""
        return self.is_unmeasured or bool(self.unobserved.any())

    def follow(self, latest: "SolvedState") -> None:
        """Update what it waits for by a later state."""
        self.unobserved &= latest.turning & ~latest.joints_observed
        self.is_unmeasured = self.is_unmeasured and not latest.is_observed


def ready_count(states: Sequence[SolvedState], settings: EstimatorSettings, offline: bool) -> int:
    """How many states, the first ones of one or more, need not wait for later frames any more.

    Args:
        states: in order of time.
        settings: how many frames, or what of a recording, a state waits for.
        offline: a state also waits until an unobserved limb is observed again.
    """
    latest = states[-1]
    if settings.whole_recording:
        if latest.stamp_ns - states[0].stamp_ns < 1e9 * (_BLOCK_S + _OVERLAP_S):
            return 0
        end_ns = states[0].stamp_ns + 1e9 * _BLOCK_S
        return sum(state.stamp_ns < end_ns for state in states)
    delay = int(settings.output_delay)
    observed_after = sum(state.is_observed for state in states)
    for number, state in enumerate(states):
        observed_after -= state.is_observed
        is_short = observed_after < delay or (offline and state.is_waiting)
        is_recent = latest.stamp_ns - state.stamp_ns < 1e9 * _BLIND_WAIT_S
        if len(states) - 1 - number < delay or (is_short and is_recent):
            return number
    return len(states)
