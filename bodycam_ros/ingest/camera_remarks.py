"""Tables of what is said of cameras, and the lines that they become where a person reads them."""

from collections.abc import Iterable, Mapping

Causes = Mapping[str, str]
"""Camera -> why it is so with it; the text does not name the camera."""

CameraRemark = tuple[str, str]
"""A camera, and a remark on it that does not name it."""


def remark_lines(remarks: Iterable[CameraRemark]) -> list[str]:
    """A line for each remark, which names its camera."""
    return [f"camera {camera}: {remark}" for camera, remark in remarks]


def left_out_lines(causes: Causes) -> list[str]:
    """A line for each camera that is not in the bag, with the cause."""
    return remark_lines((camera, left_out(why)) for camera, why in causes.items())


def left_out(why: str) -> str:
    """What is said of a camera that is not in the bag; the doctor of videos says it as well."""
    return f"left out: {why}"
