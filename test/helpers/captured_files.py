"""A known walk as other systems would have written it: each with a world, a clock, a unit and names of its own."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import ezc3d
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helpers.known_walk import PARENTS, Walk

Points = NDArray[np.float64]

MIXAMO = {
    "pelvis": "mixamorig:Hips",
    "torso": "mixamorig:Spine",
    "thigh_left": "mixamorig:LeftUpLeg",
    "shin_left": "mixamorig:LeftLeg",
    "foot_left": "mixamorig:LeftFoot",
}
Z_UP_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def origins(walk: Walk) -> dict[str, Points]:
    """Segment -> (T, 3) [m]."""
    return {s: walk.world_T_segment[:, row, :3, 3] for s, row in walk.body.segment_index.items()}


def seconds(walk: Walk) -> Points:
    """(T,) since the first frame."""
    return np.asarray((walk.stamps_ns - walk.stamps_ns[0]) * 1e-9)


def write_trc(path: Path, times: Points, points: Mapping[str, Points], units: str = "mm", per_m: float = 1e3) -> Path:
    """Points (T, 3) [m], z up, as TRC with y up; NaN becomes an empty cell."""
    names = list(points)
    rate = f"{(len(times) - 1) / (times[-1] - times[0]):.2f}"
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(times)}\t{len(names)}\t{units}\t{rate}\t1\t{len(times)}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{n}" for n in range(1, len(names) + 1) for axis in "XYZ"),
        "",
    ]
    for row, time in enumerate(times):
        cells = [c for of in points.values() for c in per_m * Z_UP_TO_Y_UP @ of[row]]
        lines.append(f"{row + 1}\t{time:.9f}\t" + "\t".join("" if np.isnan(c) else f"{c:.6f}" for c in cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(path: Path, rate: float, points: Mapping[str, Points], units: str = "mm", per_m: float = 1e3) -> Path:
    """Points (T, 3) [m] as C3D."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = [units]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(points)
    places = np.stack([per_m * of.T for of in points.values()], axis=1)
    file["data"]["points"] = np.concatenate([places, np.ones((1, *places.shape[1:]))])
    file.write(str(path))
    return path


def write_tum(path: Path, times: Points, poses: Points) -> Path:
    """Poses (T, 4, 4) [m] as TUM."""
    rotations = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    rows = np.column_stack([times, poses[:, :3, 3], rotations])
    path.write_text("# time x y z qx qy qz qw\n" + "\n".join(" ".join(f"{v:.9f}" for v in row) for row in rows) + "\n")
    return path


def write_bvh(
    path: Path, walk: Walk, frame_time: float, per_m: float = 100.0, orders: Sequence[str] = ("ZXY",)
) -> Path:
    """A walk as BVH with Mixamo's names, y up in the world and in bones, angles in each of some orders in turn."""
    poses = walk.world_T_segment
    row_of = walk.body.segment_index
    order_of = {segment: orders[row % len(orders)] for row, segment in enumerate(["pelvis", *PARENTS])}
    lines = ["HIERARCHY"]
    columns: list[Points] = []

    def write_joint(segment: str, depth: int) -> None:
        indent = "\t" * depth
        parent = PARENTS.get(segment)
        world_R = poses[:, row_of[segment], :3, :3]
        if parent is None:
            offset, R = np.zeros(3), Z_UP_TO_Y_UP @ world_R @ Z_UP_TO_Y_UP.T
            columns.append(per_m * poses[:, row_of[segment], :3, 3] @ Z_UP_TO_Y_UP.T)
        else:
            above = poses[:, row_of[parent]]
            R = Z_UP_TO_Y_UP @ np.swapaxes(above[:, :3, :3], 1, 2) @ world_R @ Z_UP_TO_Y_UP.T
            offset = Z_UP_TO_Y_UP @ above[0, :3, :3].T @ (poses[0, row_of[segment], :3, 3] - above[0, :3, 3]) * per_m
        order = order_of[segment]
        columns.append(Rotation.from_matrix(R).as_euler(order, degrees=True))
        places = "" if parent else "Xposition Yposition Zposition "
        lines.append(f"{indent}{'JOINT' if parent else 'ROOT'} {MIXAMO[segment]}")
        lines.extend([f"{indent}{{", f"{indent}\tOFFSET " + " ".join(f"{v:.8f}" for v in offset)])
        turns = " ".join(f"{axis}rotation" for axis in order)
        lines.append(f"{indent}\tCHANNELS {3 if parent else 6} {places}{turns}")
        children = [child for child, of in PARENTS.items() if of == segment]
        for child in children:
            write_joint(child, depth + 1)
        if not children:
            lines.extend([f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 10 0", f"{indent}\t}}"])
        lines.append(f"{indent}}}")

    write_joint("pelvis", 0)
    table = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {frame_time:.8f}"]
    lines += [" ".join(f"{v:.8f}" for v in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
    return path
