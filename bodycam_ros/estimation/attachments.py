"""Attachments of a body to its equipment: which are active, and the joints that close its loops (B 3.2, B eq. 15).

An attachment is active within its intervals, while the cameras do not contradict it: points that are measured farther
apart than they can be release it, points that come near again engage it. Lengths that nobody measured make an
attachment as soft as they are unknown.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment, UnknownLengths, attachment_joint
from bodycam_ros.estimation.equipment_fit import AttachedPoints
from bodycam_ros.estimation.measurements import ClosedJoint
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.settings import setting

CONFIRM_FRAMES = 3  # in a row release an attachment, or engage it; a wrong registration is shorter
ENGAGE_SHARE = 0.6  # of the release distance, within which a released attachment is engaged again: hysteresis
_PLAY_SIGMAS, _LENGTH_SIGMAS = 2.0, 3.0  # of the points' own play and of unknown lengths, added to a distance
_KERNEL = 4.0  # sigmas from which on an attachment counts less: one that was let go must not bend a limb


@dataclass(frozen=True)
class CouplingSettings:
    """When attachments are active."""

    release_distance: float = setting(
        0.05,
        unit="m",
        limits=(0.001, 1.0),
        reason="attachments whose points are measured farther apart are released; raise it where the body errs more",
    )


@dataclass(frozen=True)
class ActiveAttachments:
    """Attachments of one state.

    Attributes:
        active: attachment -> whether it is.
        observed: attachments whose segment of the body is observed.
    """

    active: Mapping[str, bool]
    observed: frozenset[str]

    def drive(self, attachments: Collection[str]) -> bool:
        """Whether any of some attachments is active and observed."""
        return any(self.active[name] and name in self.observed for name in attachments)


class Attachments:
    """All (A) attachments of a body to its equipment.

    Args:
        body: with the equipment.
        equipment: its attachments and joints.
        lengths: (L) unknown lengths of the equipment.
        settings: when attachments are active.

    Attributes:
        shifts: (L) estimated deviation of the lengths from the file [m].
        sigmas: (L) of the shifts [m].
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, lengths: UnknownLengths, settings: CouplingSettings
    ) -> None:
        self._settings, self._lengths, self._given = settings, lengths, equipment.attachments
        self.names = tuple(each.name for each in self._given)
        equipment_row = {name: row for row, name in enumerate(equipment.segments)}
        self._body_rows = np.array([body.segment_index[each.body_segment] for each in self._given], np.int64)
        self._rows = [equipment_row[each.equipment_segment] for each in self._given]
        self._equipment_rows = [body.segment_index[each.equipment_segment] for each in self._given]
        self._detected = np.array([each.detected for each in self._given], bool)
        self._play = np.array([np.sqrt(np.mean(each.sigmas**2)) for each in self._given])
        self._scheduled, self._observed, self._released = (np.zeros(len(self._given), bool) for _ in range(3))
        self._against = np.zeros(len(self._given), int)
        self.update_lengths(np.zeros(len(lengths)), lengths.priors.copy())

    def update_lengths(self, shifts: Array, sigmas: Array) -> None:
        """Set the estimated shifts (L) and their sigmas (L) [m]."""
        self.shifts, self.sigmas = shifts, sigmas
        self._shifted = [self._lengths.attachment(each, shifts) for each in self._given]
        self._joints = [attachment_joint(each) for each in self._shifted]
        self._unknown = np.array([self._lengths.along_axes(name, sigmas) for name in self.names]).reshape(-1, 3)

    def observe(self, seconds: float, poses: Array, observed: Collection[int]) -> AttachedPoints:
        """Points of the body at one time, of attachments that are scheduled and observed.

        Args:
            seconds: since the first image.
            poses: (S, 4, 4) of the body.
            observed: rows of the observed segments.
        """
        self._scheduled = np.array([each.holds_at(seconds) for each in self._given], bool)
        self._observed = np.isin(self._body_rows, list(observed))
        given = zip(self._given, self._body_rows, self.measured, strict=True)
        return {
            each.name: np.where(is_measured, transform_points(poses[row], each.on_body)[None], np.nan)
            for each, row, is_measured in given
        }

    def engaged(self, measured: AttachedPoints) -> AttachedPoints:
        """The measured points, NaN of attachments that are released."""
        released = dict(zip(self.names, self._released, strict=True))
        return {name: np.where(released[name], np.nan, points) for name, points in measured.items()}

    @property
    def measured(self) -> tuple[bool, ...]:
        """(A) which are scheduled and observed now."""
        return tuple((self._scheduled & self._observed).tolist())

    @property
    def active(self) -> ActiveAttachments:
        """Those of the present state."""
        active = dict(zip(self.names, (self._scheduled & ~self._released).tolist(), strict=True))
        return ActiveAttachments(active, frozenset(np.array(self.names)[self._observed].tolist()))

    def distances(self, measured: AttachedPoints, poses: Array) -> Array:
        """(A) mean distances [m] of measured points from the equipment at poses (E, 4, 4); NaN where not measured."""
        ends = zip(self._shifted, self._rows, strict=True)
        places = {each.name: transform_points(poses[row], each.on_equipment) for each, row in ends}
        return np.array([np.linalg.norm(places[name] - measured[name][0], axis=1).mean() for name in self.names])

    def are_contradicted(self, distances: Array) -> bool:
        """Whether most of the attachments that should be active are farther apart than the release distance."""
        far = self._scheduled & ~self._released & (distances > self._limits(self._settings.release_distance))
        return 2 * int(far.sum()) > int(np.isfinite(distances).sum())

    def place(self, distances: Array) -> None:
        """The equipment was placed: release what is too far from it."""
        far = self._detected & (distances > self._limits(self._settings.release_distance))
        self._released = np.where(np.isfinite(distances), far, self._released)

    def update(self, distances: Array) -> None:
        """Release what was too far apart for some frames in a row, and engage what is near again."""
        release = self._settings.release_distance
        far = distances > self._limits(np.where(self._released, ENGAGE_SHARE * release, release))
        differs = self._detected & (far != self._released)
        self._against = np.where(np.isfinite(distances), np.where(differs, self._against + 1, 0), self._against)
        changed = np.isfinite(distances) & (self._against >= CONFIRM_FRAMES)
        self._released, self._against = self._released ^ changed, np.where(changed, 0, self._against)

    def _limits(self, distance: Array | float) -> Array:
        limits: Array = distance + _PLAY_SIGMAS * self._play + _LENGTH_SIGMAS * np.linalg.norm(self._unknown, axis=1)
        return limits

    def closed_joints(self, poses: Array, active: ActiveAttachments) -> list[ClosedJoint]:
        """The joints of active attachments, about poses (S, 4, 4) of the coupled body (B eq. 15)."""
        closed = []
        for number in np.flatnonzero([active.active[name] for name in self.names]).tolist():
            joint, kernel = self._joints[number], _KERNEL
            assert joint.sigmas is not None  # set when it was made
            # The unknown lies along the equipment's axes, the gap along those of the joint on the body.
            body_R_joint = poses[self._body_rows[number], :3, :3] @ joint.child_T_joint[:3, :3]
            joint_R_equipment = body_R_joint.T @ poses[self._equipment_rows[number], :3, :3]
            covariance = np.diag(np.square(joint.sigmas))
            covariance[3:, 3:] += joint_R_equipment @ np.diag(self._unknown[number] ** 2) @ joint_R_equipment.T
            if self.names[number] not in active.observed:
                # Unobserved, it was never released, and may start far apart.
                kernel = max(kernel, self._settings.release_distance / float(self._given[number].sigmas.min()))
            closed.append(ClosedJoint(joint, np.linalg.inv(covariance), kernel))
        return closed

    def gaps(self, poses: Array) -> Array:
        """(A) mean distances [m] of the points of each attachment, of poses (S, 4, 4) of the coupled body."""
        ends = zip(self._shifted, poses[self._body_rows], poses[self._equipment_rows], strict=True)
        return np.array([attachment.distances(body, equipment).mean() for attachment, body, equipment in ends])
