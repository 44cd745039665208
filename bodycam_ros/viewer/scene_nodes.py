"""Names, poses and colours of what is in the scene; the colours are those of all pictures."""

from collections.abc import Callable

import numpy as np
from viser import CameraFrustumHandle, IcosphereHandle, LabelHandle, MeshHandle, SceneApi, SceneNodeHandle

from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.picture_style import QUIET, WARNING, rgb, side_colour

WORLD = "/world"
"""Name of the map's frame in the scene."""

REGISTERED, LOST, UNKNOWN = "#2c7f78", WARNING, QUIET
"""A camera that is registered at the time shown, one that is not, one without registrations in the recording."""

SELECTED = "#f2c200"
"""The part that is being moved; no side of the body, no state of a camera and no axis is yellow."""

GRID_FINE, GRID = "#e3e7ea", "#b9c1c8"

_LABEL_SCALE = 0.7


def segment_rgb(segment: str) -> tuple[int, int, int]:
    """Colour of a segment's side."""
    return rgb(side_colour(segment))


def segment_name(segment: str) -> str:
    """Name of a segment's frame in the scene."""
    return f"{WORLD}/body/{segment}"


def place(handle: SceneNodeHandle, parent_T_node: Array) -> None:
    """Put a node of the scene at a pose (4, 4) in its parent [m]."""
    handle.position = parent_T_node[:3, 3]
    handle.wxyz = np.roll(quaternion_xyzw(parent_T_node[:3, :3]), 1)


def add_label(scene: SceneApi, name: str, text: str) -> LabelHandle:
    """Add a hidden label with the words of a name."""
    return scene.add_label(
        name, text.replace("_", " "), visible=False, font_screen_scale=_LABEL_SCALE, anchor="center-left"
    )


def when_clicked(handle: IcosphereHandle | MeshHandle | CameraFrustumHandle, act: Callable[[], None]) -> None:
    """Call ``act()`` when a person clicks a node of the scene."""

    async def clicked(_: object) -> None:
        act()

    handle.on_click(clicked)
