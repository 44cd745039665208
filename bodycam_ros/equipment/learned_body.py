"""A body with equipment whose joints are where they were found to be: what is published fits the motion."""

from collections.abc import Sequence
from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array


def learned_body(body: BodyModel, lengths: Sequence[str], values: Array) -> BodyModel:
    """The body with joints of its equipment moved to where they were found to be.

    Args:
        body: coupled.
        lengths: (L) ``<attachment or joint>_<x, y or z>``; an attachment is no part of the tree, and stays.
        values: (L) of them [m].
    """
    places = {joint.name: joint.parent_T_joint.copy() for joint in body.tree_joints}
    for length, value in zip(lengths, values.tolist(), strict=True):
        name, _, axis = length.rpartition("_")
        if name in places:
            places[name]["xyz".index(axis), 3] = value
    joints = [replace(j, parent_T_joint=places[j.name]) if j.name in places else j for j in body.joints]
    return replace(body, joints=tuple(joints)) if lengths else body
