"""Small images of all cameras at the time shown, read one after the other while nobody does anything."""

import cv2
import numpy as np
from numpy.typing import NDArray
from viser import PanelHandle

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import printable
from bodycam_ros.results.colours import rgb
from bodycam_ros.results.footage import Footage
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import LOST, REGISTERED, UNKNOWN
from bodycam_ros.viewer.server import LocalServer

WIDTH, HEIGHT = 160, 120
"""Size of one image [px]."""

_ACROSS = 4
_EDGE_PX = 4  # in the colour of the camera's state
_BLANK = 227
_FONT, _LARGEST = cv2.FONT_HERSHEY_SIMPLEX, 0.8  # the page shows an image half as wide


class Strip:
    """One picture, in which each camera has its place."""

    def __init__(
        self, server: LocalServer, cameras: tuple[str, ...], footage: Footage, motion: Motion, above: PanelHandle
    ) -> None:
        self._cameras, self._footage, self._motion = cameras, footage, motion
        self._index = 0
        self._due: list[str] = []
        rows = -(-len(cameras) // _ACROSS)
        self._pixels = np.full((rows * HEIGHT, min(_ACROSS, len(cameras)) * WIDTH, 3), 255, np.uint8)
        panel = server.gui.add_panel()
        with panel.add_tab("All cameras"):
            self._image = server.gui.add_image(self._pixels, format="jpeg")
        panel.dock_below(above)

    @property
    def picture(self) -> NDArray[np.uint8]:
        """(H, W, 3) as the page shows it."""
        return np.asarray(self._image.image)

    @property
    def is_due(self) -> bool:
        """Whether images of the time shown are yet to be read."""
        return bool(self._due)

    @property
    def is_begun(self) -> bool:
        """Whether some of them were read."""
        return len(self._due) < len(self._cameras)

    def show(self, index: int) -> None:
        """Ask for the images of one state."""
        self._index, self._due = index, list(self._cameras)

    def read_next(self) -> None:
        """Read one image that is due; the picture changes with the last one. A damaged image is named in its place."""
        camera = self._due.pop(0)
        row, column = divmod(self._cameras.index(camera), _ACROSS)
        place = self._pixels[row * HEIGHT : (row + 1) * HEIGHT, column * WIDTH : (column + 1) * WIDTH]
        place[:] = self._thumbnail(camera)
        if not self._due:
            self._image.image = self._pixels.copy()

    def _thumbnail(self, camera: str) -> NDArray[np.uint8]:
        motion, index = self._motion, self._index
        colour = UNKNOWN
        if camera in motion.registered:
            colour = LOST if motion.registered_at(camera, index) is None else REGISTERED
        try:
            image = self._footage.image_at(camera, int(motion.stamps_ns[index]), motion.frame_ns // 2)
            return draw_thumbnail(None if image is None else decode_grey(image), camera, colour)
        except RecordingError:  # its message is shown where the camera is chosen
            return draw_thumbnail(None, f"{camera}: damaged", colour)


def draw_thumbnail(grey: NDArray[np.uint8] | None, name: str, colour: str) -> NDArray[np.uint8]:
    """An image (H, W) as a whole, small, with the camera's name and an edge (HEIGHT, WIDTH, 3); None: no image."""
    thumbnail = np.full((HEIGHT, WIDTH, 3), _BLANK, np.uint8)
    if grey is not None:
        scale = min(WIDTH / grey.shape[1], HEIGHT / grey.shape[0])
        size = max(1, round(grey.shape[1] * scale)), max(1, round(grey.shape[0] * scale))
        small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        top, left = (HEIGHT - size[1]) // 2, (WIDTH - size[0]) // 2
        thumbnail[top : top + size[1], left : left + size[0]] = small[..., None]
    cv2.rectangle(thumbnail, (0, 0), (WIDTH - 1, HEIGHT - 1), rgb(colour), _EDGE_PX)
    text = printable(name).replace("_", " ")
    wide = cv2.getTextSize(text, _FONT, 1.0, 1)[0][0]
    font_scale = min(_LARGEST, (WIDTH - 4 * _EDGE_PX) / max(wide, 1))
    for ink, width in (((0, 0, 0), 4), ((255, 255, 255), 1)):
        cv2.putText(thumbnail, text, (2 * _EDGE_PX, HEIGHT - 12), _FONT, font_scale, ink, width, cv2.LINE_AA)
    return thumbnail
