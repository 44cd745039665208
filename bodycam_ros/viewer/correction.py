"""Corrections of a body by hand: what was moved, and by how much, is written to the body's file."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from bodycam_ros.body.body_edit import joint_named, move_joint, move_mount
from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.geometry import Array, log_so3

_DECIMALS = 3  # of the millimetres and degrees that are noted

_SMALLEST_MM, _SMALLEST_DEG = 1e-6, 1e-6  # a smaller move is rounding

CORRECTIONS = "corrections"
"""Key of the body's report: what was moved by hand, the oldest first."""


@dataclass(frozen=True)
class Part:
    """Something of the body that can be moved.

    Attributes:
        kind: "camera" for a mount, or "joint".
        name: of the camera or joint.
    """

    kind: Literal["camera", "joint"]
    name: str

    def __str__(self) -> str:
        return f"{self.kind} {self.name}"


@dataclass(frozen=True, eq=False)
class Move:
    """How far a part is from where it was, in the axes of the segment that carries it.

    In the N-pose these are x forward, y left, z up (docs/joints.md).

    Attributes:
        shift_mm: (3,) of its origin [mm].
        turn_deg: (3,) rotation vector [deg].
    """

    shift_mm: Array
    turn_deg: Array

    def __str__(self) -> str:
        return f"{np.linalg.norm(self.shift_mm):.1f} mm, {np.linalg.norm(self.turn_deg):.2f} deg"

    @property
    def is_none(self) -> bool:
        """Whether it stayed where it was."""
        return bool(np.linalg.norm(self.shift_mm) < _SMALLEST_MM and np.linalg.norm(self.turn_deg) < _SMALLEST_DEG)

    @property
    def note(self) -> dict[str, list[float]]:
        """The move as it is noted: to the micrometre and the thousandth of a degree."""
        noted = {"moved_mm": self.shift_mm, "turned_deg": self.turn_deg}
        # Adding zero turns -0.0 into 0.0.
        return {name: (np.round(vector, _DECIMALS) + 0.0).tolist() for name, vector in noted.items()}


@dataclass(frozen=True, eq=False)
class Correction:
    """A body as its file has it, and as it is corrected.

    Attributes:
        original: the body as it was read.
        body: the body as it is now.
    """

    original: BodyModel
    body: BodyModel

    def parts(self) -> tuple[Part, ...]:
        """All that can be moved: cameras, then joints, in the order of the file."""
        cameras = tuple(Part("camera", camera) for camera in self.original.mounts)
        return cameras + tuple(Part("joint", joint.name) for joint in self.original.joints)

    def moved_to(self, part: Part, segment_T_part: Array) -> "Correction":
        """The correction with a part elsewhere.

        Args:
            part: to be moved.
            segment_T_part: (4, 4) its new pose on the segment that carries it [m].

        Raises:
            BodyError: the body has no such part, or the pose is not finite.
        """
        move = move_mount if part.kind == "camera" else move_joint
        return replace(self, body=move(self.body, part.name, segment_T_part))

    def move_of(self, part: Part) -> Move:
        """How far a part is from where the file has it in the N-pose.

        A part that moves with another one has not moved: in the N-pose it is where it was.
        """
        root_T_segment, root_T_was = _in_n_pose(self.original, part)
        _, root_T_now = _in_n_pose(self.body, part)
        segment_R_root = root_T_segment[:3, :3].T
        turn = segment_R_root @ log_so3(root_T_now[:3, :3] @ root_T_was[:3, :3].T)
        return Move(segment_R_root @ (root_T_now[:3, 3] - root_T_was[:3, 3]) * 1e3, np.degrees(turn))

    def moves(self) -> Iterator[tuple[Part, Move]]:
        """Every part that is not where the file has it."""
        for part in self.parts():
            move = self.move_of(part)
            if not move.is_none:
                yield part, move


def place_of(body: BodyModel, part: Part) -> tuple[str, Array]:
    """The segment that carries a part, and its pose (4, 4) on it [m].

    Raises:
        BodyError: the body has no such part.
    """
    if part.kind == "joint":
        joint = joint_named(body, part.name)
        return joint.parent, joint.parent_T_joint
    if part.name not in body.mounts:
        raise BodyError(f"no camera {part.name} on this body; {other_than(part.name, body.mounts)}")
    return body.mounts[part.name].segment, body.mounts[part.name].segment_T_camera


def can_turn(body: BodyModel, part: Part | None) -> bool:
    """Whether a part can be turned.

    Turning a ball joint would only change the zero of its angles.
    """
    return part is not None and (part.kind == "camera" or joint_named(body, part.name).type == "hinge")


def _in_n_pose(body: BodyModel, part: Part) -> tuple[Array, Array]:
    """root_T_segment of the segment that carries a part, and root_T_part, (4, 4) both, of a body in its N-pose."""
    segment, segment_T_part = place_of(body, part)
    root_T_segment: Array = body.n_pose(np.eye(4))[body.segment_index[segment]]
    return root_T_segment, root_T_segment @ segment_T_part


class BodyFile:
    """The file of a body that is being corrected.

    Attributes:
        path: of the file.
        original_path: where the first write keeps the file as it was.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.original_path = path.with_name(f"{path.name}.orig")
        self._read = b""
        self._segments: tuple[str, ...] = ()

    def read(self) -> BodyModel:
        """The body.

        Raises:
            BodyError: the file is missing, not YAML, or describes no body.
        """
        body = read_body(self.path)
        self._read, self._segments = self._content(), body.segments
        return body

    def write(self, correction: Correction) -> BodyModel:
        """Write the corrected body, whole or not at all; return it with its report, which notes what was moved.

        Segments that were added to it since it was read, as hands, are shown but not written.
        The first write keeps the file as it was beside it; a file kept before is never replaced.

        Raises:
            BodyError: another program changed the file since.
            OutputError: it cannot be written.
        """
        if self._content() != self._read:
            raise BodyError(
                f"{self.path}: changed since it was read, so it is not replaced; keep your corrections by copying the "
                "file elsewhere first, or start 'bodycam view' again on the new one"
            )
        body, notes = correction.body, [{part.kind: part.name} | move.note for part, move in correction.moves()]
        before = body.report.get(CORRECTIONS, [])
        noted = [*(before if isinstance(before, list) else [before]), *notes]
        body = replace(body, report={**body.report, CORRECTIONS: noted})
        kept_before = self.original_path.exists()
        if not kept_before:
            write_whole(self.original_path, self._read)
        try:
            joints = tuple(joint for joint in body.joints if joint.child in self._segments)
            write_body(replace(body, segments=self._segments, joints=joints), self.path)
        except BaseException:
            if not kept_before:
                self.original_path.unlink(missing_ok=True)
            raise
        self._read = self._content()
        return body

    def _content(self) -> bytes:
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise BodyError(f"{self.path}: cannot read this body file: {error}") from error
