"""Images of static cameras with the solved body's surface, contour and forces over them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
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
    cut_out,
    paint_contour,
    square_window,
)
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.station import Image
from bodycam_ros.static_cameras.stations_file import check_stations_frame, read_stations
from bodycam_ros.static_cameras.surface import BodySurface
from bodycam_ros.static_cameras.surface_folder import surfaces_of

_CAMERAS = 6  # that the picture shows, evenly picked
_COLOURS_S = 0.5  # of images before the one shown, which the colour models are updated by
_PANEL_INCHES, _TITLE_INCHES, _KEY_INCHES = 5.0, 0.35, 0.4
_SHARP_PX = 640  # a panel is magnified to at least as many pixels


@dataclass(frozen=True, eq=False)
class StaticView:
    """A part of one image with the body painted into it.

    Attributes:
        station: name.
        note: when it was taken, and how well the contour of the body fits it.
        picture: (H, W, 3) blue, green, red.
    """

    station: str
    note: str
    picture: Image


def static_views(
    solved: SolvedRecording, recording: Path, files: StaticCameraFiles, map_path: Path | None
) -> tuple[StaticView, ...]:
    """The views of some static cameras at one time in the middle of the recording.

    Args:
        solved: the body.
        recording: bag with the images.
        files: of the static cameras.
        map_path: that the recording was solved in; None where the stations' own frame is the world.

    Raises:
        StationError: the stations cannot be used, the recording has no images of them, or their frame is not known.
        BodyError: the surface cannot be used.
        RecordingError: not a recording, or an image that cannot be decoded or is not of its lens's size.
        MapError, LensError: the map, or a lens, cannot be used.
    """
    tracker, body, settings = _tracker(solved, recording, files, map_path), solved.body, RegionSettings()
    colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
    at_ns, half_ns = middle_stamp(solved), solved.frame_ns // 2
    shown: dict[str, StaticView] = {}
    counts: Counter[str] = Counter()
    for image in _images_between(
        recording, pick_evenly(list(tracker.views), _CAMERAS), at_ns - round(1e9 * _COLOURS_S), at_ns + half_ns
    ):
        pixels, view = decode_colour(image), tracker.views[image.camera]
        view.station.check_size(pixels)
        contour = view.find_contour(solved.segments_near(image.stamp_ns))
        counts[image.camera] += 1  # the first images count alike, later ones by the learning rate
        rate = max(1.0 / counts[image.camera], settings.learning_rate)
        view.update_colours(pixels, contour, rate, np.ones(len(body.segments), bool))
        if image.stamp_ns >= at_ns - half_ns:
            seconds = float(solved.seconds(np.array([image.stamp_ns]))[0])
            shifts = view.measure(pixels, contour, 1).shifts
            window = square_window(pixels, contour.covered)
            window = replace(window, times=-(-_SHARP_PX // window.width))
            picture = paint_contour(cut_out(pixels, window), contour, shifts, colours, window)
            shown[image.camera] = StaticView(image.camera, f"{seconds:.2f} s, {_note(shifts)}", picture)
    if not shown:
        raise StationError(
            f"{recording}: has no image of its static cameras ({', '.join(tracker.views)}) in the middle of "
            f"{solved.path}; is it the recording that this was solved from?"
        )
    return tuple(shown[name] for name in tracker.views if name in shown)


def _tracker(
    solved: SolvedRecording, recording: Path, files: StaticCameraFiles, map_path: Path | None
) -> RegionTracker:
    """The static cameras that a recording has images of, with the solved body."""
    stations = read_stations(files.stations, None if map_path is None else ReferenceMap.load(map_path))
    check_stations_frame(files.stations, solved.path, map_path)
    with open_recording(recording) as images:
        there = {name: station for name, station in stations.items() if name in images.cameras}
        if not there:
            raise StationError(
                f"{recording} has no images of the static cameras of {files.stations} ({', '.join(stations)}); it "
                f"has {', '.join(images.cameras)}"
            )
    surface = BodySurface.of(solved.body, surfaces_of(solved.body, solved.path, files.surface))
    return RegionTracker(solved.body, surface, there, RegionSettings())


def _note(shifts: Array) -> str:
    known = shifts[np.isfinite(shifts)]
    if not len(shifts):
        return "the body is not in the image"
    note = f"{len(known)} of {len(shifts)} lines measured"
    return f"{note}, off by {float(np.median(np.abs(known))):.2f} px (median)" if len(known) else note


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


def draw_static_views(views: Sequence[StaticView], path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    columns = min(len(views), 2 if len(views) in (2, 4) else 3)
    rows = -(-len(views) // columns)
    width, height = max(2, columns) * _PANEL_INCHES, rows * (_PANEL_INCHES + _TITLE_INCHES) + _KEY_INCHES
    with open_picture(path, width, height) as figure:
        for axes, view in zip(figure.subplots(rows, columns, squeeze=False).flat, [*views, *[None] * 2], strict=False):
            axes.axis("off")
            if view is not None:
                axes.imshow(view.picture[..., ::-1], interpolation="lanczos")
                panel_title(axes, view.station.replace("_", " "), view.note)
        figure.legend(handles=_key(), loc="lower center", ncols=7, labelcolor=QUIET, handlelength=1.4)
        figure.subplots_adjust(
            left=0.01, right=0.99, bottom=_KEY_INCHES / height, top=1.0 - _TITLE_INCHES / height, wspace=0.02,
            hspace=_TITLE_INCHES / _PANEL_INCHES,
        )  # fmt: skip


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
