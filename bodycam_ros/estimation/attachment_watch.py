"""Which attachments hold: as the file says, and as cameras bear out (B 3.2's constraints, switched on and off)."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths
from bodycam_ros.estimation.coupling_settings import CouplingSettings
from bodycam_ros.estimation.equipment_fit import HeldPoints
from bodycam_ros.geometry import transform_points

Array = NDArray[np.float64]

CONFIRM_FRAMES = 3
"""So many instants in a row let an attachment go, or take hold of it; a wrong registration is shorter."""

_LENGTH_SIGMAS = 3.0

_NEAR_M = 0.005
"""A prediction this near to what is seen is as good a start as any."""
_PLAY_SIGMAS = 2.0


@dataclass(frozen=True)
class Holding:
    """What holds at one instant.

    Attributes:
        engaged: attachment -> whether it holds.
        seen: attachments whose segment of the body is seen.
    """

    engaged: Mapping[str, bool]
    seen: frozenset[str]

    def drives(self, attachments: frozenset[str]) -> bool:
        """Whether any of some attachments is seen to hold."""
        return any(self.engaged[name] and name in self.seen for name in attachments)


@dataclass
class _Watched:
    """An attachment and what became of it.

    Attributes:
        attachment: as it is said to be.
        row: of its segment in the body.
        said: whether it is said to hold now.
        seen: whether a camera sees its segment of the body now.
        let_go: whether cameras contradict it.
        against: instants in a row that spoke for the opposite of ``let_go``.
    """

    attachment: Attachment
    row: int
    said: bool = True
    seen: bool = False
    let_go: bool = False
    against: int = 0

    @property
    def holds(self) -> bool:
        return self.said and not self.let_go


class AttachmentWatch:
    """Watches the attachments of a body to its equipment.

    Args:
        body: with the equipment.
        equipment: its attachments.
        lengths: what is unknown of it.
        settings: how far is too far.
    """

    def __init__(
        self, body: BodyModel, equipment: Equipment, lengths: UnknownLengths, settings: CouplingSettings
    ) -> None:
        self._settings, self._lengths = settings, lengths
        self._row = {name: row for row, name in enumerate(equipment.segments)}
        self._watched = {a.name: _Watched(a, body.segment_index[a.body_segment]) for a in equipment.attachments}

    def look(self, seconds: float, poses: Array, seen: Collection[int]) -> HeldPoints:
        """What is seen of an instant, whether it holds or not.

        Args:
            seconds: since the recording's first image.
            poses: (S, 4, 4) of the body.
            seen: rows of the segments that a camera sees.
        """
        points, holds = {}, {}
        for name, w in self._watched.items():
            w.said, w.seen = w.attachment.holds_at(seconds), w.row in seen
            points[name] = transform_points(poses[w.row], w.attachment.on_body)[None]
            holds[name] = np.array([w.said and w.seen])
        return HeldPoints(points, holds)

    def held(self, looked: HeldPoints) -> HeldPoints:
        """What is seen, of the attachments that hold."""
        holds = {name: seen & (not self._watched[name].let_go) for name, seen in looked.holds.items()}
        return HeldPoints(looked.points, holds)

    @property
    def seen(self) -> frozenset[str]:
        """Attachments that are said to hold, and whose segment of the body is seen now."""
        return frozenset(name for name, w in self._watched.items() if w.said and w.seen)

    def said(self, seconds: float, observed: NDArray[np.bool_]) -> Holding:
        """What holds by the file alone, seconds after the first image, and whose segments are observed (S,)."""
        engaged = {name: w.attachment.holds_at(seconds) for name, w in self._watched.items()}
        return Holding(engaged, frozenset(name for name, w in self._watched.items() if observed[w.row]))

    @property
    def holding(self) -> Holding:
        """What holds now."""
        seen = frozenset(name for name, w in self._watched.items() if w.seen)
        return Holding({name: w.holds for name, w in self._watched.items()}, seen)

    def distances(self, looked: HeldPoints, poses: Array, shifts: Array) -> dict[str, float]:
        """Attachment -> mean distance of its points [m], of those that are seen.

        Args:
            looked: what is seen.
            poses: (E, 4, 4) of the equipment's segments.
            shifts: (L) its lengths [m].
        """
        distances = {}
        for name, w in self._watched.items():
            if looked.holds[name][0]:
                pose = poses[self._row[w.attachment.equipment_segment]]
                on_equipment = self._lengths.attachment(w.attachment, shifts).on_equipment
                apart = transform_points(pose, on_equipment) - looked.points[name][0]
                distances[name] = float(np.linalg.norm(apart, axis=1).mean())
        return distances

    def begin(self, distances: Mapping[str, float], length_sigmas: Array) -> None:
        """The equipment was placed: what is too far from it is not held, as it seems."""
        release = self._settings.release_distance
        for name, distance in distances.items():
            w = self._watched[name]
            w.let_go = w.attachment.detected and distance > self.limit(name, release, length_sigmas)

    def astray(self, distances: Mapping[str, float], length_sigmas: Array) -> bool:
        """Whether any attachment is seen farther apart than it may well be, so that a fit would say more."""
        return any(
            distance
            > self.limit(name, max(_NEAR_M, float(self._watched[name].attachment.sigmas.mean())), length_sigmas)
            for name, distance in distances.items()
        )

    def surprised(self, distances: Mapping[str, float], length_sigmas: Array) -> bool:
        """Whether an attachment that may be let go, and should hold, is seen too far away."""
        may_go = {name: d for name, d in distances.items() if self._watched[name].attachment.detected}
        return self.contradicted(may_go, length_sigmas) > 0

    def contradicted(self, distances: Mapping[str, float], length_sigmas: Array) -> int:
        """How many of the attachments that should hold are seen too far away."""
        release = self._settings.release_distance
        return sum(
            self._watched[name].holds and distance > self.limit(name, release, length_sigmas)
            for name, distance in distances.items()
        )

    def notice(self, distances: Mapping[str, float], length_sigmas: Array) -> None:
        """Let go what is seen too far away for some instants, and take hold again of what is near."""
        for name, distance in distances.items():
            w = self._watched[name]
            allowed = self._settings.engage_distance if w.let_go else self._settings.release_distance
            is_far = distance > self.limit(name, allowed, length_sigmas)
            w.against = w.against + 1 if is_far != w.let_go and w.attachment.detected else 0
            if w.against >= CONFIRM_FRAMES:
                w.let_go, w.against = is_far, 0

    def limit(self, name: str, distance: float, length_sigmas: Array) -> float:
        """A distance [m], the play that its points have by their weights, and how little is known of where it is."""
        play = np.sqrt(np.mean(self._watched[name].attachment.sigmas ** 2))
        unknown = np.linalg.norm(self._lengths.along_axes(name, length_sigmas))
        return distance + _PLAY_SIGMAS * float(play) + _LENGTH_SIGMAS * float(unknown)
