"""How a map was extended, round by round, as A figure 4: what was registered, and what it was registered by."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bodycam_ros.mapping.growth_settings import ExtensionRound
from bodycam_ros.plots.picture_style import FAINT, GOOD, LANDMARKS, LEFT, QUIET, RIGHT, TRUTH, TYPOGRAPHY, panel_title
from bodycam_ros.registration.reference_map import ReferenceMap

_SIZE_INCHES = (16.0, 6.6)
_DOTS_PER_INCH = 110
_MOST_POINTS = 15_000
_INNER = (2.0, 98.0)  # percentiles of what the plans show; a stray landmark must not shrink the rest
_MARGIN = 0.08
_ALL = "all images"
_DARK = 0.55  # a share beyond which the figure in it is white


def draw_rounds(
    rounds: Sequence[ExtensionRound], reference_map: ReferenceMap, settled: int, path: Path, title: str
) -> None:
    """Write the picture as PNG.

    Args:
        rounds: what each brought.
        reference_map: as it is after them.
        settled: how many of its landmarks were there before.
        path: of the picture.
        title: above it.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        figure.text(0.03, 0.96, title, fontsize=17.0, weight="bold", va="top")
        figure.text(0.03, 0.885, _caption(rounds), fontsize=10.0, color=QUIET, va="top")
        first, last = rounds[0], rounds[-1]
        points = reference_map.points_world[:, :2]
        old, new = points[:settled], points[settled:]
        plans = [
            ("Map", f"{settled} landmarks", old, points[:0], {}),
            ("Round 1", f"{100 * first.share:.1f} % registered", old, points[:0], first.places),
            (
                f"Round {len(rounds)}",
                f"{100 * last.share:.1f} % registered, {len(new)} landmarks more",
                old,
                new,
                last.places,
            ),
        ]
        shown = _extent(np.concatenate([points, *[where[:, :2] for where in last.places.values()]]))
        for number, (name, note, landmarks, grown, places) in enumerate(plans):
            axes = figure.add_axes((0.03 + 0.225 * number, 0.1, 0.21, 0.66))
            _draw_plan(axes, landmarks, grown, places, shown)
            panel_title(axes, name, note)
        _draw_shares(figure.add_axes((0.8, 0.1, 0.18, 0.66)), rounds)
        figure.text(0.03, 0.045, "From above; ticks every metre.", color=QUIET, fontsize=8.5)
        legend = (("landmarks of the map", TRUTH), ("grown landmarks", GOOD), ("left cameras", LEFT), ("others", RIGHT))
        for number, (name, colour) in enumerate(legend):
            figure.text(0.26 + 0.11 * number, 0.045, f"● {name}", color=colour, fontsize=8.5)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _caption(rounds: Sequence[ExtensionRound]) -> str:
    first, last = rounds[0], rounds[-1]
    return (
        f"{100 * first.absolute:.1f} % of all images are held by landmarks of the photographs; "
        f"{100 * first.share:.1f} % are registered with what grew on the way, {100 * last.share:.1f} % "
        f"in {len(rounds)} rounds"
    )


def _extent(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 2) corners of what is shown."""
    low, high = np.percentile(points, _INNER, axis=0)
    margin = _MARGIN * float((high - low).max())
    return np.array([low - margin, high + margin])


def _draw_plan(
    axes: Axes,
    landmarks: NDArray[np.float64],
    grown: NDArray[np.float64],
    places: Mapping[str, NDArray[np.float64]],
    shown: NDArray[np.float64],
) -> None:
    for points, colour in ((landmarks, TRUTH), (grown, GOOD)):
        few = points[:: max(1, len(points) // _MOST_POINTS)]
        axes.scatter(few[:, 0], few[:, 1], s=0.6, color=colour, linewidths=0, rasterized=True)
    for camera, where in places.items():
        colour = LEFT if camera.endswith("_left") else RIGHT
        axes.scatter(where[:, 0], where[:, 1], s=2.5, color=colour, linewidths=0, rasterized=True)
    axes.set_xlim(*shown[:, 0].tolist())
    axes.set_ylim(*shown[:, 1].tolist())
    axes.set_aspect("equal")
    for axis, ends in ((axes.xaxis, shown[:, 0]), (axes.yaxis, shown[:, 1])):
        axis.set_ticks(np.arange(np.ceil(ends[0]), ends[1]))
        axis.set_ticklabels([])


def _draw_shares(axes: Axes, rounds: Sequence[ExtensionRound]) -> None:
    """Cameras down, rounds across; each with its share."""
    cameras = sorted(rounds[0].shares)
    shares = np.array([[*(one.shares[camera] for one in rounds)] for camera in cameras] + [[r.share for r in rounds]])
    axes.imshow(shares, cmap=LANDMARKS, vmin=0.0, vmax=1.0, aspect="auto")
    for row, of_camera in enumerate(shares):
        for column, share in enumerate(of_camera):
            ink = "white" if share > _DARK else QUIET
            axes.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=7.5, color=ink)
    axes.set_yticks(range(len(cameras) + 1), [*cameras, _ALL])
    names = [str(number + 1) for number in range(len(rounds))]
    axes.set_xticks(range(len(rounds)), names)
    axes.tick_params(length=0)
    axes.axhline(len(cameras) - 0.5, color=FAINT, linewidth=3.0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    panel_title(axes, "Registered", "share of images [%], by round")
