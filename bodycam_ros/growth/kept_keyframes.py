"""The keyframes that later ones are matched with."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.worn_keyframe import WornKeyframe


@dataclass(frozen=True)
class KeptKeyframe:
    """A keyframe and what it turned out to show.

    Attributes:
        keyframe: what it saw.
        at_ns: when, by the time that all cameras share [ns].
        points: (N,) number of the point that each of its features shows, negative if none.
    """

    keyframe: WornKeyframe
    at_ns: int
    points: NDArray[np.int64]


class KeptKeyframes:
    """The latest keyframes of all cameras.

    Args:
        settings: how many, and who is matched with whom.
    """

    def __init__(self, settings: GrowthSettings) -> None:
        self._settings = settings
        self._kept: deque[KeptKeyframe] = deque()

    def __len__(self) -> int:
        return len(self._kept)

    def clear(self) -> None:
        """None is left."""
        self._kept.clear()

    def add(self, kept: KeptKeyframe) -> KeptKeyframe | None:
        """One more; the oldest, if it has to go for it."""
        gone = self._kept.popleft() if len(self._kept) == self._settings.keyframes else None
        self._kept.append(kept)
        return gone

    def partners(self, keyframe: WornKeyframe) -> list[KeptKeyframe]:
        """Those that most likely see the same as another, from another place (A 4.1)."""
        if not self._kept:
            return []
        poses = np.array([kept.keyframe.world_T_camera for kept in self._kept])
        cosines = poses[:, :3, 2] @ keyframe.world_T_camera[:3, 2]
        baselines = np.linalg.norm(poses[:, :3, 3] - keyframe.world_T_camera[:3, 3], axis=1)
        fit = (cosines > np.cos(np.radians(self._settings.max_axis_angle))) & (baselines > self._settings.min_baseline)
        likely = np.flatnonzero(fit)
        order = np.argsort(baselines[likely] - cosines[likely], kind="stable")[: self._settings.partners]
        return [self._kept[row] for row in likely[order].tolist()]
