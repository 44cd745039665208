"""A body's equipment while it is used: its pose, its active attachments, its lengths as they are estimated (B 3.2).

The equipment is part of the body's tree, and its unknown lengths are joints that slide (``body_with_lengths``): the
state has them all, and their covariance. Before a state is fitted, the predicted equipment is compared with the body as
cameras measured it: that shows which attachments are contradicted before they bend a limb. Equipment that is not
placed, or contradicted by most attachments, is searched.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import length_joint
from bodycam_ros.body.equipment import Equipment, UnknownLengths
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body.equipment_search import EquipmentSearch
from bodycam_ros.body.mechanism import Mechanism
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.attachments import ActiveAttachments, Attachments, CouplingSettings
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.equipment_motion import EquipmentMotion, coasting
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M, JointRotations
from bodycam_ros.estimation.factors.resting_point import RestingPoint
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.kinematics.joint import LOOSE_M, LOOSE_RAD
from bodycam_ros.kinematics.tangent import TreeTangent

_STANDS_M = 2e-5  # by which points 1 m from the root of equipment that stands may move from frame to frame
_RATE = 1e-6  # [m/s] sigma of a length's rate at first: it stays
_SEARCH_NS = 1_000_000_000  # between two searches in vain, while the same attachments are measured


@dataclass(frozen=True, eq=False)
class CoupledState:
    """The equipment in one state.

    Attributes:
        start: initial coordinates, with equipment that was searched where it was found.
        active: active attachments; None while the equipment's pose is unknown.
        closed: active attachment -> sigmas from which on its joint counts less.
        is_placed_now: whether the equipment was found in this state.
        coasting: rows of hinges that were driven once and are not now.
    """

    start: Coordinates
    active: ActiveAttachments | None
    closed: Mapping[str, float]
    is_placed_now: bool
    coasting: tuple[int, ...]

    def expected(self, predicted: Coordinates) -> JointRotations:
        """Coasting hinges where the prediction has them (B figure 9)."""
        rows = list(self.coasting)
        return coasting(rows, predicted.joints[rows, :3, :3])


class Coupling:
    """Follows the equipment of a body from state to state.

    Args:
        body: with the equipment (``coupled_body``).
        equipment: its segments, joints and attachments.
        settings: when attachments are active.
        motion: how suddenly segments change their motion, where the equipment's file has none.

    Attributes:
        body: with the equipment and its lengths; what the body lacks comes last.
        equipment: as given.
        motion: prior of its joints.
        attachments: to the body.
        joint_names: of its tree of joints and its attachments.
        placed: whether its pose is known.
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, settings: CouplingSettings, motion: MotionSettings
    ) -> None:
        mechanism = Mechanism(body, equipment)
        self.body, self.equipment = mechanism.tree, equipment
        self._search, self._tangent = EquipmentSearch(mechanism), TreeTangent(self.body, SLIDES_M)
        self.motion = EquipmentMotion(self._tangent, equipment, motion)
        self.attachments = Attachments(self.body, equipment, settings)
        tree = self.body.tree_joints
        self._of_equipment = np.array([joint.child in equipment.segments for joint in tree])
        own = [joint.name for joint in tree if joint.child in equipment.segments]
        self.joint_names = frozenset({*own, *map(length_joint, mechanism.lengths), *self.attachments.names})
        self._root, self._stands = self.body.segment_index[equipment.root], equipment.segments[equipment.root].stands
        self._lengths = UnknownLengths(equipment)
        self._length_places = [(self.body.joint_row[length_joint(name)], axis) for name, axis in self._lengths.owners]
        self._length_columns = np.array(
            [
                self._tangent.columns[row].start + int(np.flatnonzero(self._tangent.twists[row][3 + axis])[0])
                for row, axis in self._length_places
            ],
            np.intp,
        )
        self._shifts, self._sigmas = np.zeros(len(self._lengths)), self._lengths.priors
        self._start_ns: int | None = None
        self.reset()

    def reset(self) -> None:
        """Search the equipment again after a gap; keep the estimates of its lengths."""
        self.placed = False
        self._driven = frozenset[int]()
        self._first_shifts, self._first_sigmas = self._shifts, self._sigmas
        self._search_due_ns = -(1 << 62)
        self._searched_with: tuple[bool, ...] = ()

    def start(self, stamp_ns: int) -> None:
        """Set the first image of the recording [ns]; later calls change nothing."""
        self._start_ns = stamp_ns if self._start_ns is None else self._start_ns

    def initial(self, at: Coordinates, sigmas: Array) -> tuple[Coordinates, Array]:
        """Initial coordinates and sigmas (2K), with the lengths as they were known before the first state."""
        joints, sigmas = at.joints.copy(), sigmas.copy()
        for (row, axis), shift in zip(self._length_places, self._first_shifts, strict=True):
            joints[row, axis, 3] = shift
        sigmas[self._length_columns], sigmas[self._tangent.count + self._length_columns] = _RATE, self._first_sigmas
        return at.placed(joints), sigmas

    def standing_points(self) -> list[RestingPoint]:
        """What equipment that stands has in common with the state before: three points of its root."""
        stands = self.placed and self._stands
        return [RestingPoint(self._root, place, _STANDS_M) for place in np.eye(3)] if stands else []

    def update(self, stamp_ns: int, start: Coordinates, observed: NDArray[np.bool_]) -> CoupledState:
        """Find out which attachments are active, and search equipment that is not placed.

        Args:
            stamp_ns: of the state [ns].
            start: initial coordinates of the state, at which the body is as measured.
            observed: (S,) segments that were measured.
        """
        start, found = self._placed(stamp_ns, start, observed)
        active = self.attachments.active if self.placed else None
        driven = self.motion.driven(active)
        coasting_rows = tuple(sorted(self._driven - driven)) if active is not None else ()
        self._driven |= driven
        closed = self.attachments.closed if self.placed else {}
        return CoupledState(start, active, closed, found, coasting_rows)

    def _placed(self, stamp_ns: int, start: Coordinates, observed: NDArray[np.bool_]) -> tuple[Coordinates, bool]:
        """Coordinates with the equipment as predicted, or where a search found it, and whether one did."""
        assert self._start_ns is not None  # set by ``start``
        attachments = self.attachments
        attachments.observe(1e-9 * (stamp_ns - self._start_ns), observed)
        measured = tuple(attachments.measured.tolist())
        if measured != self._searched_with:
            self._search_due_ns, self._searched_with = stamp_ns, measured
        gaps = attachments.gaps(start.poses)
        if self.placed:
            attachments.update(gaps)
        if self.placed and not attachments.are_contradicted(gaps):
            return start, False
        has_camera = bool(observed[self._root])
        if stamp_ns >= self._search_due_ns or (has_camera and not self.placed):
            self._search_due_ns = stamp_ns + _SEARCH_NS
            return self._find(start, has_camera, gaps)
        return start, False

    def _find(self, start: Coordinates, has_camera: bool, gaps: Array) -> tuple[Coordinates, bool]:
        """Coordinates with equipment where a search finds it, if it was not placed or is nearer to its attachments."""
        attachments = self.attachments
        measured = [name for name, flag in zip(attachments.names, attachments.measured, strict=True) if flag]
        found = self._search.find(start.motion, measured, has_camera)
        if found is None:
            return start, False
        placed = replace(start, motion=found)
        after = attachments.gaps(placed.poses)
        if self.placed and not after[attachments.measured].sum() < gaps[attachments.measured].sum():
            return start, False
        self.placed = True
        attachments.place(after)
        return placed, True

    def restarted(
        self, at: Coordinates, now: CoupledState, before: ActiveAttachments | None
    ) -> tuple[Coordinates, NDArray[np.bool_]]:
        """Coordinates and their columns (K,) without a past: of equipment just placed, of hinges driven again."""
        motion, joints = at.joints.copy(), np.zeros(len(at.joints), bool)
        if now.is_placed_now or now.active is None:
            joints |= self._of_equipment
            motion[joints] = now.start.joints[joints]
        joints[list(self.motion.driven(now.active) - self.motion.driven(before))] = True
        return at.placed(motion), self._tangent.columns_of(joints)

    def upright_measurement(self, now: CoupledState) -> SegmentPoses:
        """Measurement that the root is upright; once, when its pose is initialised."""
        sigma, poses = self.equipment.upright_sigma, []
        if now.is_placed_now and np.isfinite(sigma):
            level = now.start.poses[self._root].copy()
            up = level[:3, 2]
            lean = np.cross(up, [0.0, 0.0, 1.0])
            sine = float(np.linalg.norm(lean))
            if sine > 0.0:
                level[:3, :3] = exp_so3(lean * (np.arctan2(sine, up[2]) / sine)) @ level[:3, :3]
            sigmas = np.array([sigma, sigma, LOOSE_RAD, LOOSE_M, LOOSE_M, LOOSE_M])
            poses.append(SegmentPose(self.equipment.root, level, np.diag(sigmas**2)))
        return SegmentPoses.from_evidence(self.body, poses)

    @property
    def has_lengths(self) -> bool:
        """Whether lengths of the equipment are unknown."""
        return bool(self._length_places)

    def remember_lengths(self, at: Coordinates, covariance: Array) -> None:
        """Set what the estimate of a state, with its covariance (2K, 2K), has of the lengths."""
        self._shifts, self._sigmas = self._length_estimates(at, covariance)

    def _length_estimates(self, at: Coordinates, covariance: Array) -> tuple[Array, Array]:
        """Shifts (L) from the file's lengths, and their sigmas [m]."""
        shifts = np.array([at.joints[row, axis, 3] for row, axis in self._length_places])
        return shifts, np.sqrt(np.diag(covariance)[self._tangent.count + self._length_columns])

    def report(self, at: Coordinates, covariance: Array, active: ActiveAttachments | None) -> EquipmentReport:
        """Published report of a state with its covariance (2K, 2K) and active attachments; None: it was not placed."""
        names, (shifts, sigmas) = self.attachments.names, self._length_estimates(at, covariance)
        gaps = self.attachments.gaps(at.poses)
        return EquipmentReport(
            name=self.equipment.name,
            placed=active is not None,
            attachments=names,
            engaged=np.zeros(len(names), bool) if active is None else active.engaged,
            deviations=np.full(len(names), np.nan) if active is None else gaps,
            lengths=self._lengths.names,
            priors=self._lengths.priors,
            values=self._lengths.given + shifts,
            sigmas=sigmas,
        )
