"""Images of some body cameras at one time, with landmarks and limbs of the solved body drawn over them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import EQUIPMENT, QUIET, WARNING, open_picture, panel_title, side_colour
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.results.body_motion import pose_near
from bodycam_ros.results.camera_record import CameraRecord
from bodycam_ros.results.overlay import GOOD, GOOD_PX, Overlay, project_overlay
from bodycam_ros.results.solved_recording import SolvedRecording

Item = TypeVar("Item")

_CAMERAS, _COLUMNS = 6, 3  # that are shown, spread over the body
_LATEST_S = 20.0  # the middle of the recording is shown, but nothing later: bags are read from their start
_PANEL_INCHES = (5.3, 4.3)
_WHITE_PERCENTILE = 99.5


@dataclass(frozen=True, eq=False)
class OverlayView:
    """One image.

    Attributes:
        camera: name.
        seconds: since the start of the recording.
        registered: whether the camera was registered.
        image: (H, W) grey.
        overlay: projections of the solved body and the map.
    """

    camera: str
    seconds: float
    registered: bool
    image: NDArray[np.uint8]
    overlay: Overlay


def middle_stamp(solved: SolvedRecording) -> int:
    """Stamp of the state nearest to the middle of the recording, or to ``_LATEST_S`` [ns]."""
    middle_ns = min((solved.start_ns + solved.end_ns) // 2, solved.start_ns + round(1e9 * _LATEST_S))
    return int(solved.stamps_ns[np.argmin(np.abs(solved.stamps_ns - middle_ns))])


def pick_evenly(items: Sequence[Item], count: int) -> list[Item]:
    """At most so many items, evenly spread, the first and the last among them."""
    rows = np.linspace(0, len(items) - 1, min(count, len(items))).round().astype(int)
    return [items[row] for row in np.unique(rows)]


def overlay_views(solved: SolvedRecording, recording: Path) -> tuple[OverlayView, ...]:
    """The views of some cameras at one time in the middle of the recording.

    Args:
        solved: the body.
        recording: the bag that it was solved from.

    Raises:
        RecordingError: not a recording, or an image that cannot be decoded.
        LensError: the recording's intrinsics cannot be used.
    """
    at_ns, views = middle_stamp(solved), []
    with open_recording(recording) as images:
        known = [(record, poses) for record, poses in solved.solved_cameras() if record.camera in images.cameras]
        for record, poses in pick_evenly(known, _CAMERAS):
            image = _image_near(images, record, at_ns, solved.frame_ns)
            if image is not None:
                views.append(_view(solved, record, poses, image, images))
    return tuple(view for view in views if view is not None)


def _image_near(images: Recording, record: CameraRecord, at_ns: int, frame_ns: int) -> CameraImage | None:
    """The camera's image within half a frame of a time, if there is one."""
    early_ns = at_ns - frame_ns // 2
    given_ns = 2 * early_ns - _time_of(record, early_ns)  # by the camera's own clock
    image = images.first_image(record.camera, given_ns)
    is_near = image is not None and _time_of(record, image.stamp_ns) <= at_ns + frame_ns // 2
    return image if is_near else None


def _time_of(record: CameraRecord, stamp_ns: int) -> int:
    """A stamp by the camera's own clock, as a time of the recording [ns]."""
    return int(record.time_of(np.array([stamp_ns]))[0])


def _view(
    solved: SolvedRecording, record: CameraRecord, world_T_camera: Array, image: CameraImage, images: Recording
) -> OverlayView | None:
    """The view of an image; None without a registration message of it."""
    time_ns = _time_of(record, image.stamp_ns)
    found = (each for each in solved.landmarks((record.camera,)) if each.stamp_ns == time_ns)
    if (matches := next(found, None)) is None:
        return None
    is_placed = solved.placed[np.abs(solved.stamps_ns - time_ns).argmin()]
    bones = solved.bones(solved.segments_near(time_ns)[None])
    camera = pose_near(solved.stamps_ns, world_T_camera, time_ns)
    limbs = [bone for bone in bones if is_placed or not bone.is_equipment]
    return OverlayView(
        camera=record.camera,
        seconds=float(solved.seconds(np.array([time_ns]))[0]),
        registered=matches.world_T_camera is not None,
        image=decode_grey(image),
        overlay=project_overlay(images.camera_model(record.camera), camera, limbs, matches),
    )


def draw_overlays(views: Sequence[OverlayView], path: Path) -> None:
    """Write the picture as PNG: a point per named track, a line to its landmark, limbs in their side's colour.

    Raises:
        OSError: the file cannot be written.
    """
    rows = -(-_CAMERAS // _COLUMNS)
    with open_picture(path, _COLUMNS * _PANEL_INCHES[0], rows * _PANEL_INCHES[1]) as figure:
        for axes, view in zip(figure.subplots(rows, _COLUMNS).flat, [*views, *[None] * _CAMERAS], strict=False):
            axes.axis("off")
            if view is not None:
                _draw_view(axes, view)
        note = (
            f"Points: named tracks, green if the landmark falls within {GOOD_PX:g} px in the solved pose, else red "
            "with a line to where it falls. Thick lines: the person's limbs as solved; thin ones: equipment."
        )
        figure.text(0.015, 0.012, note, color=QUIET)
        figure.subplots_adjust(left=0.015, right=0.985, top=0.95, bottom=0.045, wspace=0.04, hspace=0.14)


def _draw_view(axes: Axes, view: OverlayView) -> None:
    height, width = view.image.shape
    overlay, errors = view.overlay, view.overlay.errors
    brightest = max(float(np.percentile(view.image, _WHITE_PERCENTILE)), 1.0)  # images may be dark
    axes.imshow(view.image, cmap="gray", vmin=0.0, vmax=brightest, interpolation="nearest")
    for line in overlay.equipment:
        axes.plot(*line.T, color=EQUIPMENT, linewidth=1.5, alpha=0.9, solid_capstyle="round")
    for segment, line in overlay.limbs:
        axes.plot(*line.T, color=side_colour(segment), linewidth=3.0, alpha=0.75, solid_capstyle="round")
    good = errors <= GOOD_PX
    lines = np.stack([overlay.pixels, overlay.projected], axis=1)
    axes.add_collection(LineCollection(list(lines[~good]), colors=WARNING, linewidths=0.9))
    colours = np.where(good, GOOD, WARNING).tolist()
    axes.scatter(
        overlay.pixels[:, 0], overlay.pixels[:, 1], s=9.0, facecolors="none", edgecolors=colours, linewidths=1.0
    )
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    state = "" if view.registered else ", LOST"
    error = f", {np.nanmedian(errors):.2f} px median" if len(overlay.pixels) else ""
    note = f"{view.seconds:.2f} s, {len(overlay.pixels)} landmarks{error}{state}"
    panel_title(axes, view.camera.replace("_", " "), note)
