"""One picture of what a map covers: in which directions a camera registers, and from where."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from bodycam_ros.geometry import Array
from bodycam_ros.mapping.coverage import Coverage, Gap, find_gaps
from bodycam_ros.picture_style import INK, LANDMARKS, QUIET, WARNING, open_picture, panel_title
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.shown import printable

_SIZE_INCHES = (15.0, 6.2)
_MOST_POINTS = 20_000
_INNER = (2.0, 98.0)  # percentiles of landmarks that the plan shows; a stray one must not shrink the rest
_FARTHEST = 1.0
"""Landmarks farther off than this times the breadth of where photographs were taken are not shown."""

_ARROW = 0.05  # of the plan's breadth
_SHARE = Normalize(0.0, 1.0)


def draw_coverage(coverage: Coverage, reference_map: ReferenceMap, path: Path, name: str) -> None:
    """Write the picture of a map, named in its title, as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    gaps = find_gaps(coverage)
    caption = (
        f"a body camera would be registered in {100 * coverage.share:.0f} % of all directions; "
        f"{len(reference_map.image_names)} photographs, {len(reference_map.landmark_ids)} landmarks"
    )
    if gaps:
        caption += f"; {len(gaps)} {'gap' if len(gaps) == 1 else 'gaps'} to photograph (red)"
    with open_picture(path, *_SIZE_INCHES) as figure:
        figure.text(0.035, 0.965, f"Coverage of {printable(name)}", fontsize=17.0, weight="bold", va="top")
        figure.text(0.035, 0.89, caption, fontsize=10.0, color=QUIET, va="top")
        _draw_directions(figure.add_axes((0.055, 0.15, 0.45, 0.62)), coverage, reference_map, gaps)
        _draw_plan(figure.add_axes((0.56, 0.15, 0.36, 0.62)), coverage, reference_map, gaps)
        scale = figure.add_axes((0.945, 0.15, 0.010, 0.62))
        bar = figure.colorbar(ScalarMappable(_SHARE, LANDMARKS), cax=scale, ticks=[0.0, 0.5, 1.0])
        bar.outline.set_visible(False)
        scale.set_yticklabels(["0 %", "50 %", "100 %"])
        scale.set_title("enough\nin view", fontsize=8.0, color=QUIET, loc="left")


def _draw_directions(axes: Axes, coverage: Coverage, reference_map: ReferenceMap, gaps: list[Gap]) -> None:
    """Azimuth to the left as people turn, elevation upwards; share of the places that see enough."""
    step = float(np.diff(coverage.azimuths_deg)[0])
    rows = len(coverage.elevations_deg)
    rise = float(np.diff(coverage.elevations_deg)[0]) if rows > 1 else step
    low, high = coverage.elevations_deg[0] - rise / 2, coverage.elevations_deg[-1] + rise / 2
    # Half of the first column lies beyond the seam: shown at both ends.
    share = np.concatenate([coverage.share_by_direction, coverage.share_by_direction[:, :1]], axis=1)
    extent = (-180.0 - step / 2, 180.0 + step / 2, low, high)
    axes.imshow(share, cmap=LANDMARKS, norm=_SHARE, origin="lower", extent=extent, aspect="auto", zorder=0)
    for gap in gaps:
        cells = np.concatenate([gap.cells, gap.cells[:, :1]], axis=1)
        # Cells as blocks of 8 x 8, so that the contour follows their edges; a border of zeros closes it.
        blocks = np.pad(np.kron(cells, np.ones((8, 8))), 1)
        x = np.linspace(extent[0], extent[1], blocks.shape[1])
        y = np.linspace(low, high, blocks.shape[0])
        axes.contour(x, y, blocks, levels=[0.5], colors=WARNING, linewidths=1.6, zorder=3)
        if not gap.all_around:
            axes.plot(gap.azimuth_deg, gap.elevation_deg, "x", color=WARNING, markersize=9.0, markeredgewidth=2.0)
    forward = reference_map.world_T_camera[:, :3, 2]
    azimuths = np.degrees(np.arctan2(forward[:, 1], forward[:, 0]))
    elevations = np.degrees(np.arcsin(np.clip(forward[:, 2], -1.0, 1.0)))
    axes.plot(azimuths, elevations, "o", color=INK, markersize=3.2, markeredgecolor="white", markeredgewidth=0.5)
    axes.set_xlim(180.0, -180.0)
    axes.set_ylim(low, high)
    axes.set_xticks(range(-180, 181, 45))
    axes.set_xlabel("azimuth [deg], from the map's x axis, to the left", labelpad=3.0)
    axes.set_ylabel("elevation [deg]")
    panel_title(axes, "Directions", "dots: viewing directions of the photographs")


def _draw_plan(axes: Axes, coverage: Coverage, reference_map: ReferenceMap, gaps: list[Gap]) -> None:
    """From above: landmarks, photographs with their directions, places in the colour of their coverage."""
    points = reference_map.points_world[:: max(1, len(reference_map.points_world) // _MOST_POINTS)]
    centres = reference_map.world_T_camera[:, :3, 3]
    forward = reference_map.world_T_camera[:, :3, 2]
    places = coverage.places_world
    low, high = _extent(points, np.concatenate([centres, places]))
    axes.plot(points[:, 0], points[:, 1], ".", color=QUIET, markersize=1.2, alpha=0.35, zorder=0)
    floor, at_floor = np.unique(np.round(places[:, :2], 3), axis=0, return_inverse=True)
    mean = np.bincount(at_floor.ravel(), coverage.share_by_place) / np.bincount(at_floor.ravel())
    x, y = floor.T
    axes.scatter(x, y, c=mean, cmap=LANDMARKS, norm=_SHARE, s=130.0, edgecolors="white", linewidths=0.6, zorder=2)
    length = _ARROW * float((high - low).max())
    axes.quiver(
        *centres[:, :2].T, *(length * forward[:, :2]).T, color=INK, angles="xy", scale_units="xy", scale=1.0,
        width=0.0035, headwidth=4.0, zorder=3,
    )  # fmt: skip
    for gap in (gap for gap in gaps if not gap.all_around):
        azimuth = np.radians(gap.azimuth_deg)
        start = places[:, :2].mean(axis=0)
        tip = start + 0.4 * float((high - low).min()) * np.array([np.cos(azimuth), np.sin(azimuth)])
        style = {"arrowstyle": "-|>", "color": WARNING, "linewidth": 2.4, "mutation_scale": 20.0, "shrinkA": 0.0}
        axes.annotate("", tuple(tip), tuple(start), arrowprops=style, zorder=5)
    # Where the shape of the picture needs wider limits, matplotlib warns of others than automatic ones.
    axes.set_xlim(low[0], high[0], auto=True)
    axes.set_ylim(low[1], high[1], auto=True)
    axes.set_aspect("equal", adjustable="datalim")
    unit = " [m]" if reference_map.metric else ""
    axes.set_xlabel(f"x{unit}", labelpad=2.0)
    axes.set_ylabel(f"y{unit}", labelpad=2.0)
    panel_title(axes, "Places", "from above")
    handles = [
        Line2D([], [], color=INK, marker=r"$\rightarrow$", linestyle="", markersize=9.0, label="photograph"),
        Line2D([], [], color=QUIET, marker=".", linestyle="", markersize=4.0, label="landmark"),
        Line2D([], [], color=LANDMARKS(0.7), marker="o", linestyle="", markersize=8.0, label="place of a body camera"),
        Line2D([], [], color=WARNING, linewidth=2.4, label="to photograph"),
    ]
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.085), ncols=4, borderpad=0.0)


def _extent(points: Array, inner: Array) -> tuple[Array, Array]:
    """Lower and upper corner (2,) of what the plan shows.

    Args:
        points: (L, 3) landmarks, of which stray ones and those far off are not shown.
        inner: (N, 3) places and photographs, which all are.
    """
    first, last = inner[:, :2].min(axis=0), inner[:, :2].max(axis=0)
    around = _FARTHEST * float(np.max(last - first))
    low, high = np.percentile(points[:, :2], _INNER, axis=0)
    low, high = np.clip(low, first - around, first), np.clip(high, last, last + around)
    margin = 0.03 * float((high - low).max())
    return low - margin, high + margin
