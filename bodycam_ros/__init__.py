"""Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.

``Body``, ``Map``, ``replay`` and the others in ``__all__`` are what another program needs (``library.py``).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bodycam_ros.library import Body, CameraImage, CameraModel, Map, Replay, StaticCameraFiles, extend_map, replay

__version__ = "0.1.0"
__all__ = ["Body", "CameraImage", "CameraModel", "Map", "Replay", "StaticCameraFiles", "extend_map", "replay"]


def __getattr__(name: str) -> Any:
    """Load the library with the first name of it: a command or a node needs little of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("bodycam_ros.library"), name)
