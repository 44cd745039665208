"""What a constraint row holds, in words: its joint, and the direction in the world that it is nearest to."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_gap import row_axes
from bodycam_ros.mobility.mechanism import Configuration, Mechanism, Rows

_DIRECTIONS = ("forward", "sideways", "up")


def row_names(mechanism: Mechanism, configuration: Configuration, rows: Rows) -> list[str]:
    """A name for each row, such as "binding_left: place, up"."""
    poses, index = mechanism.poses(configuration), mechanism.body.segment_index
    axes = {}
    for joint in mechanism.loops:
        world_R_joint = poses[index[joint.child], :3, :3] @ joint.child_T_joint[:3, :3]
        axes[joint.name] = (row_axes(joint) @ world_R_joint.T, world_R_joint.T)
    for segment in mechanism.stands:
        world_R_segment = poses[index[segment], :3, :3]
        axes[segment] = (world_R_segment.T, world_R_segment.T)
    names = []
    for owner, kind in zip(rows.owners, rows.kinds, strict=True):
        if owner not in axes:
            names.append(f"{owner}: lean, {_DIRECTIONS[kind]}")
            continue
        word = _words(axes[owner][kind // 3])[kind % 3]
        names.append(f"{owner}: turn about {word}" if kind < 3 else f"{owner}: place, {word}")
    return names


def _words(directions: Array) -> list[str]:
    """A different word for each of three directions (3, 3), the nearest on the whole."""
    _, chosen = linear_sum_assignment(-np.abs(directions))
    return [_DIRECTIONS[column] for column in chosen]
