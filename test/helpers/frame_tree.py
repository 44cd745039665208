"""Frames as tf2 keeps them, of what was said on /tf and /tf_static."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from bodycam_ros.geometry import Array, rigid
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.poses import rotation_from_message


class FrameTree:
    """All frames at every instant that was told of.

    Args:
        moving: messages of /tf.
        static: messages of /tf_static.

    Attributes:
        parents: frame -> the one that it hangs on.
        stamps: instants of which something was said, by what hangs on the map.
        told: how often a frame's place was said for one instant: frame and instant -> count.
    """

    def __init__(self, moving: Iterable[Any], static: Iterable[Any]) -> None:
        self.parents: dict[str, str] = {}
        self.stamps: dict[str, list[int]] = {}
        self.told: dict[tuple[str, int], int] = {}
        self._static: dict[str, Array] = {}
        self._moving: dict[tuple[str, int], Array] = {}
        for message in static:
            for transform in message.transforms:
                self._static[self._hang(transform)] = _pose(transform)
        for message in moving:
            for transform in message.transforms:
                at = (self._hang(transform), stamp_ns(transform.header.stamp))
                self._moving[at] = _pose(transform)
                self.told[at] = self.told.get(at, 0) + 1
                if transform.header.frame_id == "map":
                    self.stamps.setdefault(transform.child_frame_id, []).append(at[1])

    def pose(self, frame: str, stamp: int) -> Array:
        """map_T_frame (4, 4) at an instant; a KeyError if the frame is not to be reached from the map."""
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
    said = transform.transform.translation
    return rigid(rotation_from_message(transform.transform.rotation), np.array([said.x, said.y, said.z]))
