"""A camera's image with the body, its equipment and the landmarks projected into it, and drawn over it."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.stick_figure import Bone
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.colours import EQUIPMENT, WARNING, rgb, side_colour

GOOD, GOOD_PX = "#35e0c4", 3.0
"""Colour of landmarks within this distance [px] of their tracks; on grey images a light colour shows."""

_POINTS_PER_BONE = 40  # a straight line is bent in a fisheye image


def project_bone(model: CameraModel, world_T_camera: Array, bone: Bone) -> Array:
    """Pixels (K, 2) of a line of a body at one time [m], by a camera's pose (4, 4) [m]; NaN outside the lens."""
    along = np.linspace(0.0, 1.0, _POINTS_PER_BONE)[:, None]
    points_world = (1.0 - along) * bone.start + along * bone.end
    return model.project(transform_points(inverse(world_T_camera), points_world))[0]


def project_landmarks(model: CameraModel, world_T_camera: Array, matches: LandmarkMatches) -> tuple[Array, Array]:
    """Pixels (N, 2) of named tracks, as the image shows them, and of their landmarks; NaN outside the lens.

    Args:
        model: the camera's lens.
        world_T_camera: (4, 4) its solved pose [m].
        matches: landmarks that were found in the image.
    """
    shown, points_world = matches.shown.astype(np.float64), matches.points_world.astype(np.float64)
    # The pose is that of the middle row; other rows were moved by their read-out.
    middle = model.project(transform_points(inverse(world_T_camera), points_world))[0]
    return shown, middle + (shown - matches.pixels)


WIDTH = 640
"""Width of the picture [px]; a larger image is scaled down."""

_LANDMARK_PX = 3
_SHIFT = 4  # fraction bits of OpenCV's coordinates
_FAR_PX = 4000.0  # what falls further out is not drawn: OpenCV's coordinates are 32 bits


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """What to show of one camera at one time.

    Attributes:
        pixels: (H, W, 3) red, green, blue.
        error_px: median reprojection error of the landmarks [px]; NaN without landmarks.
        landmarks_world: (N, 3) matched landmarks [m].
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
) -> CameraPicture:
    """Draw one image.

    Args:
        image: of the camera.
        model: its lens.
        world_T_camera: (4, 4) where the body has it [m].
        limbs: lines of the body and its equipment at this one time [m].
        matches: landmarks that were matched in the image.

    Raises:
        RecordingError: the image cannot be decoded.
    """
    scale = min(1.0, WIDTH / model.width)
    size = (round(model.width * scale), round(model.height * scale))
    pixels = cv2.cvtColor(cv2.resize(decode_grey(image), size, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2RGB)
    draw_body(pixels, model, world_T_camera, limbs, 3, scale)
    landmarks, shown, projected = np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2))
    if matches is not None:
        landmarks = matches.points_world.astype(np.float64)
        shown, projected = project_landmarks(model, world_T_camera, matches)
    errors = np.linalg.norm(projected - shown, axis=1)
    is_good = errors <= GOOD_PX
    for ends in np.stack([shown, projected], axis=1)[~is_good]:
        draw_polyline(pixels, ends * scale, WARNING, 1)
    for chosen, colour in ((is_good, GOOD), (~is_good, WARNING)):
        for centre in _fixed(shown[chosen] * scale).tolist():
            cv2.circle(pixels, centre, _LANDMARK_PX << _SHIFT, rgb(colour), 1, cv2.LINE_AA, _SHIFT)
    known = errors[np.isfinite(errors)]
    return CameraPicture(np.asarray(pixels, np.uint8), float(np.median(known)) if len(known) else np.nan, landmarks)


def draw_body(
    pixels: NDArray[np.generic], model: CameraModel, world_T_camera: Array, bones: Iterable[Bone], width: int,
    scale: float = 1.0,
) -> None:  # fmt: skip
    """Draw limbs as lines of a width [px], and under them equipment half as wide, into an image of another scale."""
    for bone in sorted(bones, key=lambda bone: not bone.is_equipment):
        line = project_bone(model, world_T_camera, bone) * scale
        if bone.is_equipment:
            draw_polyline(pixels, line, EQUIPMENT, width // 2)
        else:
            draw_polyline(pixels, line, side_colour(bone.segment), width)


def draw_polyline(pixels: NDArray[np.generic], points: Array, colour: str, width: int, *, is_bgr: bool = False) -> None:
    """Draw the pieces of a line (N, 2) [px] whose ends are both near the image; NaN is outside the lens."""
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    near = pieces[(np.abs(pieces) < _FAR_PX).all(axis=(1, 2))]
    drawn = rgb(colour)[::-1] if is_bgr else rgb(colour)
    cv2.polylines(pixels, list(_fixed(near)), False, drawn, width, cv2.LINE_AA, _SHIFT)


def _fixed(points: Array) -> NDArray[np.int32]:
    return np.round(points * (1 << _SHIFT)).astype(np.int32)
