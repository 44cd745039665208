"""The equipment over a whole recording: where it stands and how long it is are known by now, for all instants alike.

A crank that nobody saw driven for a while went on from the speed that it had to the speed that it was seen at again, by
as many turns as fit best between them.
"""

from collections.abc import Sequence

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.geometry import transform_points
from bodycam_ros.kinematics.joint import hinge_angle
from bodycam_ros.solving.attachment_watch import Holding
from bodycam_ros.solving.body_factors import BodyFactors
from bodycam_ros.solving.coupling import Coupling
from bodycam_ros.solving.equipment_fit import HeldPoints
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.recorded_instants import RecordedInstant
from bodycam_ros.solving.smooth_motion import MotionLimits

Array = NDArray[np.float64]

_KEPT_S = 100.0  # what keeps its speed forgets it in this time
_SPEED_INSTANTS = 4  # before and after a stretch that tell the speed at its ends


class RecordedEquipment:
    """What the equipment adds to instants that are solved together.

    Args:
        body: with the equipment.
        coupling: as the forward pass left it.
        factors: names the variables.
    """

    def __init__(self, body: BodyModel, coupling: Coupling, factors: BodyFactors) -> None:
        self._body, self._coupling, self._factors = body, coupling, factors

    def joints(self, instant: RecordedInstant, around: Array) -> gtsam.NonlinearFactorGraph:
        """The factors that couple the body at an instant, around poses (S, 4, 4)."""
        holding = self._holding(instant)
        graph = self._factors.equipment(instant.index, around, self._coupling.places.joints(around, holding))
        standing = self._coupling.standing
        if standing and holding:
            graph.push_back(self._factors.anchor(instant.index, {standing.row: standing.pose}, standing.sigmas))
        return graph

    def _holding(self, instant: RecordedInstant) -> Holding | None:
        """What held at an instant; before anybody knew where something stands, what the file says."""
        known = instant.recorded.holding
        return known or self._coupling.held_unplaced(instant.state.stamp_ns, instant.state.observed)

    def motion(self, instants: Sequence[RecordedInstant], settings: MotionSettings) -> MotionLimits:
        """How suddenly the segments of T instants move."""
        motion = MotionLimits.of(settings, len(self._body.segments))
        accelerations = np.tile(motion.accelerations, (len(instants), 1, 1))
        velocity_time = motion.velocity_time.copy()
        rows = self._coupling.rows
        for place, instant in enumerate(instants):
            accelerations[place, rows] = self._coupling.accelerations(self._holding(instant))
        velocity_time[rows[self._coupling.keeping]] = _KEPT_S
        return MotionLimits(accelerations, velocity_time)

    def report(self, instant: RecordedInstant, world_T_segment: Array) -> EquipmentReport:
        """What is published of an instant whose poses (S, 4, 4) have become others."""
        return self._coupling.report(world_T_segment, self._holding(instant))

    def _held(self, instants: Sequence[RecordedInstant], poses: Array) -> HeldPoints:
        """Where the body is seen to hold it, of poses (T, S, 4, 4)."""
        points, holds = {}, {}
        holding = [self._holding(instant) for instant in instants]
        for attachment in self._coupling.equipment.attachments:
            name, body = attachment.name, poses[:, self._body.segment_index[attachment.body_segment]]
            points[name] = transform_points(body, attachment.on_body)
            holds[name] = np.array([h is not None and h.engaged[name] and name in h.seen for h in holding], bool)
        return HeldPoints(points, holds)

    def start(self, instants: Sequence[RecordedInstant], poses: Array) -> Array:
        """Start values (T, S, 4, 4): the equipment where it is known to stand, and its hinges on the way."""
        start, rows = poses.copy(), self._coupling.rows
        standing = self._coupling.standing
        if standing:
            start[:, standing.row] = standing.pose
        chain, lengths = self._coupling.fit.chain, self._coupling.places.shifts
        # By what holds it at each instant alone: the forward pass takes some to believe what it did not expect.
        fitted = self._coupling.fit.solve(start[:, rows], lengths, self._held(instants, poses))
        motions = chain.motions(fitted.poses, fitted.lengths)
        for row, f in enumerate(chain.freedoms):
            if f.joint.name in self._coupling.keeping_joints:
                driven = np.array([self._coupling.drives(f.joint, self._holding(i)) for i in instants], bool)
                angles = np.unwrap(hinge_angle(motions[:, row, :3, :3], f.joint.axis))
                stamps_s = 1e-9 * np.array([i.state.stamp_ns - instants[0].state.stamp_ns for i in instants])
                motions[:, row, :3, :3] = f.joint.hinge_rotation(on_the_way(angles, stamps_s, driven))
        start[:, rows] = chain.poses(start[:, rows[chain.root]], motions, lengths)[0]
        return start


def on_the_way(angles: Array, stamps_s: Array, driven: NDArray[np.bool_]) -> Array:
    """Angles (T) [rad] with stretches that nobody drove filled in: a cubic with the speeds at both of its ends.

    Args:
        angles: (T) continuous where it is driven.
        stamps_s: (T) [s].
        driven: (T) whether an angle is known.
    """
    filled = angles.copy()
    known = np.flatnonzero(driven)
    if not len(known):
        return filled
    for first, last in zip(known[:-1].tolist(), known[1:].tolist(), strict=True):
        if last - first < 2:
            # What is continuous stays so, whatever was added before.
            filled[last:] += 2.0 * np.pi * np.round((filled[first] - filled[last]) / (2.0 * np.pi))
            continue
        whole_s = stamps_s[last] - stamps_s[first]
        speeds = _speed(filled, stamps_s, driven, first, -1), _speed(filled, stamps_s, driven, last, 1)
        # An instant that is known alone has no speed; the other end tells it.
        told = [speed for speed in speeds if speed is not None] or [0.0]
        leaving, arriving = told[0], told[-1]
        expected = filled[first] + 0.5 * whole_s * (leaving + arriving)
        filled[last:] += 2.0 * np.pi * np.round((expected - filled[last]) / (2.0 * np.pi))
        u = (stamps_s[first + 1 : last] - stamps_s[first]) / whole_s
        way = filled[last] - filled[first]
        filled[first + 1 : last] = (
            filled[first]
            + (3.0 * u**2 - 2.0 * u**3) * way
            + whole_s * ((u**3 - 2.0 * u**2 + u) * leaving + (u**3 - u**2) * arriving)
        )
    return filled


def _speed(angles: Array, stamps_s: Array, driven: NDArray[np.bool_], place: int, side: int) -> float | None:
    """The speed [rad/s] at one end of a stretch, by the instants beyond it; None if there are none."""
    end = place
    while 0 <= end + side < len(driven) and driven[end + side] and abs(end + side - place) <= _SPEED_INSTANTS:
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    steps = np.diff(np.unwrap(angles[beyond])) / np.diff(stamps_s[beyond])
    return float(steps.mean())
