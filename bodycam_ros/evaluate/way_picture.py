"""The way of a person on a photograph of the place, and on a map from above (A figure 9).

The photograph's pose is known from the map, so that nothing is matched by hand. No map knows where north is: its axes
are drawn.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.colours import INK, LEFT, QUIET, RIGHT, TRUTH
from bodycam_ros.results.picture_style import open_picture, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording

_WIDTH, _HEIGHT = 16.0, 6.6  # [in]
_AROUND_M = 2.0  # of the way, on the map
_LENGTHS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
_COMPARED = 2000  # places of the way that photographs are chosen by: an hour has 100,000
_BAR_SHARE = 0.3  # of the map's width that its scale bar takes at most


def draw_way(solved: SolvedRecording, reference_map: ReferenceMap, path: Path) -> None:
    """Write the picture as PNG.

    Args:
        solved: the recording.
        reference_map: that it was solved in.
        path: to write to.

    Raises:
        MapError: the photograph of the map is damaged.
        OSError: the picture cannot be written.
    """
    way = way_on_ground(solved)
    view = best_photograph(reference_map, way)
    with open_picture(path, _WIDTH, _HEIGHT) as figure:
        columns = 1 if view is None else 2
        axes = figure.subplots(1, columns, squeeze=False)[0]
        _draw_from_above(axes[-1], reference_map, way)
        if view is not None:
            _draw_on_photograph(axes[0], reference_map, view, way)
        figure.subplots_adjust(left=0.02, right=0.97, top=0.92, bottom=0.08, wspace=0.08)


def way_on_ground(solved: SolvedRecording) -> Array:
    """(T, 3) below the root, as high as the lowest ends of limbs are in the median [m]; a NaN in each gap of time."""
    bones = [bone for bone in solved.bones() if not bone.is_equipment]
    heights = np.stack([end[:, 2] for bone in bones for end in (bone.start, bone.end)])
    root = solved.world_T_segment[:, solved.body.segment_index[solved.body.root], :3, 3]
    way = np.column_stack([root[:, :2], np.full(len(root), np.median(heights.min(axis=0)))])
    return solved.curve(solved.stamps_ns, way)[1]


def best_photograph(reference_map: ReferenceMap, way: Array) -> int | None:
    """Row of the photograph with most of the way (T, 3) in it, and of several the one where it is longest.

    None where the map has no photographs, or none with any of the way.
    """
    if reference_map.photographs is None:
        return None
    way = way[:: -(-len(way) // _COMPARED)]
    lengths = []
    for row in range(len(reference_map.world_T_camera)):
        pixels = pixels_in_photograph(reference_map, row, way)
        inside = np.isfinite(pixels[:, 0])
        length_px = np.nansum(np.linalg.norm(np.diff(pixels, axis=0), axis=1))
        lengths.append((float(inside.mean()), float(length_px)))
    best = max(range(len(lengths)), key=lengths.__getitem__, default=None)
    return best if best is not None and lengths[best][0] > 0.0 else None


def pixels_in_photograph(reference_map: ReferenceMap, row: int, way: Array) -> Array:
    """(T, 2) pixels of a way in a photograph; NaN outside."""
    assert reference_map.photographs is not None
    camera = reference_map.photographs.camera(row)
    points_camera = transform_points(inverse(reference_map.world_T_camera[row]), way)
    pixels = camera.project(points_camera)[0]
    inside = np.all((pixels >= 0.0) & (pixels < [camera.width, camera.height]), axis=1) & (points_camera[:, 2] > 0.0)
    found: Array = np.where(inside[:, None], pixels, np.nan)
    return found


def _draw_on_photograph(axes: Axes, reference_map: ReferenceMap, row: int, way: Array) -> None:
    assert reference_map.photographs is not None
    name = reference_map.image_names[row]
    axes.imshow(reference_map.photographs.picture(row, name), cmap="gray", vmin=0, vmax=255)
    _draw_line(axes, pixels_in_photograph(reference_map, row, way))
    axes.axis("off")
    panel_title(axes, "The way in the place", f"on the ground, over photograph {name}, and over what stands before it")


def _draw_from_above(axes: Axes, reference_map: ReferenceMap, way: Array) -> None:
    known = way[np.isfinite(way).all(axis=1)]
    middle, reach = (known.min(axis=0) + known.max(axis=0)) / 2.0, np.ptp(known[:, :2], axis=0).max() / 2.0 + _AROUND_M
    x, y = reference_map.points_world[:, :2].T
    axes.scatter(x, y, s=1.0, color=TRUTH, linewidths=0.0)
    _draw_line(axes, way[:, :2])
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] - reach, middle[1] + reach)
    axes.set_aspect("equal")
    length = max((each for each in _LENGTHS_M if each <= 2.0 * reach * _BAR_SHARE), default=_LENGTHS_M[0])
    left, low = middle[0] - 0.94 * reach, middle[1] - 0.92 * reach
    axes.plot([left, left + length], [low, low], color=INK, linewidth=3.0, solid_capstyle="butt")
    axes.text(left + length / 2.0, low + 0.03 * reach, f"{length:g} m", ha="center", va="bottom", color=INK)
    for along, name in (((1.0, 0.0), "x"), ((0.0, 1.0), "y")):
        base = np.array([middle[0] + 0.8 * reach, middle[1] - 0.92 * reach])
        tip = base + 0.14 * reach * np.array(along)
        axes.annotate("", xytext=tuple(base), xy=tuple(tip), arrowprops={"arrowstyle": "->", "color": QUIET})
        beyond = base + 0.18 * reach * np.array(along)
        axes.text(beyond[0], beyond[1], name, color=QUIET, ha="center", va="center")
    axes.set_xticks([])
    axes.set_yticks([])
    walked = float(np.nansum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
    panel_title(axes, "From above", f"{walked:.1f} m; the map's landmarks, and its axes")


def _draw_line(axes: Axes, line: Array) -> None:
    """A way (T, 2) with where it begins and ends."""
    axes.plot(*line.T, color="white", linewidth=5.0, solid_capstyle="round")
    axes.plot(*line.T, color=LEFT, linewidth=2.6, solid_capstyle="round")
    known = line[np.isfinite(line[:, 0])]
    for point, colour, name in ((known[0], LEFT, "start"), (known[-1], RIGHT, "end")):
        axes.plot(*point, "o", color=colour, markeredgecolor="white", markersize=9.0)
        axes.annotate(
            name, tuple(point), (8, 8), textcoords="offset points", color=colour, weight="bold",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
