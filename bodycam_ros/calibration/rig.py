"""The rig: which camera is strapped to which segment, and which segment hangs on which. All that a user must give.

::

    cameras: {waist_front: pelvis, thigh_left: thigh_left}
    segments: {pelvis: null, thigh_left: pelvis}
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from bodycam_ros.body.checked_fields import Entry, Name, read_entry
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than
from bodycam_ros.files.yaml_file import read_yaml

_MOST_PARTS = 1000  # cameras, segments

NOT_RECORDED = "is not in the recording; switch it on and record again, or remove it from the rig"
"""What is said of a camera of a rig or body that a recording lacks."""


class _RigEntry(Entry):
    cameras: Annotated[dict[Name, Name], msgspec.Meta(max_length=_MOST_PARTS)]
    segments: Annotated[dict[Name, Name | None], msgspec.Meta(max_length=_MOST_PARTS)]


@dataclass(frozen=True)
class Rig:
    """Cameras on segments, and segments in a tree.

    Attributes:
        cameras: camera -> the segment that carries it.
        parents: segment -> the one that it hangs on; None for the root.

    Raises:
        BodyError: the segments make no tree, or one that others hang on carries no camera.
    """

    cameras: Mapping[str, str]
    parents: Mapping[str, str | None]

    def __post_init__(self) -> None:
        if not self.cameras:
            raise BodyError("the rig names no camera; write one line per camera, such as head: head")
        for camera, segment in self.cameras.items():
            if segment not in self.parents:
                raise BodyError(
                    f"its segment {segment} is not among the segments; {other_than(segment, self.parents)}", camera
                )
        for segment, parent in self.parents.items():
            if parent is not None and parent not in self.parents:
                others = other_than(parent, (each for each in self.parents if each != segment))
                raise BodyError(f"segment {segment}: its parent {parent} is not among the segments; {others}")
        roots = [segment for segment, parent in self.parents.items() if parent is None]
        if not roots:
            raise BodyError(
                "every segment has a parent; write null for the parent of one, the root, such as the pelvis"
            )
        if len(roots) > 1:
            raise BodyError(
                f"one segment must be the root, with null as its parent, not {len(roots)}: {', '.join(roots)}"
            )
        for segment in self.parents:
            self._path_to_root(segment)
        if bare := [segment for segment in self.segments if not self.cameras_on(segment)]:
            raise BodyError(
                f"segments {', '.join(bare)} carry no camera, but they are parents of other segments. A joint is "
                "measured by cameras on both of its segments: strap a camera on, or leave out their children"
            )

    @classmethod
    def from_yaml(cls, path: Path | str) -> "Rig":
        """Read a rig file.

        Raises:
            BodyError: the file is missing, not YAML, or describes no rig; the message names the file.
        """
        document = read_yaml(path, "rig file", BodyError)
        try:
            entry: _RigEntry = read_entry(_RigEntry, document, "a rig file")
            return cls(entry.cameras, entry.segments)
        except BodyError as error:
            raise BodyError(f"{path}: {error}") from error

    def missing_cameras(self, present: Collection[str]) -> list[str]:
        """A line for each camera of the rig that is not among those of a recording; nothing else describes it so."""
        return [f"camera {camera}: {NOT_RECORDED}" for camera in self.cameras if camera not in present]

    def strange_cameras(self, present: Collection[str]) -> list[str]:
        """A line for each camera of a recording that may be a missing one of the rig by another name."""
        missing = [camera for camera in self.cameras if camera not in present]
        strange = sorted(camera for camera in present if camera not in self.cameras) if missing else []
        return [
            f"camera {camera}: is not in the rig, where it may have another name: name its files as the rig does"
            for camera in strange
        ]

    @property
    def root(self) -> str:
        """The segment that hangs on no other."""
        return next(segment for segment, parent in self.parents.items() if parent is None)

    @property
    def segments(self) -> tuple[str, ...]:
        """Segments that carry a camera or lead to one, parents first; hands without a camera are left out."""
        leading = {name for segment in self.cameras.values() for name in self._path_to_root(segment)}
        ordered: list[str] = []
        for segment in self.parents:
            ordered += [name for name in reversed(self._path_to_root(segment)) if name in leading - set(ordered)]
        return tuple(ordered)

    def cameras_on(self, segment: str) -> tuple[str, ...]:
        """Names of the cameras on a segment."""
        return tuple(camera for camera, carrier in self.cameras.items() if carrier == segment)

    def _path_to_root(self, segment: str) -> list[str]:
        path = [segment]
        while (parent := self.parents[path[-1]]) is not None:
            if parent in path:
                raise BodyError(f"segments {', '.join(path)} hang on each other in a circle")
            path.append(parent)
        return path
