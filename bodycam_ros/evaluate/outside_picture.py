"""Images of static cameras, with the solved body's surface, contour and forces painted over them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from threadpoolctl import threadpool_limits

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import StationError
from bodycam_ros.evaluate.overlay_picture import middle_stamp, pick_evenly
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.picture_style import EQUIPMENT, LEFT, QUIET, RIGHT, open_picture, panel_title, side_colour
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.shown import shown
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.contour_painting import (
    CONTOUR,
    ENLARGED,
    INWARD,
    OUTWARD,
    SILENT,
    Window,
    paint_contour,
)
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.station import Image, MeasuredContour, Station
from bodycam_ros.static_cameras.stations_file import check_stations_frame, read_stations
from bodycam_ros.static_cameras.surface_folder import surfaces_of


@dataclass(frozen=True)
class OutsideFiles:
    """Files of static cameras.

    Attributes:
        stations: file with their poses.
        surface: folder of the segments' meshes; None for capsules along the bones.
        map: that the recording was solved in; None where the stations' own frame is the world.
    """

    stations: Path
    surface: Path | None = None
    map: Path | None = None


class OutsideScene:
    """A solved body in the images of static cameras, whose colour models are updated at its poses.

    Attributes:
        stations: that the recording has images of, by name.
        body: as it was published, with its equipment.
        colours: of the segments' surfaces, as ``#rrggbb``.
    """

    def __init__(
        self, solved: SolvedRecording, body: BodyModel, surface: BodySurface, stations: Mapping[str, Station]
    ) -> None:
        self.stations, self.body = stations, body
        self.colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
        self._solved, self._surface = solved, surface
        self._poses = np.stack([solved.world_T_link[segment] for segment in body.segments])
        self._tracker = RegionTracker(body, surface, stations, RegionSettings())
        self._counts = dict.fromkeys(stations, 0)

    @classmethod
    def read(cls, solved: SolvedRecording, recording: Path, files: OutsideFiles) -> "OutsideScene":
        """Read the files.

        Raises:
            StationError: the stations cannot be used, the recording has none of them, or their frame is not known.
            BodyError: the surface cannot be used, or what was published is no body.
            RecordingError: not a recording.
            MapError, LensError: the map, or a lens, cannot be used.
        """
        body = solved.body
        stations = read_stations(files.stations, None if files.map is None else ReferenceMap.load(files.map))
        check_stations_frame(files.stations, solved.path, files.map)
        with open_recording(recording) as images:
            there = {name: station for name, station in stations.items() if name in images.cameras}
            if not there:
                raise StationError(
                    f"{recording} has no images of the static cameras of {files.stations} ({', '.join(stations)}); it "
                    f"has {', '.join(images.cameras)}"
                )
        surface = BodySurface.of(body, surfaces_of(body, solved.path, files.surface))
        return cls(solved, body, surface, there)

    def restarted(self) -> "OutsideScene":
        """The same without the colours of earlier images."""
        return OutsideScene(self._solved, self.body, self._surface, self.stations)

    def _poses_at(self, at_ns: int) -> Array:
        """(S, 4, 4) the solved segments at a time; outside the recording, at its nearest frame."""
        stamps_ns = self._solved.stamps_ns
        if len(stamps_ns) == 1:
            return np.asarray(self._poses[:, 0])
        inside = np.clip(np.array([at_ns]), stamps_ns[0], stamps_ns[-1])
        return np.stack([interpolated(stamps_ns, poses, inside)[0] for poses in self._poses])

    def add_image(self, image: CameraImage) -> tuple[Image, MeasuredContour]:
        """Update the colours of a static camera by an image; its pixels (H, W, 3), and the measured contour.

        The first images count alike, later ones by the learning rate.

        Raises:
            RecordingError: it cannot be decoded, or has another size than the camera's lens is for.
        """
        pixels, poses, view = decode_colour(image), self._poses_at(image.stamp_ns), self._tracker.views[image.camera]
        self._tracker.check_size(image.camera, pixels)
        self._counts[image.camera] += 1
        rate = max(1.0 / self._counts[image.camera], RegionSettings().learning_rate)
        contour = view.find_contour(poses)
        view.update_colours(pixels, contour, rate, np.ones(len(poses), bool))
        return pixels, view.measured_contour(pixels, contour)


STATIONS = 6
"""Static cameras that are shown, evenly picked."""

_LEARNED_S = 0.5
"""Images before the one shown that colours are learned from."""

_PANEL_INCHES, _TITLE_INCHES, _KEY_INCHES = 5.0, 0.35, 0.4
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
    contour: MeasuredContour
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
    at_ns = middle_stamp(solved)
    names = pick_evenly(list(scene.stations), STATIONS)
    found = _images_until(recording, names, at_ns - round(1e9 * _LEARNED_S), at_ns + solved.frame_ns // 2)
    views = []
    for station, images in found.items():
        if not images or images[-1].stamp_ns < at_ns - solved.frame_ns // 2:
            continue
        for image in images:
            pixels, contour = scene.add_image(image)
        seconds = float(solved.seconds(np.array([images[-1].stamp_ns]))[0])
        views.append(OutsideView(station, seconds, pixels, contour, scene.colours))
    return tuple(views)


def draw_outside(views: Sequence[OutsideView], path: Path) -> None:
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


def _draw_view(axes: Axes, view: OutsideView) -> None:
    picture = paint_contour(view.image, view.contour, view.colours, view.window)
    axes.imshow(picture[..., ::-1], interpolation="lanczos")
    shifts = view.contour.shifts[np.isfinite(view.contour.shifts)]
    note = "the body is not in the image"
    if len(view.contour.shifts):
        measured = f"{len(shifts)} of {len(view.contour.shifts)} lines measured"
        off = f", off by {float(np.median(np.abs(shifts))):.2f} px (median)" if len(shifts) else ""
        note = measured + off
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


_VIDEO_SHARP_PX = 720
"""Frames of the video that are less high are magnified."""


def check_station(scene: OutsideScene, station: str) -> None:
    """Check that a static camera exists.

    Raises:
        StationError: the recording has no static camera of this name.
    """
    if station not in scene.stations:
        raise StationError(
            f"--overlay-video {shown(station)}: is no static camera that the recording has images of; there are "
            f"{', '.join(scene.stations)}"
        )


def draw_outside_video(
    scene: OutsideScene, solved: SolvedRecording, recording: Path, station: str, path: Path, progress: Progress
) -> None:
    """Write the images of a static camera as MP4, at their own times, with the solved body painted into them.

    Raises:
        RecordingError: not a recording, or an image that cannot be decoded.
        StationError: there is no image of it.
        OutputError: the video cannot be written.
    """
    camera = scene.stations[station].camera
    window = Window(0, 0, camera.width, camera.height, -(-_VIDEO_SHARP_PX // camera.height))
    with (
        open_recording(recording) as images,
        progress.step(path.name, images.image_count(station)) as advance,
        video_writer(path, 1e9 / solved.frame_ns) as write,
        threadpool_limits(1, user_api="blas"),  # its threads would compete with decoding and compressing
    ):
        is_empty = True
        for image in images.images([station]):
            advance()
            if not solved.stamps_ns[0] <= image.stamp_ns <= solved.stamps_ns[-1]:
                continue
            painted = paint_contour(*scene.add_image(image), scene.colours, window)
            write(1e-9 * (image.stamp_ns - int(solved.stamps_ns[0])), painted)
            is_empty = False
        if is_empty:
            raise StationError(f"{recording}: has no image of {station} from the time that {solved.path} has")
