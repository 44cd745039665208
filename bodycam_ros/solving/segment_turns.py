"""How the segments turned between images of their own cameras (A eq. 2), and from which instant on."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_window import Instant
from bodycam_ros.solving.camera_evidence import EvidenceSettings, SegmentTurn, rotation_evidence


@dataclass(frozen=True)
class TurnSince:
    """A turn, and the instant that it began at; ``row`` is the segment's."""

    since: Instant
    row: int
    turn: SegmentTurn


def turns_of_unseen(
    body: BodyModel,
    frame: BodyFrame,
    instants: Collection[Instant],
    seen: Collection[str],
    settings: EvidenceSettings,
) -> Iterator[TurnSince]:
    """Turns of the segments that are not seen now, or were not at the latest of the instants before."""
    latest = next(reversed(list(instants)), None)
    for camera, matches in frame.matches.items():
        mount = body.mounts.get(camera)
        if mount is None or latest is None:
            continue
        row = body.segment_index[mount.segment]
        if mount.segment in seen and latest.observed[row]:
            continue
        # By the camera's own stamps: those of other cameras may be off by some milliseconds.
        since = next((i for i in instants if i.camera_stamps_ns.get(camera) == matches.previous_stamp_ns), None)
        turn = rotation_evidence(matches, mount, settings)
        if since and turn:
            yield TurnSince(since, row, turn)
