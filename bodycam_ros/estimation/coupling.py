"""A body's equipment while it is used: its pose, its active attachments, its lengths as they are estimated (B 3.2).

Before a state is solved the equipment's prediction is compared with the body as cameras measured it: that shows which
attachments are contradicted before they bend a limb. Equipment that is not placed, or contradicted by most attachments,
is searched. The pose of equipment that stands, and its unknown lengths, are fitted to all measurements now and then.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.attachments import ActiveAttachments, Attachments, CouplingSettings
from bodycam_ros.estimation.equipment_fit import AttachedHistory, AttachedPoints, EquipmentFit
from bodycam_ros.estimation.equipment_motion import EquipmentMotion
from bodycam_ros.estimation.equipment_search import EquipmentSearch
from bodycam_ros.estimation.estimate import Coordinates
from bodycam_ros.estimation.measurements import ClosedJoint, SegmentPoses, measured_poses
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kinematics.tangent import TreeTangent

_STANDS = np.repeat([1e-4, 1e-4], 3)  # [rad], [m] least sigmas of a root that stands
_SEARCH_NS, _LONGEST_NS = 200_000_000, 2_000_000_000  # between two searches in vain, at first and at most


class Coupling:
    """Follows the equipment of a body from state to state.

    Args:
        body: with the equipment.
        equipment: its segments, joints and attachments.
        settings: when attachments are active.
        motion: how suddenly segments change their motion, where the equipment does not say.

    Attributes:
        equipment: as given.
        fit: of the equipment to the body.
        motion: prior of its joints.
        attachments: to the body.
        joint_names: of its tree of joints and its attachments.
        placed: whether its pose is known.
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, settings: CouplingSettings, motion: MotionSettings
    ) -> None:
        self._body, self.equipment = body, equipment
        names = {joint.name for joint in equipment.joints}
        self._tree = [joint for joint in body.tree_joints if joint.name in names]
        self.fit = EquipmentFit(equipment, self._tree)
        self.motion = EquipmentMotion(body, equipment, motion)
        self.attachments = Attachments(body, equipment, self.fit.lengths, settings)
        self.joint_names = frozenset({*(j.name for j in self._tree), *self.attachments.names, equipment.name})
        self._search, self._history = EquipmentSearch(equipment, self.fit), AttachedHistory()
        self._rows = np.array([body.segment_index[name] for name in equipment.segments])
        self._joint_rows = [row for row, joint in enumerate(body.tree_joints) if joint.child in self.fit.chain.row]
        self._root, self._stands = self.fit.chain.row[equipment.root], equipment.segments[equipment.root].stands
        self._world_T_root, self._root_sigmas = np.eye(4), _STANDS
        self._start_ns: int | None = None
        self.placed = self._was_placed = False
        self.reset()

    def reset(self) -> None:
        """After a pause: equipment that stands is where it was, other equipment is searched again."""
        self.motion.reset()
        self.placed, self._was_placed = self.placed and self._stands, False
        self._search_due_ns, self._search_wait_ns = -(1 << 62), _SEARCH_NS
        self._searched_with: tuple[bool, ...] = ()

    def start(self, stamp_ns: int) -> None:
        """Set the first image of the recording [ns]; later calls change nothing."""
        self._start_ns = stamp_ns if self._start_ns is None else self._start_ns

    @property
    def active(self) -> ActiveAttachments | None:
        """Attachments of the present state; None while the equipment's pose is unknown."""
        return self.attachments.active if self.placed else None

    def update(self, stamp_ns: int, poses: Array, evidence: Sequence[SegmentPose]) -> None:
        """Fit the equipment to the measured body; its rows of the poses (S, 4, 4) are replaced in place.

        Args:
            stamp_ns: of the state [ns].
            poses: initial estimate of the state.
            evidence: measured poses of segments.
        """
        observed = {self._body.segment_index[pose.segment] for pose in evidence}
        seconds = 1e-9 * (stamp_ns - (stamp_ns if self._start_ns is None else self._start_ns))
        points = self.attachments.observe(seconds, measured_poses(self._body, poses, evidence), observed)
        if self.attachments.measured != self._searched_with:
            self._search_due_ns, self._search_wait_ns = stamp_ns, _SEARCH_NS
            self._searched_with = self.attachments.measured
        self._was_placed, attachments = self.placed, self.attachments
        distances = attachments.distances(points, poses[self._rows])
        if self.placed:
            attachments.update(distances)
        else:
            poses[self._rows] = self._search.nominal(poses[self._body.segment_index[self._body.root]])
        own = [pose for pose in evidence if pose.segment == self.equipment.root]
        if not self.placed or attachments.are_contradicted(distances):
            if stamp_ns >= self._search_due_ns or (own and not self.placed):
                self._search_due_ns = stamp_ns + self._search_wait_ns
                if not self._find(points, poses, own, distances):
                    self._search_wait_ns = min(2 * self._search_wait_ns, _LONGEST_NS)
        if self.placed and self._history.add(stamp_ns, attachments.engaged(points), poses[self._rows]):
            fitted = self._history.fit(self.fit, attachments.shifts)
            attachments.update_lengths(fitted.lengths, fitted.length_sigmas)
            if self._stands:
                self._set_root(fitted.poses[-1, self._root], fitted.root_sigmas)
                poses[self._rows[self._root]] = self._world_T_root

    def _set_root(self, world_T_root: Array, sigmas: Array) -> None:
        self._world_T_root, self._root_sigmas = world_T_root, np.maximum(sigmas, _STANDS)

    def _find(self, points: AttachedPoints, poses: Array, own: Sequence[SegmentPose], distances: Array) -> bool:
        """Search equipment that is not placed, or nearer to its attachments than it is, and replace its poses.

        Returns:
            Whether it was found.
        """
        surest = min(own, key=lambda pose: float(np.trace(pose.covariance)), default=None)
        root = None if surest is None else (surest.world_T_segment, np.sqrt(np.diag(surest.covariance)))
        found = self._search.find(points, self.attachments.shifts, root)
        if found is None:
            return False
        after = self.attachments.distances(points, found[0])
        if self.placed and not np.nansum(after) < np.nansum(distances):
            return False
        self.placed, self._was_placed, poses[self._rows] = True, False, found[0]
        self._set_root(found[0][self._root], found[1])
        self.attachments.place(after)
        return True

    def restarted_columns(self, tangent: TreeTangent, before: ActiveAttachments | None) -> NDArray[np.bool_]:
        """(K,) coordinates without a past: of equipment that was just placed, and of hinges that are driven again."""
        columns = np.zeros(tangent.count, bool)
        for row in self._joint_rows:
            columns[tangent.columns[row]] = not self._was_placed
        for row in self.motion.coasting_rows:
            if self.motion.is_driven(row, self.active) and not self.motion.is_driven(row, before):
                columns[tangent.columns[row]] = True
        return columns

    def with_equipment(self, at: Coordinates, poses: Array, tangent: TreeTangent) -> Coordinates:
        """Coordinates with the equipment as in poses (S, 4, 4), its joints shifted by the estimated lengths."""
        motion, body = at.motion.copy(), self._body
        combined = body.forward_kinematics(at.root, at.motion)
        combined[self._rows] = poses[self._rows]
        wanted = body.joint_poses(combined, tangent.slides)
        shifted = {j.name: self.fit.lengths.joint(j, self.attachments.shifts) for j in self._tree}
        for row in self._joint_rows:
            joint, motion[row] = body.tree_joints[row], wanted[row]
            if joint.name in shifted:
                shift = (inverse(joint.parent_T_joint) @ shifted[joint.name].parent_T_joint)[:3, 3]
                motion[row, :3, 3] += np.where(tangent.slides[row], 0.0, shift)
        return replace(at, motion=motion)

    def closed_joints(self, poses: Array) -> tuple[ClosedJoint, ...]:
        """Joints of the active attachments, about poses (S, 4, 4)."""
        return () if self.active is None else tuple(self.attachments.closed_joints(poses, self.active))

    def root_measurement(self) -> SegmentPoses:
        """The pose of a root that stands."""
        pose = SegmentPose(self.equipment.root, self._world_T_root, np.diag(self._root_sigmas**2))
        return SegmentPoses.from_evidence(self._body, [pose] if self.placed and self._stands else [])

    def report(self, poses: Array, active: ActiveAttachments | None) -> EquipmentReport:
        """Published report of a state with poses (S, 4, 4) and active attachments; None before it was placed."""
        names, lengths = self.attachments.names, self.fit.lengths
        return EquipmentReport(
            name=self.equipment.name,
            placed=active is not None,
            attachments=names,
            engaged=np.array([active is not None and active.active[name] for name in names], bool),
            deviations=np.full(len(names), np.nan) if active is None else self.attachments.gaps(poses),
            lengths=lengths.names,
            priors=lengths.priors,
            values=lengths.given + self.attachments.shifts,
            sigmas=self.attachments.sigmas.copy(),
        )
