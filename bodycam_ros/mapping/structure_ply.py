"""A structure as a PLY file, for any point cloud viewer."""

from pathlib import Path

import numpy as np

from bodycam_ros.mapping.structure import Structure

_CAMERA_COLOUR = (255, 0, 0)
_AXIS_POINTS = 10  # per camera, along its optical axis
_AXIS_LENGTH = 0.02  # of the extent of all cameras


def write_ply(path: Path, structure: Structure) -> None:
    """Write points in their colours, and each camera as a red line of points along its optical axis."""
    centres = structure.world_T_camera[:, :3, 3]
    length = _AXIS_LENGTH * float(np.linalg.norm(np.ptp(centres, axis=0)))
    steps = np.linspace(0.0, length, _AXIS_POINTS)
    axes = centres[:, None] + steps[:, None] * structure.world_T_camera[:, None, :3, 2]
    positions = np.concatenate([structure.points_world, axes.reshape(-1, 3)])
    colours = np.concatenate([structure.colours, np.tile(np.array(_CAMERA_COLOUR, np.uint8), (axes.size // 3, 1))])

    names = ("x", "y", "z", "red", "green", "blue")
    vertices = np.zeros(len(positions), dtype=list(zip(names, ["<f4"] * 3 + ["u1"] * 3, strict=True)))
    for name, column in zip(names, [*positions.T, *colours.T], strict=True):
        vertices[name] = column
    types = ["float"] * 3 + ["uchar"] * 3
    header = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        + [f"property {kind} {name}" for kind, name in zip(types, names, strict=True)]
        + ["end_header", ""]
    )
    path.write_bytes(header.encode("ascii") + vertices.tobytes())
