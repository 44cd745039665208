"""The body as programs for animation have it: bones that are not turned in a rest pose, and their turns since.

One bone a segment, named and scaled as asked for, in the program's axes. In the rest pose the body faces where such
programs want it (``axes.FACING_FORWARD``); in the motion it is where it was in the world.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bodycam_ros.errors import BodyError
from bodycam_ros.formats.axes import FACING_FORWARD, UP_AXES, turned
from bodycam_ros.formats.bone_names import bone_names
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.rest_pose import rest_pose
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.formats.tips import bone_tip
from bodycam_ros.geometry import Array, rigid

_MOST_LEVELS = 200  # of bones on each other: programs go down them by recursion


@dataclass(frozen=True, eq=False)
class Figure:
    """N bones, each after the one that it hangs on, over T instants; lengths in units of the file.

    Attributes:
        segments: (N) that the bones stand for.
        names: (N) of the bones.
        parents: (N) rows of the bones that they hang on; -1 of the root, which is the first.
        rest: (N, 4, 4) poses of the segments in the rest pose, the root at the origin, in the program's axes.
        tips: row of each bone without children -> (3,) its end, from its start in the rest pose.
        places: (T, N, 3) where the bones start.
        turns: (T, N, 3, 3) how each is turned since the rest pose, about the program's axes.
    """

    segments: tuple[str, ...]
    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest: Array
    tips: dict[int, Array]
    places: Array
    turns: Array

    @classmethod
    def of(cls, motion: SampledMotion, options: MotionOptions, up: str) -> "Figure":
        """The figure of a motion, in axes of which one is up unless the options say otherwise.

        Raises:
            BodyError: two bones would have the same name, or a chain of them is too long.
        """
        body, segments = motion.body, motion.people
        program_R_world, scale = UP_AXES[options.up or up], options.scale or 1.0
        rows = [body.segment_index[segment] for segment in segments]
        parents = tuple(segments.index(motion.parents[s]) if s in motion.parents else -1 for s in segments)
        world_T_rest = rigid(FACING_FORWARD, np.zeros(3)) @ rest_pose(body, options.pose or "N")[rows]
        moved = motion.world_T_segment[:, rows]
        since_rest = moved[..., :3, :3] @ np.swapaxes(world_T_rest[:, :3, :3], -1, -2)
        rest = rigid(program_R_world @ world_T_rest[:, :3, :3], scale * world_T_rest[:, :3, 3] @ program_R_world.T)
        _check_levels(segments, parents)
        leaves = {row: bone_tip(body, s) for row, s in enumerate(segments) if row not in parents}
        return cls(
            segments=segments,
            names=bone_names(segments, options.names),
            parents=parents,
            rest=rest,
            tips={row: scale * rest[row, :3, :3] @ tip for row, tip in leaves.items()},
            places=scale * moved[..., :3, 3] @ program_R_world.T,
            turns=turned(program_R_world, since_rest),
        )

    @cached_property
    def offsets(self) -> Array:
        """(N, 3) start of each bone from its parent's, in the rest pose; of the root its own place there."""
        starts = self.rest[:, :3, 3]
        offsets: Array = starts - np.where(np.array(self.parents)[:, None] < 0, 0.0, starts[list(self.parents)])
        return offsets

    @cached_property
    def local_turns(self) -> Array:
        """(T, N, 3, 3) how each bone is turned against its parent."""
        local: Array = self.turns.copy()
        held = np.flatnonzero(np.array(self.parents) >= 0)
        above = self.turns[:, [self.parents[row] for row in held]]
        local[:, held] = np.swapaxes(above, -1, -2) @ self.turns[:, held]
        return local

    def ends_of(self, row: int) -> list[Array]:
        """(3,) ends of a bone from its start, in the rest pose: its children's starts, or its tip."""
        children = [child for child, parent in enumerate(self.parents) if parent == row]
        return [self.offsets[child] for child in children] or [self.tips[row]]


def _check_levels(segments: tuple[str, ...], parents: tuple[int, ...]) -> None:
    levels: list[int] = []
    for segment, parent in zip(segments, parents, strict=True):
        levels.append(1 if parent < 0 else levels[parent] + 1)
        if levels[-1] > _MOST_LEVELS:
            raise BodyError(f"segment {segment}: a chain of more than {_MOST_LEVELS} segments is not written as bones")
