"""What one camera saw, with the wearer's limbs and the map's landmarks drawn where the body puts them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from viser import GuiApi

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.drawing.overlay import GOOD, GOOD_PX, Overlay
from bodycam_ros.drawing.picture_style import EQUIPMENT, WARNING, side_colour
from bodycam_ros.drawing.stick_figure import Bone
from bodycam_ros.geometry import Array
from bodycam_ros.outside.contour_painting import CONTOUR
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.view.inbox import Inbox, on_input, set_value
from bodycam_ros.view.scene_nodes import rgb

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
    overlay = Overlay.of(model, world_T_camera, limbs, matches)
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
