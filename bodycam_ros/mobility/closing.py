"""Closing the loops from the N-pose: the equipment comes to the body first, then the body to the equipment.

Several starts, robust by graduated non-convexity (Yang et al. 2020): an attachment that cannot be held is let go rather
than met half-way.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from bodycam_ros.geometry import exp_so3
from bodycam_ros.mobility.angle_limits import AngleLimits
from bodycam_ros.mobility.descent import Descent
from bodycam_ros.mobility.mechanism import Configuration, Mechanism
from bodycam_ros.mobility.open_loops import CLOSED_SIGMAS, open_loops, strains

_ANNEALING = 0.2
_STEPS, _STEPS_TO_THE_END = 6, 60
_QUARTERS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)
_KEPT_STARTS = 2
_BENT = 0.6  # of the way to the middle of its limits: a straight knee does not know which way to bend


def placed(mechanism: Mechanism) -> list[Configuration]:
    """The N-pose, a little bent, with the equipment where the attachments want it: the best of several starts."""
    resting = mechanism.resting()
    bent = AngleLimits(mechanism.body).middle(resting.joint_motion, _BENT)
    start = replace(resting, joint_motion=bent)
    if mechanism.equipment is None:
        return [start]
    own = [mechanism.equipment.name, *(joint.name for joint in mechanism.equipment.joints)]
    descent = Descent(mechanism, mechanism.columns("place", "joint", names=own))
    found = [descent.run(first, 2 * _STEPS) for first in _starts(mechanism, start)]
    found.sort(key=lambda pair: pair[1])
    return [configuration for configuration, _ in found[:_KEPT_STARTS]]


def closed(mechanism: Mechanism, starts: list[Configuration], without: Collection[str] = ()) -> Configuration:
    """The configuration that closes the most loops, from the best of some starts.

    Args:
        mechanism: body and equipment.
        starts: near enough, such as ``placed`` gives.
        without: loops that are left open.
    """
    descent = Descent(mechanism, np.arange(mechanism.column_count), without=without)
    together = [descent.run(start, _STEPS_TO_THE_END) for start in starts]
    # A person sits on a bicycle in the posture that bends the least.
    together.sort(key=lambda pair: pair[1])
    if set(open_loops(mechanism, together[0][0])) <= set(without):
        return together[0][0]
    each = [_annealed(mechanism, descent, start) for start in (starts[0], together[0][0])]
    return min(each, key=lambda found: len(set(open_loops(mechanism, found)) - set(without)))


def closes(mechanism: Mechanism, start: Configuration, without: Collection[str]) -> Configuration | None:
    """The configuration near another that closes all loops but some; None if there is none."""
    descent = Descent(mechanism, np.arange(mechanism.column_count), without=without)
    configuration, _ = descent.run(start, _STEPS_TO_THE_END)
    return configuration if set(open_loops(mechanism, configuration)) <= set(without) else None


def nearest(mechanism: Mechanism, start: Configuration, weak: Collection[str]) -> Configuration:
    """The configuration that brings some loops as near to closed as the others, which hold, permit."""
    return Descent(mechanism, np.arange(mechanism.column_count), weak=weak).run(start, _STEPS_TO_THE_END)[0]


def _annealed(mechanism: Mechanism, descent: Descent, start: Configuration) -> Configuration:
    configuration, kernel = start, max(strains(mechanism, start).values(), default=0.0)
    while kernel > CLOSED_SIGMAS:
        configuration, _ = descent.run(configuration, _STEPS, kernel)
        kernel *= _ANNEALING
    return descent.run(configuration, _STEPS_TO_THE_END, CLOSED_SIGMAS)[0]


def _starts(mechanism: Mechanism, start: Configuration) -> Iterator[Configuration]:
    """The equipment facing each way, its hinges a quarter of a turn on each time."""
    equipment = mechanism.equipment
    assert equipment is not None
    hinges = [joint.name for joint in equipment.joints if joint.type == "hinge"]
    for heading, turn in product(_QUARTERS, _QUARTERS if hinges else (0.0,)):
        motion = start.joint_motion.copy()
        for row, joint in enumerate(mechanism.body.tree_joints):
            if joint.name == equipment.name:
                motion[row, :3, :3] = exp_so3(np.array([0.0, 0.0, heading]))
            elif joint.name in hinges:
                motion[row, :3, :3] = joint.hinge_rotation(np.array(turn))
        yield replace(start, joint_motion=motion)
