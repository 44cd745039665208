"""A body's equipment while it is used: where it is, what holds, what has been learned of its lengths (B 3.2).

Before the solver sees an instant the equipment is fitted to the body as cameras see it. That places it when it is seen
first, gives its start values ever after, and says which attachments hold: one that the cameras contradict is let go
before it could bend a limb. Where something stands, and lengths that nobody measured, are fitted to all that has been
seen so far, now and then.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint, hinge_angle
from bodycam_ros.equipment.attachment_joint import attachment_joint
from bodycam_ros.equipment.equipment import Attachment, Equipment
from bodycam_ros.geometry import inverse, rigid
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.equipment_fit import EquipmentFit, HeldPoints, Prior
from bodycam_ros.solving.equipment_memory import SeenInstants
from bodycam_ros.solving.equipment_place import EquipmentPlace, Placed
from bodycam_ros.solving.equipment_settings import EquipmentSettings
from bodycam_ros.solving.motion import MotionSettings, motion_sigmas

Array = NDArray[np.float64]

_STANDS = np.repeat([1e-4, 1e-4], 3)
"""[rad], [m] what stands still is never held tighter."""

_FOLLOWED = np.repeat([0.1, 0.01], 3)
"""[rad], [m] errors of what a prediction goes on from; what is seen knows better."""

_LENGTH_SIGMAS = 3.0

_COASTING = 0.1
"""Nobody seen, what keeps its speed is led by it alone: limbs that are guessed must not drive it."""


@dataclass(frozen=True, eq=False)
class HeldJoint:
    """A joint of the equipment, or an attachment that holds, as the solver has it at one instant.

    Attributes:
        joint: of the equipment, or between it, as the parent, and the body.
        information: (6, 6) of its residual in the child's axes.
        soft: whether it gives way where cameras contradict it.
    """

    joint: Joint
    information: Array
    soft: bool


class Coupling:
    """Follows the equipment of a body from instant to instant.

    Args:
        body: coupled: the body with the equipment.
        equipment: what it is coupled to.
        settings: when attachments hold.
        motion: how suddenly segments change their motion, where the equipment does not say.

    Attributes:
        rows: (E) of the equipment's segments in the body.
        placed: whether it is known where the equipment is.
        anchored: whether it was so at the instant before, too.
        engaged: attachment -> whether it holds now.
        lengths: (L) how far what was unknown is from where it was said to be [m].
        length_sigmas: (L) [m].
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, settings: EquipmentSettings, motion: MotionSettings
    ) -> None:
        self._body, self.equipment, self.settings, self._motion = body, equipment, settings, motion
        own = {joint.name for joint in equipment.joints}
        self._tree = [joint for joint in body.tree_joints if joint.name in own]
        self.fit = EquipmentFit(equipment, self._tree)
        self._place = EquipmentPlace(equipment, self._tree, self.fit)
        self.rows = np.array([body.segment_index[name] for name in equipment.segments])
        self._root = self.fit.row[equipment.root]
        self.stands = equipment.segments[equipment.root].stands
        self._body_row = {a.name: body.segment_index[a.body_segment] for a in equipment.attachments}
        self.placed = self.anchored = False
        self.lengths, self.length_sigmas = np.zeros(len(self.fit.lengths)), self.fit.length_priors.copy()
        self._poses = self._place.nominal(np.eye(4))
        self._root_sigmas = _STANDS
        self._speeds: dict[str, float] = {}
        self._begin_ns: int | None = None
        self._let_go = {a.name: False for a in equipment.attachments}
        self._is_seen = dict(self._let_go)
        self._held_below = self._attachments_below()
        self._against = dict.fromkeys(self._let_go, 0)
        self.engaged: dict[str, bool] = dict.fromkeys(self._let_go, False)
        self._seen = SeenInstants(settings)
        self._held: dict[str, HeldJoint] = {}

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that it speaks for: of the equipment, to it and beside it."""
        own = {joint.name for joint in self._tree} | {a.name for a in self.equipment.attachments}
        return frozenset(own | {self.equipment.name})

    def sigmas(self, dt_s: float, previous_dt_s: float) -> Array:
        """(E, 6) by how much the segments may deviate from their prediction over a time [rad], [m]."""
        sigmas = np.tile(motion_sigmas(dt_s, previous_dt_s, self._motion), (len(self.rows), 1))
        per_unit = 0.5 * dt_s * (dt_s + previous_dt_s)
        for row, moves in enumerate(self.equipment.segments.values()):
            if moves.angular_acceleration_sigma is not None:
                sigmas[row, :3] = moves.angular_acceleration_sigma * per_unit
            if moves.acceleration_sigma is not None:
                sigmas[row, 3:] = moves.acceleration_sigma * per_unit
            if moves.keeps_speed and self._coasts(row):
                sigmas[row, :3] *= _COASTING
        if self.stands:
            sigmas[self._root] = self._root_sigmas
        return sigmas

    def _coasts(self, row: int) -> bool:
        """Whether nobody sees a segment (its row among the equipment's) driven, nor any that hangs on it."""
        return not any(self._is_seen[name] and self.engaged[name] for name in self._held_below[row])

    def predict(self, moved: Array, latest: Array | None, dt_s: float) -> None:
        """Put the equipment into a prediction of all segments (S, 4, 4).

        Args:
            moved: where each segment goes by itself; the equipment's rows are changed, in place.
            latest: (S, 4, 4) the estimate of the instant before; None at the beginning.
            dt_s: since then [s].
        """
        if not self.placed or latest is None:
            moved[self.rows] = self._poses if self.placed else self._beside(moved)
            return
        poses, before = moved[self.rows], latest[self.rows]
        if self.stands:
            poses[self._root] = self._poses[self._root]
        for joint in self._joints():
            p, c = self.fit.row[joint.parent], self.fit.row[joint.child]
            if not self.equipment.segments[joint.child].keeps_speed or joint.type != "hinge":
                poses[c] = poses[p] @ joint.measured_relative_pose(inverse(poses[p]) @ poses[c])
                continue
            angle = _angle(joint, before[p], before[c]) + dt_s * self._speeds.get(joint.name, 0.0)
            turn = rigid(joint.hinge_rotation(np.array(angle)), np.zeros(3))
            poses[c] = poses[p] @ joint.parent_T_joint @ turn @ joint.joint_T_child
        moved[self.rows] = poses

    def _attachments_below(self) -> list[set[str]]:
        """(E) attachments to each of the equipment's segments, and to those that hang on it."""
        below = [{a.name for a in self.equipment.attachments if a.equipment_segment == name} for name in self.fit.row]
        for joint in reversed(self._tree):
            below[self.fit.row[joint.parent]] |= below[self.fit.row[joint.child]]
        return below

    def _beside(self, path: Array) -> Array:
        """Where nobody knows the equipment to be: at the body's root."""
        return self._place.nominal(path[self._body.segment_index[self._body.root]])

    def follow(self, stamp_ns: int, dt_s: float, path: Array, evidence: Mapping[str, SegmentPose]) -> None:
        """Fit the equipment to what is seen of the body at an instant; its rows of the path (S, 4, 4) become that.

        Args:
            stamp_ns: of the instant.
            dt_s: since the one before [s].
            path: where the solver starts; changed in place.
            evidence: camera -> its registration, of those that are believed.
        """
        if self._begin_ns is None:
            self._begin_ns = stamp_ns
        seconds = 1e-9 * (stamp_ns - self._begin_ns)
        said = {a.name: a.holds_at(seconds) for a in self.equipment.attachments}
        poses = _seen_poses(self._body, path, evidence)
        seen = {self._body.segment_index[pose.segment] for pose in evidence.values()}
        self._is_seen = {name: row in seen for name, row in self._body_row.items()}
        held = self._held_points(poses, {name: said[name] and self._is_seen[name] for name in said})
        self.anchored = self.placed
        if not self.placed:
            self._try_to_place(held)
            path[self.rows] = self._poses if self.placed else self._beside(path)
        else:
            path[self.rows] = self._follow(held, path[self.rows], dt_s, self._seen_sigmas(evidence, dt_s))
        self.engaged = {name: self.placed and said[name] and not self._let_go[name] for name in said}
        if self.placed and self._seen.add(stamp_ns, self._only_engaged(held), path[self.rows]):
            self._learn(path)

    def begin_anew(self) -> None:
        """After a pause: what stands is where it was, anything else is looked for again."""
        self._speeds.clear()
        self.placed = self.anchored = False

    def learn_speeds(self, latest: Array, before: Array, dt_s: float) -> None:
        """Hear the estimates (S, 4, 4) of two instants, from which hinges that keep their speed learn it."""
        if not self.placed:
            return
        share = 1.0 - np.exp(-dt_s / self.settings.speed_time)
        for joint in self._joints():
            keeps = joint.type == "hinge" and self.equipment.segments[joint.child].keeps_speed
            if keeps and not self._coasts(self.fit.row[joint.child]):
                p, c = (self.rows[self.fit.row[name]] for name in (joint.parent, joint.child))
                step = _angle(joint, latest[p], latest[c]) - _angle(joint, before[p], before[c])
                speed = float((step + np.pi) % (2.0 * np.pi) - np.pi) / dt_s
                known = self._speeds.get(joint.name, speed)
                self._speeds[joint.name] = known + share * (speed - known)

    def joints(self, path: Array) -> list[HeldJoint]:
        """The equipment's joints, and what holds it to the body now, around poses (S, 4, 4).

        A place that is not known yet is as soft as that.
        """
        own = [HeldJoint(joint, joint.information, False) for joint in self._joints()]
        return own + [self._held_joint(a, path) for a in self.equipment.attachments if self.engaged[a.name]]

    @property
    def standing(self) -> tuple[int, Array, Array] | None:
        """Row in the body, pose (4, 4) and sigmas (6) of the root of what stands still; None of anything else."""
        if not (self.placed and self.stands):
            return None
        return int(self.rows[self._root]), self._poses[self._root], self._root_sigmas

    def distances(self, world_T_segment: Array) -> Array:
        """(K) mean distance of the points of each attachment [m], of poses (S, 4, 4)."""
        distances = []
        for attachment in self.equipment.attachments:
            shifted = self._shifted(attachment)
            equipment = world_T_segment[self._body.segment_index[attachment.equipment_segment]]
            distances.append(shifted.distances(world_T_segment[self._body_row[attachment.name]], equipment).mean())
        return np.array(distances)

    def _joints(self) -> list[Joint]:
        joints = []
        for joint in self._tree:
            shift = self.fit.shift(joint.name, self.lengths)
            if shift.any():
                place = joint.parent_T_joint.copy()
                place[:3, 3] += shift
                joint = replace(joint, parent_T_joint=place)
            joints.append(joint)
        return joints

    def _shifted(self, attachment: Attachment) -> Attachment:
        shift = self.fit.shift(attachment.name, self.lengths)
        return replace(attachment, on_equipment=attachment.on_equipment + shift) if shift.any() else attachment

    def _held_points(self, poses: Array, holds: Mapping[str, bool]) -> HeldPoints:
        points = {}
        for attachment in self.equipment.attachments:
            pose = poses[self._body_row[attachment.name]]
            points[attachment.name] = (attachment.on_body @ pose[:3, :3].T + pose[:3, 3])[None]
        return HeldPoints(points, {name: np.array([held]) for name, held in holds.items()})

    def _only_engaged(self, held: HeldPoints) -> HeldPoints:
        holds = {name: seen & (not self._let_go[name]) for name, seen in held.holds.items()}
        return HeldPoints(held.points, holds)

    def _distances(self, held: HeldPoints, poses: Array) -> dict[str, float]:
        """Attachment -> mean distance of its points [m], of those that are seen, of poses (E, 4, 4)."""
        distances = {}
        for attachment in self.equipment.attachments:
            if held.holds[attachment.name][0]:
                pose = poses[self.fit.row[attachment.equipment_segment]]
                on_equipment = attachment.on_equipment + self.fit.shift(attachment.name, self.lengths)
                there = on_equipment @ pose[:3, :3].T + pose[:3, 3]
                distances[attachment.name] = float(
                    np.linalg.norm(there - held.points[attachment.name][0], axis=1).mean()
                )
        return distances

    def _limit(self, name: str, distance: float) -> float:
        """A distance [m], and how little is known of where the attachment is."""
        columns = [column for column, (owner, _) in enumerate(self.fit.lengths) if owner == name]
        return distance + _LENGTH_SIGMAS * float(np.linalg.norm(self.length_sigmas[columns]))

    def _try_to_place(self, held: HeldPoints) -> None:
        placed = self._place.anywhere(held, np.zeros(len(self.lengths)))
        if placed is None:
            return
        self._take(placed)
        self.placed = True
        for name, distance in self._distances(held, self._poses).items():
            self._let_go[name] = distance > self._limit(name, self.settings.release_distance)

    def _take(self, placed: Placed) -> None:
        self._poses = placed.poses
        self._root_sigmas = np.maximum(placed.root_sigmas, _STANDS)

    def _seen_sigmas(self, evidence: Mapping[str, SegmentPose], dt_s: float) -> tuple[Array, dict[int, Array]]:
        """(E, 6) how far segments may be from their prediction, and where cameras of their own have them."""
        sigmas = np.hypot(self.sigmas(dt_s, dt_s), _FOLLOWED)
        if self.stands:
            sigmas[self._root] = self._root_sigmas
        own = {}
        for seen in evidence.values():
            if seen.segment in self.fit.row:
                row = self.fit.row[seen.segment]
                own[row] = seen.world_T_segment
                sigmas[row] = np.sqrt(np.diag(seen.covariance))
        return sigmas, own

    def _follow(self, held: HeldPoints, predicted: Array, dt_s: float, seen: tuple[Array, dict[int, Array]]) -> Array:
        """Poses (E, 4, 4) near the prediction, or where hinges must have turned meanwhile; who is let go."""
        sigmas, own = seen
        for row, pose in own.items():
            predicted[row] = pose
        engaged = self._only_engaged(held)
        poses = self._place.near(engaged, self.lengths, Prior(predicted, sigmas))
        distances = self._distances(held, poses)
        far = {name: d > self._limit(name, self.settings.release_distance) for name, d in distances.items()}
        if sum(far[name] and not self._let_go[name] for name in far) * 2 > len(far):
            # Most of what is seen contradicts it: the equipment itself has gone on unseen, another way than expected.
            elsewhere = self._place.around(held, self.lengths, Prior(predicted, sigmas))
            anew = self._distances(held, elsewhere)
            if sum(anew.values()) < sum(distances.values()):
                poses, distances = elsewhere, anew
                self._speeds.clear()
        self._notice(distances)
        return poses

    def _notice(self, distances: Mapping[str, float]) -> None:
        """Let go what is seen too far away for some instants, and take hold again of what is near."""
        detected = {a.name: a.detected for a in self.equipment.attachments}
        for name, distance in distances.items():
            held = not self._let_go[name]
            limit = self.settings.release_distance if held else self.settings.engage_distance
            contradicts = (distance > self._limit(name, limit)) == held
            self._against[name] = self._against[name] + 1 if contradicts and detected[name] else 0
            if self._against[name] >= self.settings.confirm_frames:
                self._let_go[name], self._against[name] = held, 0

    def _learn(self, path: Array) -> None:
        """Fit what stands still and what is unknown to all that was seen."""
        fitted = self._seen.fit(self.fit, self.lengths)
        self.lengths, self.length_sigmas = fitted.lengths, fitted.length_sigmas
        if self.stands:
            self._poses = fitted.poses[-1]
            self._root_sigmas = np.maximum(fitted.root_sigmas, _STANDS)
            path[self.rows[self._root]] = self._poses[self._root]

    def _held_joint(self, attachment: Attachment, path: Array) -> HeldJoint:
        joint, soft = attachment_joint(self._shifted(attachment)), self._is_seen[attachment.name]
        columns = [column for column, (owner, _) in enumerate(self.fit.lengths) if owner == attachment.name]
        if not columns:
            return HeldJoint(joint, joint.information, soft)
        # What is unknown lies along the equipment's axes, the joint's place in those of the body.
        loose = np.zeros(3)
        loose[[self.fit.lengths[column][1] for column in columns]] = self.length_sigmas[columns]
        parent, child = (path[self._body.segment_index[name], :3, :3] for name in (joint.parent, joint.child))
        joint_R_parent = (child @ joint.child_T_joint[:3, :3]).T @ parent
        sigmas = np.array(joint.sigmas)
        place = joint_R_parent @ np.diag(loose**2) @ joint_R_parent.T + np.diag(sigmas[3:] ** 2)
        tight = np.linalg.cholesky(np.linalg.inv(place)).T * sigmas[3:]
        A = joint.square_root_information.copy()
        A[3:] = tight @ A[3:]
        return HeldJoint(joint, A.T @ A, soft)


def _angle(joint: Joint, parent: Array, child: Array) -> float:
    return float(hinge_angle(joint.joint_rotation(parent[:3, :3].T @ child[:3, :3]), joint.axis))


def _seen_poses(body: BodyModel, path: Array, evidence: Mapping[str, SegmentPose]) -> Array:
    """The path (S, 4, 4) with segments where the surest of their cameras has them."""
    poses = path.copy()
    surest: dict[int, float] = {}
    for seen in evidence.values():
        row, spread = body.segment_index[seen.segment], float(np.trace(seen.covariance))
        if spread < surest.get(row, np.inf):
            surest[row] = spread
            poses[row] = seen.world_T_segment
    return poses
