"""How a motion is moved into an environment: its speed is added, and what touches the ground is put onto it."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.environment.environment import Environment
from bodycam_ros.environment.scenery import Scenery
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid

_UP = np.array([0.0, 0.0, 1.0])
_LEAST_WAY_M = 0.5
_ON_GROUND = 0.1  # quantile of the lowest points that is on the ground of an environment
_CONTACT_M, _OFF_GROUND_M = 0.03, 0.15  # heights of what is put onto it, and of what is left where it was


@dataclass(frozen=True, eq=False)
class Route:
    """Where the motion goes in an environment.

    Attributes:
        environment: road or slope.
        start: (3,) [m].
        heading: (3,) unit, level.
        ground_m: height of the ground.
    """

    environment: Environment
    start: Array
    heading: Array
    ground_m: float = 0.0

    @property
    def up(self) -> Array:
        """(3,) unit vector against gravity."""
        return self.environment.up(self.heading)

    @property
    def world_T_route(self) -> Array:
        """Pose (4, 4) of the environment: its origin on the ground where the motion starts, x where it goes [m]."""
        axes = np.stack([self.heading, np.cross(_UP, self.heading), _UP], axis=1)
        return rigid(axes, np.append(self.start[:2], self.ground_m))

    @property
    def upright_T_world(self) -> Array:
        """Pose (4, 4) of the world in the environment, whose z is against gravity: x of a slope goes down [m]."""
        tilt = exp_so3(np.array([0.0, self.environment.angle, 0.0]))
        return rigid(tilt, np.zeros(3)) @ inverse(self.world_T_route)

    @property
    def scenery(self) -> Scenery | None:
        """Meshes of the environment, in the world."""
        scenery = self.environment.scenery
        return None if scenery is None else scenery.placed(self.world_T_route)


@dataclass(frozen=True, eq=False)
class Placement:
    """A motion on the ground of an environment.

    Attributes:
        ground_m: height of the ground.
        travelled: (F,) by the speed of the environment [m].
        moved: (F, 3) how far the person and equipment are moved [m].
    """

    ground_m: float
    travelled: Array
    moved: Array


def placement(environment: Environment, seconds: Array, lowest: Array, heading: Array) -> Placement:
    """Add the speed of an environment, and put what is near the ground onto it.

    Heights of up to 3 cm over the ground are taken for contact: a board on its edge, or what was not measured.

    Args:
        environment: that the motion is moved into.
        seconds: (F,) since the first frame.
        lowest: (F,) height of the lowest point of person and equipment [m].
        heading: (3,) unit, level: where the motion goes.
    """
    ground_m = float(np.quantile(lowest, _ON_GROUND))
    above = lowest - ground_m
    share = np.clip((_OFF_GROUND_M - np.abs(above)) / (_OFF_GROUND_M - _CONTACT_M), 0.0, 1.0)
    travelled = environment.speed * seconds
    return Placement(ground_m, travelled, travelled[:, None] * heading - (share * above)[:, None] * _UP)


def heading_of(body: BodyModel, world_T_segment: Array) -> Array:
    """(3,) unit, level: where equipment that rides points; else where the person goes, or faces where they stay.

    Args:
        body: with its equipment.
        world_T_segment: (F, S, 4, 4) [m].
    """
    riding = [name for name in ("frame", "board") if name in body.equipment_segments]
    roots = world_T_segment[:, body.segment_index[body.root]]
    way = roots[-1, :3, 3] - roots[0, :3, 3]
    if riding:
        way = world_T_segment[:, body.segment_index[riding[0]], :3, 0].mean(axis=0)
    elif np.linalg.norm(way[:2]) < _LEAST_WAY_M:
        way = roots[:, :3, 0].mean(axis=0)
    level: Array = way * [1.0, 1.0, 0.0]
    return level / np.linalg.norm(level)


def rolled(body: BodyModel, world_T_segment: Array, travelled: Array) -> Array:
    """(F,) how far wheels have rolled [m]: as far as the environment's speed carries them, and a bicycle rides itself.

    Args:
        body: with its equipment.
        world_T_segment: (F, S, 4, 4) before it was moved [m].
        travelled: (F,) by the speed of the environment [m].
    """
    if "frame" not in body.equipment_segments:
        return travelled
    frame = world_T_segment[:, body.segment_index["frame"]]
    if np.linalg.norm(frame[-1, :3, 3] - frame[0, :3, 3]) < _LEAST_WAY_M:  # on a roller
        return travelled
    steps = np.sum(np.diff(frame[:, :3, 3], axis=0) * frame[:-1, :3, 0], axis=1)
    forward: Array = travelled + np.concatenate([[0.0], np.cumsum(steps)])
    return forward
