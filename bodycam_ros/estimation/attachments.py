"""Attachments of a body to its equipment: which are active, and the joints that close its loops (B 3.2, B eq. 15).

An attachment is active within its intervals, while the cameras do not contradict it: points that are measured farther
apart than they can be release it, points that come near again engage it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.geometry import Array
from bodycam_ros.settings import setting

_KERNEL = 4.0  # sigmas from which on an attachment counts less: one that was let go must not bend a limb
CONFIRM_FRAMES = 3  # in a row release an attachment, or engage it; a wrong registration is shorter


@dataclass(frozen=True)
class CouplingSettings:
    """When attachments are active."""

    release_distance: float = setting(
        0.05,
        unit="m",
        limits=(0.001, 1.0),
        reason="attachments whose points are measured farther apart are released; raise it where the body errs more",
    )


class ActiveAttachments(NamedTuple):
    """Attachments of one state.

    Attributes:
        engaged: (A) whether they are active.
        driving: (A) active ones whose segment of the body is observed.
    """

    engaged: NDArray[np.bool_]
    driving: NDArray[np.bool_]


class Attachments:
    """All (A) attachments of a body to its equipment.

    Args:
        body: with the equipment and its lengths.
        equipment: its attachments.
        settings: when attachments are active.

    Attributes:
        names: (A) of them.
        measured: (A) which are scheduled and observed now.
    """

    def __init__(self, body: BodyModel, equipment: Equipment, settings: CouplingSettings) -> None:
        self._release_m, self._given = settings.release_distance, equipment.attachments
        self.names = tuple(each.name for each in self._given)
        closing = {joint.name: joint for joint in body.loop_joints}
        joints = [closing[name] for name in self.names]
        self._body_rows, self._equipment_rows = (
            np.array([body.segment_index[segment] for segment in segments], np.int64)
            for segments in ([j.child for j in joints], [j.parent for j in joints])
        )
        self._detected = np.array([each.detected for each in self._given], bool)
        self._least_sigma = np.array([each.sigmas.min() for each in self._given])
        self._scheduled, self._observed, self._released = (np.zeros(len(self._given), bool) for _ in range(3))
        self._against = np.zeros(len(self._given), int)

    def observe(self, seconds: float, observed: NDArray[np.bool_]) -> None:
        """Set the time since the first image [s], and the observed segments (S,)."""
        self._scheduled = np.array([each.holds_at(seconds) for each in self._given], bool)
        self._observed = observed[self._body_rows]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(A) which are scheduled and observed now."""
        measured: NDArray[np.bool_] = self._scheduled & self._observed
        return measured

    @property
    def _engaged(self) -> NDArray[np.bool_]:
        engaged: NDArray[np.bool_] = self._scheduled & ~self._released
        return engaged

    @property
    def active(self) -> ActiveAttachments:
        """Active attachments of the present state."""
        return ActiveAttachments(self._engaged, self._engaged & self._observed)

    def gaps(self, poses: Array) -> Array:
        """(A) mean distances [m] of the points of each attachment, of poses (S, 4, 4)."""
        ends = zip(self._given, poses[self._body_rows], poses[self._equipment_rows], strict=True)
        return np.array([attachment.distances(body, equipment).mean() for attachment, body, equipment in ends])

    def are_contradicted(self, gaps: Array) -> bool:
        """Whether most of the attachments that should be active are farther apart than the release distance."""
        far = self._engaged & (gaps > self._release_m)
        return 2 * int((far & self.measured).sum()) > int(self.measured.sum())

    def place(self, gaps: Array) -> None:
        """The equipment was placed: release what is too far from it."""
        far = self._detected & (gaps > self._release_m)
        self._released = np.where(self.measured, far, self._released)

    def update(self, gaps: Array) -> None:
        """Release what was too far apart for some frames in a row, and engage what is near again."""
        differs = self._detected & ((gaps > self._release_m) != self._released)
        self._against = np.where(self.measured, np.where(differs, self._against + 1, 0), self._against)
        changed = self.measured & (self._against >= CONFIRM_FRAMES)
        self._released, self._against = self._released ^ changed, np.where(changed, 0, self._against)

    @property
    def closed(self) -> dict[str, float]:
        """Active attachment -> sigmas from which on its joint counts less (B eq. 15)."""
        # Unobserved, it was never released, and may start far apart.
        far = np.where(self._observed, 0.0, self._release_m / self._least_sigma)
        return {self.names[row]: max(_KERNEL, float(far[row])) for row in np.flatnonzero(self._engaged)}
