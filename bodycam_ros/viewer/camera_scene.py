"""The cameras: a pyramid on its segment for each, whose colour says whether the camera knew where it was."""

import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, GuiApi, MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import BodycamError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE
from bodycam_ros.plots.overlay import GOOD, GOOD_PX, project_overlay
from bodycam_ros.plots.picture_style import EQUIPMENT, WARNING, side_colour
from bodycam_ros.plots.stick_figure import Bone
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.camera_record import CameraLog
from bodycam_ros.results.topics import LANDMARKS, LANDMARKS_TYPE, camera_topics, contradictions_named
from bodycam_ros.static_cameras.contour_painting import CONTOUR
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.inbox import Inbox, on_input, set_value
from bodycam_ros.viewer.scene_nodes import LOST, REGISTERED, SELECTED, UNKNOWN, place, rgb, segment_name, when_clicked

_FIELD_OF_VIEW = np.radians(60.0)
"""Of the pyramids, from top to bottom: that of a wide angle lens would hide the body."""

_ASPECT = 4.0 / 3.0
_DEPTH_M = 0.07
_SHOWN_SCALE = 0.08  # of the one with an image in it, as viser has it: the pyramid is 0.15 m deep
_LINE_M = 0.005


class CameraScene:
    """Draws the cameras of a body."""

    def __init__(self, scene: SceneApi, body: BodyModel, on_click: Callable[[Part], None]) -> None:
        self._scene, self._body, self._on_click = scene, body, on_click
        self._selected: str | None = None
        self._shown: str | None = None
        self._is_visible = True
        self._picture: CameraFrustumHandle | None = None
        self._registered: dict[str, bool | None] = dict.fromkeys(body.mounts)
        self._cameras: dict[str, MeshHandle] = {}
        vertices, faces = _pyramid()
        for camera, mount in body.mounts.items():
            # Not a frustum of viser's: without a graphics card that takes four times as long to draw.
            pyramid = scene.add_mesh_simple(
                f"{segment_name(mount.segment)}/camera_{camera}",
                vertices,
                faces,
                color=rgb(UNKNOWN),
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
            when_clicked(pyramid, partial(on_click, Part("camera", camera)))
            self._cameras[camera] = pyramid
        self.remount(body)

    def remount(self, body: BodyModel) -> None:
        """Show the cameras where a body has them."""
        self._body = body
        for camera, mount in body.mounts.items():
            place(self._cameras[camera], mount.segment_T_camera)
        if self._picture is not None and self._shown is not None:
            place(self._picture, body.mounts[self._shown].segment_T_camera)

    def show_registered(self, camera: str, registered: bool | None) -> None:
        """Show whether a camera knows its own pose; None: nobody says."""
        if self._registered[camera] != registered:
            self._registered[camera] = registered
            self._colour(camera)

    def show_image(self, camera: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one camera's pyramid, larger than the others; None: no camera, no image."""
        if camera != self._shown:
            if self._picture is not None:
                self._picture.remove()
                self._picture = None
            self._shown = camera
            self._refresh()
        if camera is None:
            return
        if self._picture is None:
            self._picture = self._add_picture(camera)
        self._picture.image = pixels

    def select(self, part: Part | None) -> None:
        """Show which camera is selected."""
        before, self._selected = self._selected, part.name if part is not None and part.kind == "camera" else None
        for camera in (before, self._selected):
            if camera is not None:
                self._colour(camera)

    def show(self, visible: bool) -> None:
        """Show or hide all cameras."""
        self._is_visible = visible
        self._refresh()

    def _refresh(self) -> None:
        for camera, pyramid in self._cameras.items():
            pyramid.visible = self._is_visible and camera != self._shown
        if self._picture is not None:
            self._picture.visible = self._is_visible

    def _add_picture(self, camera: str) -> CameraFrustumHandle:
        mount = self._body.mounts[camera]
        frustum = self._scene.add_camera_frustum(
            f"{segment_name(mount.segment)}/picture_{camera}",
            _FIELD_OF_VIEW,
            _ASPECT,
            scale=_SHOWN_SCALE,
            thickness=_LINE_M,
            color=self._rgb(camera),
            cast_shadow=False,
            receive_shadow=False,
            visible=self._is_visible,
        )
        when_clicked(frustum, partial(self._on_click, Part("camera", camera)))
        place(frustum, mount.segment_T_camera)
        return frustum

    def _colour(self, camera: str) -> None:
        self._cameras[camera].color = self._rgb(camera)
        if self._picture is not None and camera == self._shown:
            self._picture.color = self._rgb(camera)

    def _rgb(self, camera: str) -> tuple[int, int, int]:
        state = {True: REGISTERED, False: LOST, None: UNKNOWN}[self._registered[camera]]
        return rgb(SELECTED if camera == self._selected else state)


def _pyramid() -> tuple[Array, NDArray[np.int32]]:
    """Vertices (5, 3) [m] and faces (6, 3) of a camera that looks along z, with y down: its tip is the lens."""
    half_height = _DEPTH_M * np.tan(_FIELD_OF_VIEW / 2.0)
    corners = [[x * _ASPECT * half_height, y * half_height, _DEPTH_M] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [[0, 1 + (side + 1) % 4, 1 + side] for side in range(4)]
    return np.array([[0.0, 0.0, 0.0], *corners]), np.array([*sides, [1, 2, 3], [1, 3, 4]], np.int32)


WIDTH = 640
"""Of the picture [px]; a larger image is made smaller, which a panel shows anyway."""

_NO_CAMERA = "none"
_BLANK = np.full((12, 16, 3), 227, np.uint8)
_CONTOUR_PX = 1
_SHIFT = 4  # fraction bits of OpenCV's coordinates
_FAR_PX = 4000.0  # what falls further out is not drawn: OpenCV's coordinates are 32 bits


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """What to show of one camera at one instant.

    Attributes:
        pixels: (H, W, 3) red, green, blue.
        error_px: median distance between where landmarks were seen and where the body's camera sees them [px]; NaN
            without landmarks.
        landmarks_world: (N, 3) those that the camera saw [m].
    """

    pixels: NDArray[np.uint8]
    error_px: float
    landmarks_world: Array


def draw_picture(
    image: CameraImage,
    model: CameraModel,
    world_T_camera: Array,
    limbs: list[Bone],
    matches: LandmarkMatches | None,
    contour: Array | None = None,
) -> CameraPicture:
    """Draw one image.

    Args:
        image: what the camera saw.
        model: its lens.
        world_T_camera: (4, 4) where the body puts it [m].
        limbs: lines of the body and its equipment at this one instant [m].
        matches: landmarks that were found in the image.
        contour: (N, 2) pixels where the body's surface ends, as a static camera looks for it.

    Raises:
        RecordingError: the image cannot be decoded.
    """
    scale = min(1.0, WIDTH / model.width)
    size = (round(model.width * scale), round(model.height * scale))
    grey = cv2.resize(decode_grey(image), size, interpolation=cv2.INTER_AREA)
    pixels = np.ascontiguousarray(np.repeat(np.asarray(grey, dtype=np.uint8)[:, :, None], 3, axis=2))
    overlay = project_overlay(model, world_T_camera, limbs, matches)
    for line in overlay.equipment:
        _draw_lines(pixels, scale * np.stack([line[:-1], line[1:]], axis=1), rgb(EQUIPMENT), 1)
    for segment, line in overlay.limbs:
        _draw_lines(pixels, scale * np.stack([line[:-1], line[1:]], axis=1), rgb(side_colour(segment)), 3)
    errors = overlay.errors
    good = errors <= GOOD_PX
    _draw_lines(pixels, np.stack([overlay.pixels, overlay.projected], axis=1)[~good] * scale, rgb(WARNING), 1)
    for centre, is_good in zip(_fixed(overlay.pixels * scale), good, strict=True):
        colour = rgb(GOOD if is_good else WARNING)
        cv2.circle(pixels, centre.tolist(), 3 << _SHIFT, colour, 1, cv2.LINE_AA, _SHIFT)
    for centre in [] if contour is None else _fixed((contour + 0.5) * scale - 0.5):
        cv2.circle(pixels, centre.tolist(), _CONTOUR_PX << _SHIFT, rgb(CONTOUR), cv2.FILLED, cv2.LINE_AA, _SHIFT)
    known = errors[np.isfinite(errors)]
    seen = np.zeros((0, 3)) if matches is None else matches.points_world.astype(np.float64)
    return CameraPicture(pixels, float(np.median(known)) if len(known) else float("nan"), seen)


class PicturePanel:
    """A list of cameras, and the image of the chosen one."""

    def __init__(
        self, gui: GuiApi, inbox: Inbox, cameras: Iterable[str], on_choice: Callable[[str | None], None]
    ) -> None:
        with gui.add_folder("Image"):
            self._camera = gui.add_dropdown("camera", (_NO_CAMERA, *cameras))
            self._image = gui.add_image(_BLANK, format="jpeg", visible=False)
            self._remark = gui.add_markdown("")

        on_input(self._camera, lambda: inbox.put(lambda: on_choice(self._chosen()), "camera"))

    def choose(self, camera: str | None) -> None:
        """Show which camera is chosen."""
        set_value(self._camera, _NO_CAMERA if camera is None else camera)

    def show(self, pixels: NDArray[np.uint8] | None, remark: str) -> None:
        """Show an image (H, W, 3), or none, and say something about it."""
        if pixels is not None:
            self._image.image = pixels
        self._image.visible = pixels is not None
        self._remark.content = remark

    def _chosen(self) -> str | None:
        return None if self._camera.value == _NO_CAMERA else self._camera.value


def _draw_lines(pixels: NDArray[np.uint8], ends: Array, colour: tuple[int, int, int], width: int) -> None:
    """Draw lines (N, 2, 2) whose ends are both near the image; NaN is nowhere."""
    drawn = ends[(np.abs(ends) < _FAR_PX).all(axis=(1, 2))]
    cv2.polylines(pixels, list(_fixed(drawn)), False, colour, width, cv2.LINE_AA, _SHIFT)


def _fixed(points: Array) -> NDArray[np.int32]:
    return np.round(points * (1 << _SHIFT)).astype(np.int32)


Bands = Mapping[str, tuple[Array, NDArray[np.int8]]]
"""Camera -> seconds (K,) of its images since the first instant, and a ``CameraSight`` for each."""


def read_bands(solved: Path, first_ns: int, cameras: Sequence[str]) -> Bands:
    """What the cameras of a solved bag knew.

    Args:
        solved: the bag.
        first_ns: the instant that seconds are counted from [ns].
        cameras: in the order that is wanted; others come after them.

    Raises:
        RecordingError: the bag or a message is damaged.
    """
    logs: dict[str, CameraLog] = defaultdict(CameraLog)
    with BagFile(solved) as bag:
        topics = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, TIMING, TIMING_TYPE)
        for topic, _, message in bag.messages(topics):
            with contradictions_named(solved, topic):
                logs[topics[topic]].add(topic, message, topics[topic])
    order = {camera: place for place, camera in enumerate(cameras)}
    named = sorted(logs, key=lambda camera: (order.get(camera, len(order)), camera))
    records = [logs[camera].record(camera) for camera in named if logs[camera].landmarks]
    return {of.camera: (np.asarray((of.stamps_ns - first_ns) * 1e-9, np.float64), of.sights) for of in records}


def load_bands(
    solved: Path,
    first_ns: int,
    cameras: Sequence[str],
    inbox: Inbox,
    on_loaded: Callable[[Bands], None],
    on_error: Callable[[BodycamError], None],
) -> None:
    """Begin to read them; what is read, or why it cannot be, is passed through the inbox."""

    def read() -> None:
        try:
            bands = read_bands(solved, first_ns, cameras)
        except BodycamError as error:
            failed = error
            inbox.put(lambda: on_error(failed))
            return
        inbox.put(lambda: on_loaded(bands))

    threading.Thread(target=read, daemon=True).start()
