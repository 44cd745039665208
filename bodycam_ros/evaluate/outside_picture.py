"""What static cameras saw at one instant, with the solved body's surface, contour and forces painted over it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.drawing.picture_style import EQUIPMENT, LEFT, QUIET, RIGHT, TYPOGRAPHY, panel_title
from bodycam_ros.evaluate.outside_scene import OutsideScene
from bodycam_ros.outside.contour_painting import CONTOUR, ENLARGED, INWARD, OUTWARD, SILENT, Window, paint_contour
from bodycam_ros.outside.seen_contour import SeenContour
from bodycam_ros.outside.station_view import Image
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.solved.solved_recording import SolvedRecording

STATIONS = 6
"""Static cameras that are shown, spread over those of the recording."""

_LATEST_S = 20.0
"""The instant is the recording's middle, but no later than this: bags are read from their start."""

_LEARNED_S = 0.5
"""Images before the instant by which colours are learned."""

_PANEL_INCHES, _TITLE_INCHES, _KEY_INCHES = 5.0, 0.35, 0.4
_DOTS_PER_INCH = 130
_ROOM = 1.15  # of the window around the body
_SMALLEST_PX = 80
_SHARP_PX = 640  # a panel is magnified to at least as many pixels


@dataclass(frozen=True, eq=False)
class OutsideView:
    """One image.

    Attributes:
        station: name.
        seconds: since the start of the recording.
        image: (H, W, 3) blue, green, red.
        contour: of the body in it.
        colours: of the segments, as ``#rrggbb``.
    """

    station: str
    seconds: float
    image: Image
    contour: SeenContour
    colours: Sequence[str]

    @property
    def window(self) -> Window:
        """A square around the body; the whole image where that is not in it."""
        height, width = self.image.shape[:2]
        covered = self.contour.covered
        if covered is None:
            side, middle = max(height, width), np.array([width, height]) / 2.0
        else:
            side, middle = max(_SMALLEST_PX, round(_ROOM * float(np.ptp(covered, axis=0).max()))), covered.mean(axis=0)
        left, top = (_start(*of) for of in ((float(middle[0]), side, width), (float(middle[1]), side, height)))
        return Window(left, top, side, side, -(-_SHARP_PX // side))


def _start(middle: float, side: int, size: int) -> int:
    """Where a window begins, around a middle, but within the image if it is no larger than that."""
    start = round(middle - side / 2.0)
    return min(max(start, 0), size - side) if side <= size else (size - side) // 2


def outside_views(scene: OutsideScene, solved: SolvedRecording, recording: Path) -> tuple[OutsideView, ...]:
    """The views of some stations at one instant in the middle of the recording.

    Raises:
        RecordingError: not a recording, or an image that cannot be decoded.
    """
    middle_ns = min((solved.start_ns + solved.end_ns) // 2, solved.start_ns + round(1e9 * _LATEST_S))
    at_ns = int(solved.stamps_ns[np.argmin(np.abs(solved.stamps_ns - middle_ns))])
    names = list(scene.stations)
    shown = [
        names[row] for row in np.unique(np.linspace(0, len(names) - 1, min(STATIONS, len(names))).round().astype(int))
    ]
    found = _images_until(recording, shown, at_ns - round(1e9 * _LEARNED_S), at_ns + solved.frame_ns // 2)
    views = []
    for station, images in found.items():
        if not images or images[-1].stamp_ns < at_ns - solved.frame_ns // 2:
            continue
        for image in images:
            pixels, poses = scene.decoded(image), scene.poses_at(image.stamp_ns)
            scene.learn(station, pixels, poses)
        seconds = float(solved.seconds(np.array([images[-1].stamp_ns]))[0])
        views.append(OutsideView(station, seconds, pixels, scene.contour(station, pixels, poses), scene.colours))
    return tuple(views)


def draw_outside(views: Sequence[OutsideView], path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    columns = min(len(views), 2 if len(views) in (2, 4) else 3)
    rows = -(-len(views) // columns)
    with matplotlib.rc_context(TYPOGRAPHY):
        width, height = max(2, columns) * _PANEL_INCHES, rows * (_PANEL_INCHES + _TITLE_INCHES) + _KEY_INCHES
        figure = Figure(figsize=(width, height), facecolor="white")
        FigureCanvasAgg(figure)
        panels = figure.subplots(rows, columns, squeeze=False)
        for axes, view in zip(panels.flat, [*views, *[None] * panels.size], strict=False):
            axes.axis("off")
            if view is not None:
                _draw_view(axes, view)
        figure.legend(handles=_key(), loc="lower center", ncols=7, labelcolor=QUIET, handlelength=1.4)
        figure.subplots_adjust(
            left=0.01,
            right=0.99,
            bottom=_KEY_INCHES / height,
            top=1.0 - _TITLE_INCHES / height,
            wspace=0.02,
            hspace=_TITLE_INCHES / _PANEL_INCHES,
        )
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_view(axes: Axes, view: OutsideView) -> None:
    picture = paint_contour(view.image, view.contour, view.colours, view.window)
    axes.imshow(picture[..., ::-1], interpolation="lanczos")
    shifts = view.contour.shifts[np.isfinite(view.contour.shifts)]
    note = "the body is not in the image"
    if len(view.contour.shifts):
        told = f"{len(shifts)} of {len(view.contour.shifts)} lines tell"
        off = f", off by {float(np.median(np.abs(shifts))):.2f} px (median)" if len(shifts) else ""
        note = told + off
    panel_title(axes, view.station.replace("_", " "), f"{view.seconds:.2f} s, {note}")


def _key() -> list[Line2D]:
    lines = {f"force outward, {ENLARGED:g} times enlarged": OUTWARD, "force inward": INWARD}
    points = {"contour": CONTOUR, "where a line tells nothing": SILENT}
    areas = {"surface: left": LEFT, "right": RIGHT, "equipment": EQUIPMENT}
    return [
        *(Line2D([], [], color=colour, linewidth=2.0, label=name) for name, colour in lines.items()),
        *(
            Line2D([], [], color=colour, linestyle="", marker="o", markersize=4.0, label=name)
            for name, colour in points.items()
        ),
        *(
            Line2D([], [], color=colour, linestyle="", marker="s", markersize=7.0, alpha=0.5, label=name)
            for name, colour in areas.items()
        ),
    ]


def _images_until(recording: Path, cameras: Sequence[str], from_ns: int, until_ns: int) -> dict[str, list[CameraImage]]:
    """The images of each camera between two times, both included [ns]."""
    found: dict[str, list[CameraImage]] = {camera: [] for camera in cameras}
    passed: set[str] = set()
    with open_recording(recording) as images:
        for image in images.images(cameras):
            if image.stamp_ns > until_ns:
                passed.add(image.camera)
                if len(passed) == len(found):
                    break
            elif image.stamp_ns >= from_ns:
                found[image.camera].append(image)
    return found
