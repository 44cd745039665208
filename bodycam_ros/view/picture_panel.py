"""What one camera saw, and how well the body explains it."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from viser import GuiApi

from bodycam_ros.view.gui_value import on_input, set_value
from bodycam_ros.view.inbox import Inbox

_NO_CAMERA = "none"
_BLANK = np.full((12, 16, 3), 227, np.uint8)


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
