"""A figure with the skin of its body: what glb and usd are written of."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.limb_mesh import limbs_by_segment
from bodycam_ros.body.skin import skinned_body
from bodycam_ros.body.surface import Faces, vertex_normals
from bodycam_ros.body.surface_folder import read_surfaces
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.figure import WORLD_R_REST, Figure, rest_pose
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion, change_axes
from bodycam_ros.geometry import Array, rigid

HALF = "half_"
"""Before the name of a bone, that of the bone that turns by the half of what it turns; ends of names tell the side."""


@dataclass(frozen=True, eq=False)
class SkinnedFigure:
    """The bones of a figure, and the skin that they move.

    Attributes:
        figure: with half bones after the others (``body.skin``).
        vertices, normals: (V, 3) in the rest pose of the figure; none of a body without any length.
        triangles: (F, 3) rows of ``vertices``, outward.
        joints, weights: (V, 4) rows of bones of the figure, and weights that sum to one.
    """

    figure: Figure
    vertices: Array
    normals: Array
    triangles: Faces
    joints: NDArray[np.intp]
    weights: Array

    @classmethod
    def from_motion(cls, motion: SampledMotion, options: MotionOptions, up: str) -> "SkinnedFigure":
        """The figure of a motion, as ``Figure.from_motion`` has it, in its skin.

        Raises:
            BodyError: two bones would have the same name, or a chain of them is too long; or the scan cannot be used.
        """
        figure, body = Figure.from_motion(motion, options, up), motion.body
        if not limbs_by_segment(body):
            none = np.empty((0, 3))
            return cls(figure, none, none, none.astype(np.int32), np.empty((0, 4), np.intp), np.empty((0, 4)))
        rest = rest_pose(body, options.pose or "N")
        scanned = None if options.surface is None else read_surfaces(options.surface, body)
        try:
            skin = skinned_body(body, scanned).rebound(rest)
        except BodyError as error:
            raise BodyError(f"{options.surface or motion.path}: {error}") from error
        program_R_world, scale = UP_AXES[options.up or up], options.scale or 1.0
        program_R_rest = program_R_world @ WORLD_R_REST
        rows = {body.segment_index[segment]: row for row, segment in enumerate(figure.segments)}
        halves = np.arange(len(body.segments), len(body.segments) + len(skin.halves))
        at_rest = rigid(WORLD_R_REST, np.zeros(3)) @ skin.bone_poses(rest)[halves]
        moved = skin.bone_poses(motion.world_T_segment)[:, halves]
        since_rest = moved[..., :3, :3] @ np.swapaxes(at_rest[:, :3, :3], -1, -2)
        parents, children = ([rows[row] for row in column] for column in skin.halves.T.tolist())
        place = rigid(program_R_world @ at_rest[:, :3, :3], scale * at_rest[:, :3, 3] @ program_R_world.T)
        bones = replace(
            figure,
            segments=(*figure.segments, *(f"{HALF}{figure.segments[row]}" for row in children)),
            names=(*figure.names, *(f"{HALF}{figure.names[row]}" for row in children)),
            parents=(*figure.parents, *parents),
            rest=np.concatenate([figure.rest, place]),
            positions=np.concatenate([figure.positions, scale * moved[..., :3, 3] @ program_R_world.T], axis=1),
            rotations=np.concatenate([figure.rotations, change_axes(program_R_world, since_rest)], axis=1),
        )
        row_of_bone = np.zeros(len(body.segments) + len(halves), np.intp)
        row_of_bone[[*rows, *halves]] = [*rows.values(), *range(len(figure.segments), len(bones.segments))]
        return cls(
            figure=bones,
            vertices=scale * skin.vertices @ program_R_rest.T,
            normals=vertex_normals(skin.vertices, skin.triangles) @ program_R_rest.T,
            triangles=skin.triangles,
            joints=row_of_bone[skin.joints],
            weights=skin.weights,
        )
