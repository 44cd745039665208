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
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_report import EquipmentReport
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.solving.attachment_watch import AttachmentWatch, Holding
from bodycam_ros.solving.camera_evidence import SegmentPose, poses_as_seen
from bodycam_ros.solving.coupling_settings import CouplingSettings
from bodycam_ros.solving.equipment_fit import EquipmentFit, HeldPoints, Prior
from bodycam_ros.solving.equipment_memory import SeenInstants
from bodycam_ros.solving.equipment_motion import EquipmentMotion
from bodycam_ros.solving.equipment_place import EquipmentPlace
from bodycam_ros.solving.equipment_places import EquipmentPlaces
from bodycam_ros.solving.held_joint import Standing
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.search_pacing import SearchPacing

Array = NDArray[np.float64]

_STANDS = np.repeat([1e-4, 1e-4], 3)
"""[rad], [m] what stands still is never held tighter."""

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
        self._motion = EquipmentMotion(equipment, self._tree, motion, settings.speed_time)
        self._watch = AttachmentWatch(body, equipment, self.fit.lengths, settings)
        self._seen = SeenInstants(settings)
        self.rows = np.array([body.segment_index[name] for name in equipment.segments])
        self._root = self.fit.row[equipment.root]
        self.stands = equipment.segments[equipment.root].stands
        self.placed = self.went_on = False
        self.places = EquipmentPlaces(body, equipment, self._tree, self.fit.lengths, settings)
        self._world_T_root, self._root_sigmas = np.eye(4), _STANDS
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

    def begin(self, stamp_ns: int) -> None:
        """The first image of the recording [ns]; later ones do not count."""
        if self._begin_ns is None:
            self._begin_ns = stamp_ns

    def begin_anew(self) -> None:
        """After a pause: what stands is where it was, anything else is looked for again."""
        self._motion.forget()
        self._pacing.forget()
        self.placed, self.went_on = self.placed and self.stands, False

    def held_unplaced(self, stamp_ns: int, observed: NDArray[np.bool_]) -> Holding | None:
        """What held while nobody knew where it stands, as far as the file says; None if nobody knows it yet.

        Args:
            stamp_ns: of the instant.
            observed: (S,) which segments were seen at it.
        """
        if self.standing is None:
            return None
        return self._watch.said(self._seconds(stamp_ns), observed)

    def _seconds(self, stamp_ns: int) -> float:
        return 1e-9 * (stamp_ns - (stamp_ns if self._begin_ns is None else self._begin_ns))

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
        moved[self.rows] = self._motion.predict(poses, latest[self.rows], self.places.own, dt_s)

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

    def learn_speeds(self, latest: Array, before: Array, dt_s: float) -> None:
        """Hear the estimates (S, 4, 4) of two instants, from which hinges that keep their speed learn it."""
        if self.placed:
            self._motion.learn_speeds(latest[self.rows], before[self.rows], dt_s, self._watch.holding.drives)

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
        if self.standing is not None:
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
        # What has gone on unseen in another way than expected begins anew where it is seen.
        self.went_on = not self._watch.surprised(distances, self.places.sigmas)
        if self._watch.astray(distances, self.places.sigmas):
            poses = self._place.near(self._watch.held(looked), self.places.shifts, prior)
            distances = self._watch.distances(looked, poses, self.places.shifts)
        found = 2 * self._watch.contradicted(distances, self.places.sigmas) <= len(distances)
        if not found and may_search:
            elsewhere = self._place.around(looked, self.places.shifts, prior)
            anew = self._watch.distances(looked, elsewhere, self.places.shifts)
            if sum(anew.values()) < sum(distances.values()):
                poses, distances, self.went_on = elsewhere, anew, False
                self._motion.forget()
            found = 2 * self._watch.contradicted(distances, self.places.sigmas) <= len(distances)
        self._watch.notice(distances, self.places.sigmas)
        return found, poses

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
        fitted = self._seen.fit(self.fit, self.places.shifts)
        self.places.learn(fitted.lengths, fitted.length_sigmas)
        if self.stands:
            self._world_T_root = fitted.poses[-1, self._root]
            self._root_sigmas = np.maximum(fitted.root_sigmas, _STANDS)
            path[self.rows[self._root]] = self._world_T_root
