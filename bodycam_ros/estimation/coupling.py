"""A body's equipment while it is used: where it is, what holds, what has been learned of its lengths (B 3.2).

Before the solver sees an instant the equipment is fitted to the body as cameras see it. That places it when it is seen
first, gives its start values ever after, and says which attachments hold: one that the cameras contradict is let go
before it could bend a limb. Where something stands, and lengths that nobody measured, are fitted to all that has been
seen so far, now and then.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.attachment_watch import AttachmentWatch, Holding
from bodycam_ros.estimation.belief import Coordinates
from bodycam_ros.estimation.coupling_settings import CouplingSettings
from bodycam_ros.estimation.equipment_fit import EquipmentFit, HeldPoints, Prior, SeenInstants
from bodycam_ros.estimation.equipment_motion import EquipmentMotion, coasting
from bodycam_ros.estimation.equipment_place import EquipmentPlace, EquipmentPlaces
from bodycam_ros.estimation.measurements import JointRotations, SegmentPoses, poses_as_seen
from bodycam_ros.estimation.motion_model import LASTS_S, MotionModel, MotionSettings
from bodycam_ros.estimation.search_pacing import SearchPacing
from bodycam_ros.geometry import inverse
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.tangent import TreeTangent

Array = NDArray[np.float64]

_STANDS = np.repeat([1e-4, 1e-4], 3)
"""[rad], [m] what stands still is never held tighter."""

_LED = 600.0
"""[rad/s^2] of joints of limbs that a machine leads: their own motion must not hold it up."""

_KEPT_S = 100.0
"""[s] in which what keeps its speed forgets it."""

_FOLLOWED = np.repeat([0.1, 0.01], 3)
"""[rad], [m] errors of what a prediction goes on from; what is seen knows better."""


class Coupling:
    """Follows the equipment of a body from instant to instant.

    Args:
        body: coupled: the body with the equipment.
        equipment: what it is coupled to.
        settings: when attachments hold.
        motion: how suddenly segments change their motion, where the equipment does not say.

    Attributes:
        equipment, settings: as given.
        fit: of the equipment to the body.
        stands: whether its root stands still.
        rows: (E) of the equipment's segments in the body.
        placed: whether it is known where the equipment is.
        went_on: whether it has gone on from the instant before as was expected.
        places: where its joints and attachments are by now.
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, settings: CouplingSettings, motion: MotionSettings
    ) -> None:
        self._body, self.equipment, self.settings = body, equipment, settings
        own = {joint.name for joint in equipment.joints}
        self._tree = [joint for joint in body.tree_joints if joint.name in own]
        self.fit = EquipmentFit(equipment, self._tree)
        self._place = EquipmentPlace(equipment, self._tree, self.fit)
        self._motion = EquipmentMotion(equipment, self._tree, motion)
        self._watch = AttachmentWatch(body, equipment, self.fit.lengths, settings)
        self._seen = SeenInstants()
        self.rows = np.array([body.segment_index[name] for name in equipment.segments])
        self._root = self.fit.row[equipment.root]
        self.stands = equipment.segments[equipment.root].stands
        self.placed = self.went_on = False
        self.places = EquipmentPlaces(body, equipment, self._tree, self.fit.lengths, settings)
        self._world_T_root, self._root_sigmas = np.eye(4), _STANDS
        self._driven: set[int] = set()
        self._begin_ns: int | None = None
        self._pacing = SearchPacing()

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that it speaks for: of the equipment, to it and beside it."""
        own = {joint.name for joint in self._tree} | {a.name for a in self.equipment.attachments}
        return frozenset(own | {self.equipment.name})

    @property
    def holding(self) -> Holding | None:
        """What holds at the present instant; None while nobody knows where the equipment is."""
        return self._watch.holding if self.placed else None

    def motion(self, model: MotionModel, tangent: TreeTangent) -> tuple[Array, Array]:
        """Density (K), NaN of people, and times (K) of a prediction, in which equipment moves as it does by itself."""
        density, fade_s = np.full(tangent.count, np.nan), model.fade_s.copy()
        accelerations = self._motion.accelerations
        for row, joint in enumerate(tangent.tree.tree_joints):
            if joint.child not in self.fit.row:
                continue
            columns, e = tangent.columns[row], self.fit.row[joint.child]
            turns = tangent.twists[row][:3].any(axis=0)
            density[columns] = np.where(turns, accelerations[e, 0], accelerations[e, 3]) ** 2 * LASTS_S
            if joint.name in self._motion.keeping_joints:
                fade_s[columns] = _KEPT_S
                density[self._led_by(joint, tangent)] = _LED**2 * LASTS_S
        return density, fade_s

    def _led_by(self, hinge: Joint, tangent: TreeTangent) -> NDArray[np.bool_]:
        """(K,) coordinates of the limbs that hold a hinge's child, where it goes on by itself."""
        led, tree, held = np.zeros(tangent.count, bool), tangent.tree, self._motion.held_below(hinge.child)
        holding = self._watch.holding
        if not holding.drives(held):
            for each in self.equipment.attachments:
                if each.name in held and holding.engaged[each.name]:
                    for row in np.flatnonzero(tree.moves[tree.segment_index[each.body_segment]]):
                        led[tangent.columns[row]] = True
        return led

    def begins_anew(self, tangent: TreeTangent, before: Holding | None) -> NDArray[np.bool_]:
        """(K,) coordinates of which nothing was known: all that has just been found, and what is driven again.

        Args:
            tangent: of the body with the equipment.
            before: what held at the instant before.
        """
        columns = np.zeros(tangent.count, bool)
        for row, joint in enumerate(tangent.tree.tree_joints):
            if joint.child in self.fit.row:
                columns[tangent.columns[row]] = not self.went_on
        for row in self.keeping():
            joint = tangent.tree.tree_joints[row]
            if self.drives(joint, self.holding) and not self.drives(joint, before):
                columns[tangent.columns[row]] = True
        return columns

    def drives(self, joint: Joint, holding: Holding | None) -> bool:
        """Whether somebody is seen to drive the child of one of its joints."""
        return holding is not None and holding.drives(self._motion.held_below(joint.child))

    def coasting(self, at: Coordinates) -> JointRotations:
        """Hinges that somebody drove, and nobody is seen to drive now: they go on by themselves, and lead the limbs."""
        driven = {row for row in self.keeping() if self.drives(self._body.tree_joints[row], self.holding)}
        self._driven |= driven
        rows = sorted(self._driven - driven) if self.placed else []
        return coasting(rows, at.motion[rows, :3, :3])

    def keeping(self) -> list[int]:
        """Rows of the tree's joints that turn on by themselves."""
        joints = enumerate(self._body.tree_joints)
        return [row for row, joint in joints if joint.name in self._motion.keeping_joints]

    def seated(self, at: Coordinates, path: Array, slides: NDArray[np.bool_]) -> Coordinates:
        """Coordinates in which the equipment is where poses (S, 4, 4) have it, its joints where they have been learned.

        Args:
            at: of the body.
            path: poses (S, 4, 4).
            slides: (J, 3) along which axes joints slide.
        """
        motion, own = at.motion.copy(), {joint.name: joint for joint in self.places.own}
        poses = self._body.forward_kinematics(at.root, at.motion)
        poses[self.rows] = path[self.rows]
        wanted = self._body.joint_poses(poses, slides)
        for row, joint in enumerate(self._body.tree_joints):
            if joint.child in self.fit.row:
                motion[row] = wanted[row]
                if joint.name in own:
                    shift = (inverse(joint.parent_T_joint) @ own[joint.name].parent_T_joint)[:3, 3]
                    motion[row, :3, 3] += np.where(slides[row], 0.0, shift)
        return replace(at, motion=motion)

    def standing_still(self) -> SegmentPoses:
        """Where its root stands, as one more measurement."""
        if not (self.placed and self.stands):
            return SegmentPoses.of(self._body, [])
        pose = SegmentPose(self.equipment.root, self._world_T_root, np.diag(self._root_sigmas**2))
        return SegmentPoses.of(self._body, [pose])

    def begin(self, stamp_ns: int) -> None:
        """The first image of the recording [ns]; later ones do not count."""
        if self._begin_ns is None:
            self._begin_ns = stamp_ns

    def begin_anew(self) -> None:
        """After a pause: what stands is where it was, anything else is looked for again."""
        self._pacing.forget()
        self._driven.clear()
        self.placed, self.went_on = self.placed and self.stands, False

    def _seconds(self, stamp_ns: int) -> float:
        return 1e-9 * (stamp_ns - (stamp_ns if self._begin_ns is None else self._begin_ns))

    def follow(self, stamp_ns: int, dt_s: float, path: Array, evidence: Mapping[str, SegmentPose]) -> None:
        """Fit the equipment to what is seen of the body at an instant; its rows of the path (S, 4, 4) become that.

        Args:
            stamp_ns: of the instant.
            dt_s: since the one before [s].
            path: where the solver starts; changed in place.
            evidence: camera -> its registration, of those that are believed.
        """
        seen = {self._body.segment_index[pose.segment] for pose in evidence.values()}
        looked = self._watch.look(self._seconds(stamp_ns), poses_as_seen(self._body, path, evidence.values()), seen)
        may_search = self._pacing.is_due(stamp_ns, self._watch.seen)
        self.went_on = self.placed
        if self.placed:
            found, poses = self._follow(looked, self._prior(path[self.rows], dt_s, evidence), may_search)
        else:
            found, poses = self._find(looked, path, evidence, may_search)
        path[self.rows] = poses
        if not found and may_search:
            self._pacing.in_vain(stamp_ns)
        if self.placed and self._seen.add(stamp_ns, self._watch.held(looked), path[self.rows]):
            self._learn(path)

    def report(self, world_T_segment: Array, holding: Holding | None) -> EquipmentReport:
        """What is published of an instant: poses (S, 4, 4), and what held at it; None before it was placed."""
        attachments = self.equipment.attachments
        deviations = np.full(len(attachments), np.nan)
        if holding is not None:
            deviations = np.array([self.places.distance(a.name, world_T_segment) for a in attachments])
        return EquipmentReport(
            name=self.equipment.name,
            placed=holding is not None,
            attachments=tuple(attachment.name for attachment in attachments),
            engaged=np.array(
                [holding is not None and holding.engaged[attachment.name] for attachment in attachments], bool
            ),
            deviations=deviations,
            lengths=self.fit.lengths.names,
            priors=self.fit.lengths.priors,
            values=self.fit.lengths.said + self.places.shifts,
            sigmas=self.places.sigmas.copy(),
        )

    def _beside(self, path: Array) -> Array:
        """Where its hinges are not known: where it stands; or nothing of it, beside the body's root."""
        if self.placed and self.stands:
            return self._place.nominal(self._world_T_root)
        return self._place.nominal(path[self._body.segment_index[self._body.root]])

    def _find(
        self, looked: HeldPoints, path: Array, evidence: Mapping[str, SegmentPose], may_search: bool
    ) -> tuple[bool, Array]:
        """Equipment that was not placed yet: where its own camera has it, or the body holds it.

        Returns:
            Whether it was found, and poses (E, 4, 4).
        """
        own = [seen for seen in evidence.values() if seen.segment == self.equipment.root]
        found = self._place.by_camera(looked, self.places.shifts, own) if own else None
        if found is None and may_search:
            found = self._place.anywhere(looked, self.places.shifts)
        if found is None:
            return False, self._beside(path)
        self.placed = True
        self._world_T_root = found.poses[self._root]
        self._root_sigmas = np.maximum(found.root_sigmas, _STANDS)
        self._watch.begin(self._watch.distances(looked, found.poses, self.places.shifts), self.places.sigmas)
        return True, found.poses

    def _follow(self, looked: HeldPoints, prior: Prior, may_search: bool) -> tuple[bool, Array]:
        """Near the prediction, or where hinges must have turned meanwhile; what is let go.

        Returns:
            Whether it is where it should be, and poses (E, 4, 4).
        """
        poses = prior.poses
        distances = self._watch.distances(looked, poses, self.places.shifts)
        if self._watch.astray(distances, self.places.sigmas):
            poses = self._place.near(self._watch.held(looked), self.places.shifts, prior)
            distances = self._watch.distances(looked, poses, self.places.shifts)
        found = 2 * self._watch.contradicted(distances, self.places.sigmas) <= len(distances)
        if not found and may_search:
            elsewhere = self._place.around(looked, self.places.shifts, prior)
            anew = self._watch.distances(looked, elsewhere, self.places.shifts)
            if sum(anew.values()) < sum(distances.values()):
                poses, distances = elsewhere, anew
            found = 2 * self._watch.contradicted(distances, self.places.sigmas) <= len(distances)
        self._watch.notice(distances, self.places.sigmas)
        return found, poses

    def _prior(self, predicted: Array, dt_s: float, evidence: Mapping[str, SegmentPose]) -> Prior:
        """Where the equipment should be: as predicted (E, 4, 4), or where cameras of its own have it."""
        poses, sigmas = (
            predicted.copy(),
            np.hypot(self._motion.accelerations * dt_s**2, _FOLLOWED),
        )
        if self.stands:
            sigmas[self._root] = self._root_sigmas
        for seen in evidence.values():
            if seen.segment in self.fit.row:
                row = self.fit.row[seen.segment]
                poses[row], sigmas[row] = seen.world_T_segment, np.sqrt(np.diag(seen.covariance))
        return Prior(poses, sigmas)

    def _learn(self, path: Array) -> None:
        """Fit where it stands and what is unknown to all that was seen."""
        fitted = self._seen.fit(self.fit, self.places.shifts)
        self.places.learn(fitted.lengths, fitted.length_sigmas)
        if self.stands:
            self._world_T_root = fitted.poses[-1, self._root]
            self._root_sigmas = np.maximum(fitted.root_sigmas, _STANDS)
            path[self.rows[self._root]] = self._world_T_root
