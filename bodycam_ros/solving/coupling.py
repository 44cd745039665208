"""A body's equipment while it is used: where it is, what holds, what has been learned of its lengths (B 3.2).

Before the solver sees an instant the equipment is fitted to the body as cameras see it. That places it when it is seen
first, gives its start values ever after, and says which attachments hold: one that the cameras contradict is let go
before it could bend a limb. Where something stands, and lengths that nobody measured, are fitted to all that has been
seen so far, now and then.
"""

from collections.abc import Mapping, Set

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.equipment.attachment_joint import attachment_joint
from bodycam_ros.equipment.equipment import Attachment, Equipment
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.solving.attachment_watch import AttachmentWatch, Holding
from bodycam_ros.solving.camera_evidence import SegmentPose, poses_as_seen
from bodycam_ros.solving.coupling_settings import CouplingSettings
from bodycam_ros.solving.equipment_fit import EquipmentFit, HeldPoints, Prior
from bodycam_ros.solving.equipment_memory import SeenInstants
from bodycam_ros.solving.equipment_motion import EquipmentMotion
from bodycam_ros.solving.equipment_place import EquipmentPlace, Placed
from bodycam_ros.solving.held_joint import HeldJoint, Standing, held_joint
from bodycam_ros.solving.motion import MotionSettings

Array = NDArray[np.float64]

_STANDS = np.repeat([1e-4, 1e-4], 3)
"""[rad], [m] what stands still is never held tighter."""

_FOLLOWED = np.repeat([0.1, 0.01], 3)
"""[rad], [m] errors of what a prediction goes on from; what is seen knows better."""

_ANYHOW = 10.0
"""[rad], [m] of joints before anything is known of them."""


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
        anchored: whether it has gone on from the instant before as was expected.
        lengths: (L) how far what was unknown is from where it was said to be [m].
        length_sigmas: (L) [m].
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, settings: CouplingSettings, motion: MotionSettings
    ) -> None:
        self._body, self.equipment, self.settings = body, equipment, settings
        own = {joint.name for joint in equipment.joints}
        self._tree = [joint for joint in body.tree_joints if joint.name in own]
        self.fit = EquipmentFit(equipment, self._tree)
        self._place = EquipmentPlace(equipment, self._tree, self.fit)
        self._motion = EquipmentMotion(equipment, self._tree, motion, settings.speed_time)
        self._watch = AttachmentWatch(body, equipment, self.fit.lengths, settings)
        self._seen = SeenInstants(settings)
        self.rows = np.array([body.segment_index[name] for name in equipment.segments])
        self._root = self.fit.row[equipment.root]
        self.stands = equipment.segments[equipment.root].stands
        self.placed = self.anchored = False
        self.lengths, self.length_sigmas = np.zeros(len(self.fit.lengths)), self.fit.lengths.priors.copy()
        self._world_T_root, self._root_sigmas = np.eye(4), _STANDS
        self._begin_ns: int | None = None
        self._learned()

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that it speaks for: of the equipment, to it and beside it."""
        own = {joint.name for joint in self._tree} | {a.name for a in self.equipment.attachments}
        return frozenset(own | {self.equipment.name})

    @property
    def holding(self) -> Holding | None:
        """What holds at the present instant; None while nobody knows where the equipment is."""
        return self._watch.holding if self.placed else None

    @property
    def keeping(self) -> NDArray[np.bool_]:
        """(E) which segments keep their speed."""
        return self._motion.keeping

    @property
    def keeping_joints(self) -> Set[str]:
        """Names of the hinges that turn them."""
        return self._motion.keeping_joints

    def drives(self, joint: Joint, holding: Holding | None) -> bool:
        """Whether somebody is seen to drive the child of one of its joints."""
        return holding is not None and holding.drives(self._motion.held_below(joint.child))

    def accelerations(self, holding: Holding | None) -> Array:
        """(E, 6) how suddenly its segments change their motion [rad/s^2], [m/s^2]."""
        return self._motion.accelerations(holding.drives if holding else lambda attachments: False)

    @property
    def standing(self) -> Standing | None:
        """Where its root stands, if it stands still and is placed."""
        if not (self.placed and self.stands):
            return None
        return Standing(int(self.rows[self._root]), self._world_T_root, self._root_sigmas)

    def begin_anew(self) -> None:
        """After a pause: it is looked for again."""
        self._motion.forget()
        self.placed = self.anchored = False

    def sigmas(self, dt_s: float, previous_dt_s: float) -> Array:
        """(E, 6) by how much the segments may deviate from their prediction over a time [rad], [m]."""
        return self._motion.sigmas(dt_s, previous_dt_s, self._watch.holding.drives)

    def predict(self, moved: Array, latest: Array | None, dt_s: float) -> None:
        """Put the equipment into a prediction of all segments (S, 4, 4).

        Args:
            moved: where each segment goes by itself; the equipment's rows are changed, in place.
            latest: (S, 4, 4) the estimate of the instant before; None at the beginning.
            dt_s: since then [s].
        """
        if not self.placed or latest is None:
            moved[self.rows] = self._beside(moved)
            return
        poses = moved[self.rows]
        if self.stands:
            poses[self._root] = self._world_T_root
        moved[self.rows] = self._motion.predict(poses, latest[self.rows], self._own, dt_s)

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
        seen = {self._body.segment_index[pose.segment] for pose in evidence.values()}
        looked = self._watch.look(
            1e-9 * (stamp_ns - self._begin_ns), poses_as_seen(self._body, path, evidence.values()), seen
        )
        self.anchored = self.placed
        if self.placed:
            path[self.rows] = self._follow(looked, path[self.rows], dt_s, evidence)
        else:
            path[self.rows] = self._find(looked, path, evidence)
        if self.placed and self._seen.add(stamp_ns, self._watch.held(looked), path[self.rows]):
            self._learn(path)

    def learn_speeds(self, latest: Array, before: Array, dt_s: float) -> None:
        """Hear the estimates (S, 4, 4) of two instants, from which hinges that keep their speed learn it."""
        if self.placed:
            self._motion.learn_speeds(latest[self.rows], before[self.rows], dt_s, self._watch.holding.drives)

    def joints(self, path: Array, holding: Holding | None) -> list[HeldJoint]:
        """The equipment's joints, and what holds it to the body, around poses (S, 4, 4).

        A place that is not known yet is as soft as that.
        """
        own = [HeldJoint(joint, joint.information) for joint in self._own]
        if holding is None:
            return own
        return own + [
            held_joint(self._held[a.name], self._unknown[a.name], self._ends(a, path), self._kernel(a, holding))
            for a in self.equipment.attachments
            if holding.engaged[a.name]
        ]

    def _kernel(self, attachment: Attachment, holding: Holding) -> float:
        """Sigmas from which on an attachment gives way: unseen, nobody has let it go, and it may begin far off."""
        if attachment.name in holding.seen:
            return self.settings.kernel
        return max(self.settings.kernel, self.settings.release_distance / float(attachment.sigmas.min()))

    def report(self, world_T_segment: Array, holding: Holding | None) -> EquipmentReport:
        """What is published of an instant: poses (S, 4, 4), and what held at it; None before it was placed."""
        attachments = self.equipment.attachments
        deviations = np.full(len(attachments), np.nan)
        if holding is not None:
            deviations = np.array([self._deviation(attachment, world_T_segment) for attachment in attachments])
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
            values=self.fit.lengths.said + self.lengths,
            sigmas=self.length_sigmas.copy(),
        )

    def _beside(self, path: Array) -> Array:
        """Where nobody knows the equipment to be: at the body's root."""
        return self._place.nominal(path[self._body.segment_index[self._body.root]])

    def _learned(self) -> None:
        """Where joints and attachments are by now."""
        lengths = self.fit.lengths
        self._own = [lengths.joint(joint, self.lengths) for joint in self._tree]
        self._shifted = {a.name: lengths.attachment(a, self.lengths) for a in self.equipment.attachments}
        self._held = {name: attachment_joint(attachment) for name, attachment in self._shifted.items()}
        self._unknown = {name: lengths.along_axes(name, self.length_sigmas) for name in self._shifted}

    def _find(self, looked: HeldPoints, path: Array, evidence: Mapping[str, SegmentPose]) -> Array:
        """Poses (E, 4, 4) of equipment that was not placed yet: where its own camera has it, or the body holds it."""
        found = self._see_itself(looked, evidence) or self._place.anywhere(looked, np.zeros(len(self.lengths)))
        if found is None:
            return self._beside(path)
        self.placed = True
        self._world_T_root = found.poses[self._root]
        self._root_sigmas = np.maximum(found.root_sigmas, _STANDS)
        self._watch.begin(self._watch.distances(looked, found.poses, self.lengths), self.length_sigmas)
        return found.poses

    def _see_itself(self, looked: HeldPoints, evidence: Mapping[str, SegmentPose]) -> Placed | None:
        """Where it is by a camera on its root."""
        own = [seen for seen in evidence.values() if seen.segment == self.equipment.root]
        if not own:
            return None
        surest = min(own, key=lambda seen: float(np.trace(seen.covariance)))
        sigmas = np.full((len(self.rows), 6), _ANYHOW)
        sigmas[self._root] = np.sqrt(np.diag(surest.covariance))
        prior = Prior(self._place.nominal(surest.world_T_segment), sigmas)
        return Placed(self._place.around(looked, self.lengths, prior), sigmas[self._root])

    def _follow(self, looked: HeldPoints, predicted: Array, dt_s: float, evidence: Mapping[str, SegmentPose]) -> Array:
        """Poses (E, 4, 4) near the prediction, or where hinges must have turned meanwhile; what is let go."""
        prior = self._prior(predicted, dt_s, evidence)
        poses = prior.poses
        distances = self._watch.distances(looked, poses, self.lengths)
        # What has gone on unseen in another way than expected begins anew where it is seen.
        self.anchored = not self._watch.contradicted(distances, self.length_sigmas)
        if self._watch.astray(distances, self.length_sigmas):
            poses = self._place.near(self._watch.held(looked), self.lengths, prior)
            distances = self._watch.distances(looked, poses, self.lengths)
        if 2 * self._watch.contradicted(distances, self.length_sigmas) > len(distances):
            elsewhere = self._place.around(looked, self.lengths, prior)
            anew = self._watch.distances(looked, elsewhere, self.lengths)
            if sum(anew.values()) < sum(distances.values()):
                poses, distances = elsewhere, anew
                self._motion.forget()
        self._watch.notice(distances, self.length_sigmas)
        return poses

    def _prior(self, predicted: Array, dt_s: float, evidence: Mapping[str, SegmentPose]) -> Prior:
        """Where the equipment should be: as predicted (E, 4, 4), or where cameras of its own have it."""
        poses, sigmas = predicted.copy(), np.hypot(self.sigmas(dt_s, dt_s), _FOLLOWED)
        if self.stands:
            sigmas[self._root] = self._root_sigmas
        for seen in evidence.values():
            if seen.segment in self.fit.row:
                row = self.fit.row[seen.segment]
                poses[row], sigmas[row] = seen.world_T_segment, np.sqrt(np.diag(seen.covariance))
        return Prior(poses, sigmas)

    def _learn(self, path: Array) -> None:
        """Fit where it stands and what is unknown to all that was seen."""
        fitted = self._seen.fit(self.fit, self.lengths)
        self.lengths, self.length_sigmas = fitted.lengths, fitted.length_sigmas
        self._learned()
        if self.stands:
            self._world_T_root = fitted.poses[-1, self._root]
            self._root_sigmas = np.maximum(fitted.root_sigmas, _STANDS)
            path[self.rows[self._root]] = self._world_T_root

    def _ends(self, attachment: Attachment, world_T_segment: Array) -> tuple[Array, Array]:
        """Poses (4, 4) of its segments of the body and of the equipment."""
        row = self._body.segment_index
        return world_T_segment[row[attachment.body_segment]], world_T_segment[row[attachment.equipment_segment]]

    def _deviation(self, attachment: Attachment, world_T_segment: Array) -> float:
        return float(self._shifted[attachment.name].distances(*self._ends(attachment, world_T_segment)).mean())
