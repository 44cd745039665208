"""One picture of what a map covers: in which directions cameras find themselves, and from where."""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.mapping.coverage import Coverage, Gap, find_gaps
from bodycam_ros.plots.picture_style import FAINT, INK, LANDMARKS, QUIET, TYPOGRAPHY, WARNING, panel_title
from bodycam_ros.registration.reference_map import ReferenceMap

Array = NDArray[np.float64]

_DOTS_PER_INCH = 110
_SIZE_INCHES = (15.0, 6.2)
_DIRECTIONS, _PLAN, _SCALE = (0.055, 0.15, 0.45, 0.62), (0.56, 0.15, 0.36, 0.62), (0.945, 0.15, 0.010, 0.62)
_MOST_POINTS = 20_000
_INNER = (2.0, 98.0)  # percentiles of landmarks that the plan shows; a stray one must not shrink the rest
_FARTHEST = 1.0
"""Landmarks farther off than this times the breadth of where photographs were taken are not shown."""

_ARROW = 0.05  # of the plan's breadth
_SHARE = Normalize(0.0, 1.0)


def draw_coverage(coverage: Coverage, reference_map: ReferenceMap, path: Path, title: str = "Coverage") -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    gaps = find_gaps(coverage)
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        figure.text(0.035, 0.965, title, fontsize=17.0, weight="bold", va="top", parse_math=False)
        figure.text(0.035, 0.89, _caption(coverage, reference_map, gaps), fontsize=10.0, color=QUIET, va="top")
        around = figure.add_axes(_DIRECTIONS)
        plan = figure.add_axes(_PLAN)
        scale = figure.add_axes(_SCALE)
        _draw_directions(around, coverage, reference_map, gaps)
        _draw_plan(plan, coverage, reference_map, gaps)
        _draw_scale(figure, scale)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _caption(coverage: Coverage, reference_map: ReferenceMap, gaps: list[Gap]) -> str:
    caption = (
        f"a body camera would register in {100 * coverage.share:.0f} % of all directions; "
        f"{len(reference_map.image_names)} photographs, {len(reference_map.landmark_ids)} landmarks"
    )
    if gaps:
        caption += f"; {len(gaps)} {'gap' if len(gaps) == 1 else 'gaps'} to photograph (red)"
    return caption


def _draw_directions(axes: Axes, coverage: Coverage, reference_map: ReferenceMap, gaps: list[Gap]) -> None:
    """Azimuth to the left as people turn, elevation upwards; how many of the places see enough."""
    step = float(np.diff(coverage.azimuths_deg)[0])
    rows = len(coverage.elevations_deg)
    rise = float(np.diff(coverage.elevations_deg)[0]) if rows > 1 else step
    low, high = coverage.elevations_deg[0] - rise / 2, coverage.elevations_deg[-1] + rise / 2
    # Half of the first column lies beyond the seam: shown at both ends.
    share = np.concatenate([coverage.share_by_direction, coverage.share_by_direction[:, :1]], axis=1)
    extent = (-180.0 - step / 2, 180.0 + step / 2, low, high)
    axes.imshow(share, cmap=LANDMARKS, norm=_SHARE, origin="lower", extent=extent, aspect="auto", zorder=0)
    for gap in gaps:
        _outline(axes, gap, coverage, step, rise)
    forward = reference_map.world_T_camera[:, :3, 2] @ coverage.level_R_world.T
    azimuths = np.degrees(np.arctan2(forward[:, 1], forward[:, 0]))
    elevations = np.degrees(np.arcsin(np.clip(forward[:, 2], -1.0, 1.0)))
    axes.plot(azimuths, elevations, "o", color=INK, markersize=3.2, markeredgecolor="white", markeredgewidth=0.5)
    axes.set_xlim(180.0, -180.0)
    axes.set_ylim(low, high)
    axes.set_xticks(range(-180, 181, 45))
    axes.set_xlabel("azimuth [deg], from the map's x axis, to the left", labelpad=3.0)
    axes.set_ylabel("elevation [deg]")
    panel_title(axes, "Directions", "dots: where the photographs look")


def _outline(axes: Axes, gap: Gap, coverage: Coverage, step: float, rise: float) -> None:
    """A red line around a gap; what goes over the seam shows at both ends of the picture."""
    cells = np.concatenate([gap.cells, gap.cells[:, :1]], axis=1)
    beyond = np.pad(gap.cells, 1, mode="wrap")  # the last column is beside the first
    beyond[[0, -1]] = False
    lines = []
    for row, column in zip(*np.nonzero(cells), strict=True):
        x, y = -180.0 + step * (column - 0.5), coverage.elevations_deg[row] - rise / 2
        at = column % gap.cells.shape[1] + 1
        sides = {
            (x, y, x, y + rise): beyond[row + 1, at - 1],
            (x + step, y, x + step, y + rise): beyond[row + 1, at + 1],
            (x, y, x + step, y): beyond[row, at],
            (x, y + rise, x + step, y + rise): beyond[row + 2, at],
        }
        lines += [((x0, y0), (x1, y1)) for (x0, y0, x1, y1), inside in sides.items() if not inside]
    axes.add_collection(LineCollection(lines, colors=WARNING, linewidths=1.6, capstyle="projecting", zorder=3))
    if not gap.all_around:
        axes.plot(gap.azimuth_deg, gap.elevation_deg, "x", color=WARNING, markersize=9.0, markeredgewidth=2.0, zorder=4)


def _draw_plan(axes: Axes, coverage: Coverage, reference_map: ReferenceMap, gaps: list[Gap]) -> None:
    """From above: landmarks, photographs with their directions, places in the colour of what they see."""
    level = coverage.level_R_world.T
    points = reference_map.points_world[:: max(1, len(reference_map.points_world) // _MOST_POINTS)] @ level
    centres = reference_map.world_T_camera[:, :3, 3] @ level
    forward = reference_map.world_T_camera[:, :3, 2] @ level
    places = coverage.places_world @ level
    middle, half = _frame(points, np.concatenate([centres, places]))
    breadth = 2.0 * float(half.max())
    axes.plot(points[:, 0], points[:, 1], ".", color=QUIET, markersize=1.2, alpha=0.35, zorder=0)
    _draw_places(axes, places, coverage.share_by_place)
    arrow: Any = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0035, "headwidth": 4.0, "zorder": 3}
    axes.quiver(*centres[:, :2].T, *(_ARROW * breadth * forward[:, :2]).T, color=INK, **arrow)
    for gap in gaps:
        if not gap.all_around:
            _draw_towards(axes, places[:, :2].mean(axis=0), gap, middle, half)
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    axes.set_aspect("equal", adjustable="box")
    unit = " [m]" if reference_map.metric else ""
    axes.set_xlabel(f"x{unit}", labelpad=2.0)
    axes.set_ylabel(f"y{unit}", labelpad=2.0)
    axes.tick_params(length=2.5, width=0.6)
    panel_title(axes, "Places", "from above")
    handles = [
        Line2D([], [], color=INK, marker=r"$\rightarrow$", linestyle="", markersize=9.0, label="photograph"),
        Line2D([], [], color=QUIET, marker=".", linestyle="", markersize=4.0, label="landmark"),
        Line2D([], [], color=LANDMARKS(0.7), marker="o", linestyle="", markersize=8.0, label="place looked from"),
    ]
    if any(not gap.all_around for gap in gaps):
        handles.append(Line2D([], [], color=WARNING, linewidth=2.4, label="to photograph"))
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.085), ncols=4, borderpad=0.0)


def _draw_towards(axes: Axes, start: Array, gap: Gap, middle: Array, half: Array) -> None:
    """A red arrow from the places towards a gap, nearly to the edge of the plan."""
    azimuth = np.radians(gap.azimuth_deg)
    towards = np.array([np.cos(azimuth), np.sin(azimuth)])
    with np.errstate(divide="ignore"):
        length = float(np.min((half - np.sign(towards) * (start - middle)) / np.abs(towards)))
    style: Any = {"arrowstyle": "-|>", "color": WARNING, "linewidth": 2.4, "mutation_scale": 20.0, "shrinkA": 0.0}
    (x, y), (tip_x, tip_y) = start, start + 0.92 * length * towards
    axes.annotate("", (tip_x, tip_y), (x, y), arrowprops=style, zorder=5)


def _draw_places(axes: Axes, places: Array, share: Array) -> None:
    """A disc for each place on the floor; of its heights the mean."""
    floor, of_place = np.unique(np.round(places[:, :2], 3), axis=0, return_inverse=True)
    of_place = of_place.ravel()
    mean = np.bincount(of_place, share) / np.bincount(of_place)
    axes.scatter(
        floor[:, 0],
        floor[:, 1],
        c=mean,
        cmap=LANDMARKS,
        norm=_SHARE,
        s=130.0,
        edgecolors="white",
        linewidths=0.6,
        zorder=2,
    )


def _frame(points: Array, inner: Array) -> tuple[Array, Array]:
    """Middle and half the size (2,) of what the plan shows, in the panel's proportions.

    Args:
        points: (L, 3) landmarks, of which stray ones and those far off are not shown.
        inner: (N, 3) places and photographs, which all are.
    """
    first, last = inner[:, :2].min(axis=0), inner[:, :2].max(axis=0)
    around = _FARTHEST * float(np.max(last - first))
    low, high = np.percentile(points[:, :2], _INNER, axis=0)
    low, high = (np.minimum(np.maximum(low, first - around), first), np.maximum(np.minimum(high, last + around), last))
    half = 0.53 * np.maximum(high - low, 1e-9)
    width, height = _PLAN[2] * _SIZE_INCHES[0], _PLAN[3] * _SIZE_INCHES[1]
    per_inch = max(half[0] / width, half[1] / height)
    return 0.5 * (low + high), per_inch * np.array([width, height])


def _draw_scale(figure: Figure, axes: Axes) -> None:
    bar = figure.colorbar(ScalarMappable(_SHARE, LANDMARKS), cax=axes, ticks=[0.0, 0.25, 0.5, 0.75, 1.0])
    bar.outline.set_edgecolor(FAINT)
    axes.set_yticklabels(["0 %", "25 %", "50 %", "75 %", "100 %"])
    axes.tick_params(length=0)
    axes.set_title("enough\nis seen", fontsize=8.0, color=QUIET, loc="left")
