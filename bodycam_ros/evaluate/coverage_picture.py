"""One picture of what a map covers: in which directions a camera registers."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from bodycam_ros.evaluate.coverage import Coverage, Gap, find_gaps
from bodycam_ros.files.shown import printable
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.colours import INK, QUIET, WARNING
from bodycam_ros.results.picture_style import LANDMARKS, open_picture, panel_title

_SIZE_INCHES = (9.0, 6.2)
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
        _draw_directions(figure.add_axes((0.08, 0.12, 0.82, 0.65)), coverage, reference_map, gaps)
        scale = figure.add_axes((0.92, 0.12, 0.015, 0.65))
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
