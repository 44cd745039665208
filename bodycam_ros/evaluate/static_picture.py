"""Images of static cameras with the solved body's surface, contour and forces over them: a picture, and a video."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import StationError
from bodycam_ros.evaluate.overlay_picture import middle_stamp, pick_evenly
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import EQUIPMENT, LEFT, QUIET, RIGHT, open_picture, panel_title, side_colour
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.static_cameras.contour_painting import (
    CONTOUR,
    ENLARGED,
    INWARD,
    OUTWARD,
    SILENT,
    Window,
    cut_out,
    paint_contour,
    square_window,
)
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.station import Contour, Image
from bodycam_ros.static_cameras.stations_file import check_stations_frame, read_stations
from bodycam_ros.static_cameras.surface import BodySurface
from bodycam_ros.static_cameras.surface_folder import surfaces_of

_CAMERAS = 6  # that the picture shows, evenly picked
_COLOURS_S = 0.5  # of images before the one shown, which the colour models are updated by
_PANEL_INCHES, _TITLE_INCHES, _KEY_INCHES = 5.0, 0.35, 0.4
_SHARP_PX = 640  # a panel is magnified to at least as many pixels


@dataclass(frozen=True)
class StaticFiles:
    """Files of static cameras.

    Attributes:
        stations: file with their poses.
        surface: folder of the segments' meshes; None for capsules along the bones.
        map: that the recording was solved in; None where the stations' own frame is the world.
        region: settings of the colour models.
    """

    stations: Path
    surface: Path | None
    map: Path | None
    region: RegionSettings


class StaticScene:
    """A solved body in the images of static cameras, whose colour models are updated at its poses.

    Args:
        solved: the recording.
        recording: bag with its images.
        files: of the static cameras.

    Attributes:
        stations: that the recording has images of, by name.
        colours: of the segments' surfaces, as ``#rrggbb``.

    Raises:
        StationError: the stations cannot be used, the recording has none of them, or their frame is not known.
        BodyError: the surface cannot be used.
        RecordingError: not a recording.
        MapError, LensError: the map, or a lens, cannot be used.
    """

    def __init__(self, solved: SolvedRecording, recording: Path, files: StaticFiles) -> None:
        self.solved, self.recording, self._region, body = solved, recording, files.region, solved.body
        stations = read_stations(files.stations, None if files.map is None else ReferenceMap.load(files.map))
        check_stations_frame(files.stations, solved.path, files.map)
        with open_recording(recording) as images:
            self.stations = {name: station for name, station in stations.items() if name in images.cameras}
            if not self.stations:
                raise StationError(
                    f"{recording} has no images of the static cameras of {files.stations} ({', '.join(stations)}); it "
                    f"has {', '.join(images.cameras)}"
                )
        self.colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
        surface = BodySurface.of(body, surfaces_of(body, solved.path, files.surface))
        self._tracker = RegionTracker(body, surface, self.stations, files.region)
        self._counts = dict.fromkeys(self.stations, 0)

    def add_image(self, image: CameraImage) -> tuple[Image, Contour]:
        """Update the colours of a static camera by an image; its pixels (H, W, 3), and the contour of the body in it.

        The first images count alike, later ones by the learning rate.

        Raises:
            RecordingError: it cannot be decoded, or has another size than the camera's lens is for.
        """
        pixels, poses = decode_colour(image), self.solved.segments_near(image.stamp_ns)
        view = self._tracker.views[image.camera]
        view.station.check_size(pixels)
        self._counts[image.camera] += 1
        rate = max(1.0 / self._counts[image.camera], self._region.learning_rate)
        contour = view.find_contour(poses)
        view.update_colours(pixels, contour, rate, np.ones(len(poses), bool))
        return pixels, contour

    def measure(self, station: str, pixels: Image, contour: Contour) -> Array:
        """(N,) how far outward of its points the image (H, W, 3) has a contour [px]; NaN where it measures nothing."""
        return self._tracker.views[station].measure(pixels, contour, 1).shifts


@dataclass(frozen=True, eq=False)
class StaticView:
    """One image with the body's contour.

    Attributes:
        station: name.
        seconds: since the start of the recording.
        image: (H, W, 3) blue, green, red.
        contour: of the body in it.
        shifts: (N,) of its points, as of ``StaticScene.measure`` [px].
    """

    station: str
    seconds: float
    image: Image
    contour: Contour
    shifts: Array

    @property
    def window(self) -> Window:
        """A square around the body; the whole image where that is not in it."""
        window = square_window(self.image, self.contour.covered)
        return replace(window, times=-(-_SHARP_PX // window.width))


def static_views(scene: StaticScene) -> tuple[StaticView, ...]:
    """The views of some static cameras at one time in the middle of the recording.

    Raises:
        StationError: there is no image of them.
        RecordingError: not a recording, or an image that cannot be decoded.
    """
    solved = scene.solved
    at_ns, half_ns = middle_stamp(solved), solved.frame_ns // 2
    views: dict[str, StaticView] = {}
    for image in _images_between(
        scene.recording, pick_evenly(list(scene.stations), _CAMERAS), at_ns - round(1e9 * _COLOURS_S), at_ns + half_ns
    ):
        pixels, contour = scene.add_image(image)
        if image.stamp_ns >= at_ns - half_ns:
            seconds = float(solved.seconds(np.array([image.stamp_ns]))[0])
            shifts = scene.measure(image.camera, pixels, contour)
            views[image.camera] = StaticView(image.camera, seconds, pixels, contour, shifts)
    if not views:
        raise StationError(
            f"{scene.recording}: has no image of its static cameras ({', '.join(scene.stations)}) in the middle of "
            f"{solved.path}; is it the recording that this was solved from?"
        )
    return tuple(views[name] for name in scene.stations if name in views)


def _images_between(recording: Path, cameras: Sequence[str], from_ns: int, until_ns: int) -> Iterator[CameraImage]:
    """The images of some cameras between two times, both included [ns]."""
    passed: set[str] = set()
    with open_recording(recording) as images:
        for image in images.images(cameras):
            if image.stamp_ns > until_ns:
                passed.add(image.camera)
                if len(passed) == len(cameras):
                    return
            elif image.stamp_ns >= from_ns:
                yield image


def draw_static_views(views: Sequence[StaticView], colours: Sequence[str], path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    columns = min(len(views), 2 if len(views) in (2, 4) else 3)
    rows = -(-len(views) // columns)
    width, height = max(2, columns) * _PANEL_INCHES, rows * (_PANEL_INCHES + _TITLE_INCHES) + _KEY_INCHES
    with open_picture(path, width, height) as figure:
        panels = figure.subplots(rows, columns, squeeze=False)
        for axes, view in zip(panels.flat, [*views, *[None] * panels.size], strict=False):
            axes.axis("off")
            if view is not None:
                _draw_view(axes, view, colours)
        figure.legend(handles=_key(), loc="lower center", ncols=7, labelcolor=QUIET, handlelength=1.4)
        figure.subplots_adjust(
            left=0.01, right=0.99, bottom=_KEY_INCHES / height, top=1.0 - _TITLE_INCHES / height, wspace=0.02,
            hspace=_TITLE_INCHES / _PANEL_INCHES,
        )  # fmt: skip


def _draw_view(axes: Axes, view: StaticView, colours: Sequence[str]) -> None:
    window = view.window
    picture = paint_contour(cut_out(view.image, window), view.contour, view.shifts, colours, window)
    axes.imshow(picture[..., ::-1], interpolation="lanczos")
    lines, shifts = len(view.shifts), view.shifts[np.isfinite(view.shifts)]
    note = f"{len(shifts)} of {lines} lines measured" if lines else "the body is not in the image"
    if len(shifts):
        note += f", off by {float(np.median(np.abs(shifts))):.2f} px (median)"
    panel_title(axes, view.station.replace("_", " "), f"{view.seconds:.2f} s, {note}")


def _key() -> list[Line2D]:
    line: dict[str, Any] = {"linewidth": 2.0}
    point: dict[str, Any] = {"linestyle": "", "marker": "o", "markersize": 4.0}
    area: dict[str, Any] = {"linestyle": "", "marker": "s", "markersize": 7.0, "alpha": 0.5}
    entries = (
        (f"force outward, {ENLARGED:g} times enlarged", OUTWARD, line), ("force inward", INWARD, line),
        ("contour", CONTOUR, point), ("without measurement", SILENT, point),
        ("surface: left", LEFT, area), ("right", RIGHT, area), ("equipment", EQUIPMENT, area),
    )  # fmt: skip
    return [Line2D([], [], color=colour, label=name, **style) for name, colour, style in entries]
