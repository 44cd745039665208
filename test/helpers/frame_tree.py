"""Frames as tf2 keeps them, from messages on /tf and /tf_static."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from bodycam_ros.geometry import Array, rigid
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.poses import rotation_from_message


class FrameTree:
    """All frames at every stamp that was published.

    Args:
        moving: messages of /tf.
        static: messages of /tf_static.

    Attributes:
        parents: frame -> the one that it hangs on.
        stamps: of the transforms whose parent is the map.
        counts: frame and stamp -> how often its transform was published.
    """

    def __init__(self, moving: Iterable[Any], static: Iterable[Any]) -> None:
        self.parents: dict[str, str] = {}
        self.stamps: dict[str, list[int]] = {}
        self.counts: dict[tuple[str, int], int] = {}
        self._static: dict[str, Array] = {}
        self._moving: dict[tuple[str, int], Array] = {}
        for message in static:
            for transform in message.transforms:
                self._static[self._hang(transform)] = _pose(transform)
        for message in moving:
            for transform in message.transforms:
                at = (self._hang(transform), stamp_ns(transform.header.stamp))
                self._moving[at] = _pose(transform)
                self.counts[at] = self.counts.get(at, 0) + 1
                if transform.header.frame_id == "map":
                    self.stamps.setdefault(transform.child_frame_id, []).append(at[1])

    def pose(self, frame: str, stamp: int) -> Array:
        """map_T_frame (4, 4) at a stamp; a KeyError if no chain of transforms leads from the map to the frame."""
        if frame == "map":
            return np.eye(4)
        static = self._static.get(frame)
        parent_T_frame = self._moving[frame, stamp] if static is None else static
        return self.pose(self.parents[frame], stamp) @ parent_T_frame

    def _hang(self, transform: Any) -> str:
        child, parent = str(transform.child_frame_id), str(transform.header.frame_id)
        assert self.parents.setdefault(child, parent) == parent, f"{child} hangs on {parent}, {self.parents[child]}"
        return child


def _pose(transform: Any) -> Array:
    place = transform.transform.translation
    return rigid(rotation_from_message(transform.transform.rotation), np.array([place.x, place.y, place.z]))
