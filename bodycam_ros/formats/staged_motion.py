"""A motion in a place that was not there, for files: ``bodycam export --to glb --environment road --travel 6``."""

from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.body.skin import SkinnedSurface, skinned_body
from bodycam_ros.body.surface_folder import read_surfaces
from bodycam_ros.environment.environment import Environment
from bodycam_ros.environment.ground_mesh import ColouredMesh, ground_meshes
from bodycam_ros.environment.machines import Part, machine_parts
from bodycam_ros.environment.placement import Route, heading_of, placement, rolled
from bodycam_ros.environment.scenery import Scenery
from bodycam_ros.errors import SettingsError
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class StagedMotion:
    """A motion with its equipment, and what is around it.

    Attributes:
        motion: of an environment in its frame: the origin on the ground where the motion starts, x where it goes, z
            against gravity; else in the world.
        parts: of the equipment.
        rolled: (T,) how far wheels have rolled [m].
        ground: of a road or slope.
        scenery: of another program.
    """

    motion: SampledMotion
    parts: tuple[Part, ...]
    rolled: Array
    ground: tuple[ColouredMesh, ...] = ()
    scenery: Scenery | None = None


def staged_motion(motion: SampledMotion, options: MotionOptions) -> StagedMotion:
    """The motion where the options have it.

    Raises:
        SettingsError: a speed is given without an environment.
        ViewError: the environment is unknown, or cannot be read.
        BodyError: no segment of the body has a length, so nothing shows what is on the ground.
    """
    if options.environment is None and options.travel is not None:
        raise SettingsError("--travel has no effect without --environment; say where it goes: road, slope:30, FILE.glb")
    body = motion.body
    known = motion.equipment
    lengths = {} if known is None else dict(zip(known.lengths, known.values.tolist(), strict=True))
    parts = machine_parts(body, lengths) if body.equipment_segments and motion.equipment_known.any() else ()
    still = np.zeros(len(motion.stamps_ns))
    if options.environment is None:
        return StagedMotion(motion, parts, rolled(body, motion.world_T_segment, still))
    environment = Environment.parse(options.environment, options.travel or 0.0)
    heading = heading_of(body, motion.world_T_segment)
    scanned = None if options.surface is None else read_surfaces(options.surface, body)
    boxes = _boxes(motion, skinned_body(body, scanned), parts)
    placed = placement(environment, motion.seconds, boxes[:, 0, 2], heading)
    start = (boxes[0] + placed.moved[0]).mean(axis=0)
    route = Route(environment, start, heading, placed.ground_m)
    moved = motion.world_T_root.copy()
    moved[:, :3, 3] += placed.moved
    upright = replace(motion, world_T_root=route.upright_T_world @ moved)
    along = (boxes.mean(axis=1) + placed.moved - start) @ heading
    return StagedMotion(
        motion=upright,
        parts=parts,
        rolled=rolled(body, motion.world_T_segment, placed.travelled),
        ground=ground_meshes(environment, float(along.min()), float(along.max())),
        scenery=environment.scenery,
    )


def _boxes(motion: SampledMotion, skin: SkinnedSurface, parts: tuple[Part, ...]) -> Array:
    """(T, 2, 3) corners of a box around the person and the equipment, where its pose is known [m]."""
    rows = motion.body.segment_index
    boxes = np.empty((len(motion.stamps_ns), 2, 3))
    for row, (poses, is_placed) in enumerate(zip(motion.world_T_segment, motion.equipment_known, strict=True)):
        seen = [skin.posed(poses)]
        if is_placed:
            seen += [part.placed(poses[rows[part.segment]], 0.0) for part in parts]
        vertices = np.concatenate(seen)
        boxes[row] = vertices.min(axis=0), vertices.max(axis=0)
    return boxes
