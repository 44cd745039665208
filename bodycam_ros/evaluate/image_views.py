"""Images of body cameras and of static ones at one time, with the solved body painted into them."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.lines import Line2D

from bodycam_ros.body.surface import BodySurface
from bodycam_ros.body.surface_folder import surfaces_of
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import RecordingError, StaticCameraError
from bodycam_ros.formats.static_cameras_file import check_static_cameras_frame, read_static_cameras
from bodycam_ros.geometry import Array
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.body_motion import pose_near
from bodycam_ros.results.camera_picture import GOOD, GOOD_PX, draw_picture, project_bone
from bodycam_ros.results.colours import CENTRE, EQUIPMENT, LEFT, QUIET, RIGHT, WARNING, side_colour
from bodycam_ros.results.footage import Footage
from bodycam_ros.results.picture_style import open_picture, panel_title
from bodycam_ros.results.provenance import warn_of_differences
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.static_cameras import contour_painting as painting
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import Image, RegionModel

Item = TypeVar("Item")
Key = Sequence[tuple[str, str]]
"""Meaning and colour of what is painted."""

_CAMERAS = 6  # that are shown
_COLOURS_S = 0.5  # of images before the one shown, which the colour models are updated by
_PANEL_INCHES, _TITLE_INCHES, _KEY_INCHES = 5.0, 0.35, 0.4
_SHARP_PX = 640  # a panel is magnified to at least as many pixels

BODY_KEY: Key = (
    (f"landmark within {GOOD_PX:g} px of its track", GOOD), ("farther off", WARNING), ("left", LEFT), ("right", RIGHT),
    ("trunk", CENTRE), ("equipment", EQUIPMENT),
)  # fmt: skip
STATIC_KEY: Key = (
    (f"force outward, {painting.ENLARGED:g} times enlarged", painting.OUTWARD), ("force inward", painting.INWARD),
    ("contour", painting.CONTOUR), ("without measurement", painting.SILENT), ("surface: left", LEFT), ("right", RIGHT),
    ("equipment", EQUIPMENT),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ImageView:
    """One image, or a part of it, with the body painted into it.

    Attributes:
        camera: name.
        note: when it was taken, and how well the body fits it.
        pixels: (H, W, 3) red, green, blue.
    """

    camera: str
    note: str
    pixels: Image


def middle_stamp(solved: SolvedRecording) -> int:
    """Stamp of the state nearest to the middle of the recording [ns]."""
    middle_ns = (solved.start_ns + solved.end_ns) // 2
    return int(solved.stamps_ns[np.argmin(np.abs(solved.stamps_ns - middle_ns))])


def _pick_evenly(items: Sequence[Item]) -> list[Item]:
    """At most ``_CAMERAS`` items, evenly spread, the first and the last among them."""
    rows = np.linspace(0, len(items) - 1, min(_CAMERAS, len(items))).round().astype(int)
    return [items[row] for row in np.unique(rows)]


def _pick_best(items: Sequence[Item], values: Sequence[float]) -> list[Item]:
    """At most ``_CAMERAS`` items, of the largest values, in their order; evenly spread where all values are zero."""
    if not any(values):
        return _pick_evenly(items)
    best = sorted(range(len(items)), key=lambda row: -values[row])[:_CAMERAS]
    return [items[row] for row in sorted(best)]


def _share_of_limbs(solved: SolvedRecording, model: CameraModel, world_T_camera: Array, at_ns: int) -> float:
    """Share of the body's lines that lies in an image, of a camera at a pose (4, 4) [m]."""
    bones = [bone for bone in solved.bones(solved.segments_near(at_ns)[None]) if not bone.is_equipment]
    pixels = np.concatenate([np.zeros((0, 2)), *(project_bone(model, world_T_camera, bone.at(0)) for bone in bones)])
    if not len(pixels):
        return 0.0
    return float(np.all((pixels >= 0.0) & (pixels < [model.width, model.height]), axis=1).mean())  # NaN is outside


def body_camera_views(solved: SolvedRecording, recording: Path) -> Iterator[ImageView]:
    """The views of the body cameras that see most of the limbs, at one time in the middle of the recording.

    Args:
        solved: the body.
        recording: the bag that it was solved from.

    Raises:
        RecordingError: not a recording, not that of ``solved``, or an image that cannot be decoded.
        LensError: the recording's intrinsics cannot be used.
    """
    at_ns = middle_stamp(solved)
    with closing(Footage(recording, solved.path)) as footage:
        known = [(record, poses) for record, poses in solved.solved_cameras() if record.camera in footage.cameras]
        if known and not any(np.isin(record.stamps_ns, footage.times_ns(record.camera)).any() for record, _ in known):
            raise RecordingError(f"{recording}: is not what {solved.path} was solved from: it has none of its images")
        seen = [
            _share_of_limbs(solved, footage.model(record.camera), pose_near(solved.stamps_ns, poses, at_ns), at_ns)
            for record, poses in known
        ]
        for record, poses in _pick_best(known, seen):
            image = footage.image_at(record.camera, at_ns, solved.frame_ns // 2)
            if image is None or (matches := footage.matches_of(image)) is None:
                continue
            time_ns = int(record.time_of(np.array([image.stamp_ns]))[0])
            is_placed = solved.placed[np.abs(solved.stamps_ns - time_ns).argmin()]
            bones = solved.bones(solved.segments_near(time_ns)[None])
            picture = draw_picture(
                image,
                footage.model(record.camera),
                pose_near(solved.stamps_ns, poses, time_ns),
                [bone for bone in bones if is_placed or not bone.is_equipment],
                matches,
            )
            error = f", {picture.error_px:.2f} px median" if np.isfinite(picture.error_px) else ""
            state = "" if matches.world_T_camera is not None else ", LOST"
            seconds = float(solved.seconds(np.array([time_ns]))[0])
            note = f"{seconds:.2f} s, {len(matches.pixels)} landmarks{error}{state}"
            yield ImageView(record.camera, note, picture.pixels)


def static_camera_views(
    solved: SolvedRecording, recording: Path, files: StaticCameraFiles, map_path: Path | None
) -> tuple[ImageView, ...]:
    """The views of some static cameras at one time in the middle of the recording.

    Args:
        solved: the body.
        recording: bag with the images.
        files: of the static cameras.
        map_path: that the recording was solved in; None where the stations' own frame is the world.

    Raises:
        StaticCameraError: they cannot be used, the recording has no images of them, or their frame is unknown.
        BodyError: the surface cannot be used.
        RecordingError: not a recording, or an image that cannot be decoded or is not of its lens's size.
        MapError, LensError: the map, or a lens, cannot be used.
    """
    reference_map = None if map_path is None else ReferenceMap.load(map_path)
    stations = read_static_cameras(files.stations, reference_map)
    check_static_cameras_frame(files.stations, solved.path, map_path)
    if reference_map is not None and map_path is not None:
        warn_of_differences(solved.path, (reference_map, map_path))
    body = solved.body
    at_ns = middle_stamp(solved)
    views = []
    surface = BodySurface.of(body, surfaces_of(body, solved.path, files.surface))
    with closing(Footage(recording, solved.path)) as footage:
        there = {name: station for name, station in stations.items() if name in footage.cameras}
        if not there:
            raise StaticCameraError(
                f"{recording} has no images of the static cameras of {files.stations} ({', '.join(stations)}); it "
                f"has {', '.join(footage.cameras)}"
            )
        regions = RegionTracker(body, surface, there, RegionSettings()).views
        for name in _pick_evenly(list(regions)):
            stamps_ns, half_ns = footage.times_ns(name), solved.frame_ns // 2
            near = stamps_ns[(stamps_ns >= at_ns - round(1e9 * _COLOURS_S)) & (stamps_ns <= at_ns + half_ns)]
            images = [footage.image_at(name, stamp_ns, 0) for stamp_ns in near.tolist()]
            if len(near) and near[-1] >= at_ns - half_ns:
                views.append(_static_camera_view(solved, regions[name], [each for each in images if each is not None]))
    if not views:
        raise StaticCameraError(
            f"{recording}: has no image of its static cameras ({', '.join(there)}) in the middle of {solved.path}; "
            "give the recording that this was solved from"
        )
    return tuple(views)


def _static_camera_view(solved: SolvedRecording, view: RegionModel, images: Sequence[CameraImage]) -> ImageView:
    """The view of the last of some successive images; colour models are updated by all of them."""
    body, settings = solved.body, RegionSettings()
    for count, image in enumerate(images, start=1):
        pixels = decode_colour(image)
        view.station.check_size(pixels)
        contour = view.find_contour(solved.segments_near(image.stamp_ns))
        rate = max(1.0 / count, settings.learning_rate)  # the first images count alike
        view.update_colours(pixels, contour, rate, np.ones(len(body.segments), bool))
    seconds = float(solved.seconds(np.array([image.stamp_ns]))[0])
    shifts = view.measure(pixels, contour, 1).shifts
    window = painting.square_window(pixels, contour.covered)
    window = replace(window, times=-(-_SHARP_PX // window.width))
    colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
    picture = painting.paint_contour(painting.cut_out(pixels, window), contour, shifts, colours, window)
    return ImageView(image.camera, f"{seconds:.2f} s, {_note(shifts)}", picture[..., ::-1])


def _note(shifts: Array) -> str:
    known = shifts[np.isfinite(shifts)]
    if not len(shifts):
        return "the body is not in the image"
    note = f"{len(known)} of {len(shifts)} lines measured"
    return f"{note}, off by {float(np.median(np.abs(known))):.2f} px (median)" if len(known) else note


def draw_views(views: Sequence[ImageView], key: Key, path: Path) -> None:
    """Write views side by side, with a key below them, as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    columns = min(len(views), 2 if len(views) in (2, 4) else 3)
    rows = -(-len(views) // columns)
    tallest = max(view.pixels.shape[0] / view.pixels.shape[1] for view in views) * _PANEL_INCHES
    width, height = max(2, columns) * _PANEL_INCHES, rows * (tallest + _TITLE_INCHES) + _KEY_INCHES
    with open_picture(path, width, height) as figure:
        for axes, view in zip(figure.subplots(rows, columns, squeeze=False).flat, [*views, *[None] * 2], strict=False):
            axes.axis("off")
            if view is not None:
                axes.imshow(view.pixels, interpolation="lanczos")
                panel_title(axes, view.camera.replace("_", " "), view.note)
        handles = [Line2D([], [], color=colour, label=meaning, linewidth=3.0) for meaning, colour in key]
        figure.legend(handles=handles, loc="lower center", ncols=len(key), labelcolor=QUIET, handlelength=1.0)
        figure.subplots_adjust(
            left=0.01, right=0.99, bottom=_KEY_INCHES / height, top=1.0 - _TITLE_INCHES / height, wspace=0.02,
            hspace=_TITLE_INCHES / tallest,
        )  # fmt: skip
