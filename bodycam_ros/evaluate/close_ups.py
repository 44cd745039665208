"""Close-ups of what equipment holds as a static camera sees it: the body with the constraint and without (B fig. 9)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.evaluate.held_points import WithAndWithout
from bodycam_ros.evaluate.outside_picture import OutsideFiles, OutsideScene
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.plots.picture_style import EQUIPMENT
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.static_cameras.contour_painting import Window, bgr, paint_contour
from bodycam_ros.static_cameras.station import Image, Station

COLUMNS = 4
"""Instants that are shown, one of each part of the recording: where the constraint changes most."""

_ROOM = 1.25  # of the window around what is held
_SMALLEST_PX = 90
_AROUND_M = 0.1  # of a held point that is to be seen: about a foot
_SHARP_PX = 480  # a close-up is magnified to at least as many pixels
_LATEST_S = 20.0  # bags are read from their start


@dataclass(frozen=True, eq=False)
class CloseUp:
    """One instant.

    Attributes:
        station: that sees it.
        seconds: since the start of the recording.
        with_it, without: pictures (H, W, 3), blue green red.
        off_mm: (with, without) of the point that is furthest off without.
    """

    station: str
    seconds: float
    with_it: Image
    without: Image
    off_mm: tuple[float, float]


def close_ups(both: WithAndWithout, recording: Path, files: OutsideFiles) -> tuple[CloseUp, ...]:
    """Close-ups by the camera that sees what is held from nearest.

    Raises:
        StationError, BodyError, MapError, LensError: stations, surface or map cannot be used.
        RecordingError: not a recording, or an image that cannot be decoded.
    """
    scenes = (OutsideScene.read(both.solved, recording, files), OutsideScene.read(both.other, recording, files))
    station = _nearest(both, scenes[0])
    instants = _instants(both)
    found = []
    for instant, image in _images(both, recording, station.name, instants):
        pixels = scenes[0].decoded(image)
        window = _window(both, station, instant)
        pictures = [_painted(scene, station.name, pixels, int(both.stamps_ns[instant]), window) for scene in scenes]
        for picture, whose in zip(pictures, ("with_it", "without"), strict=True):
            for point in both.firm:
                ends = [_pixel(station, at[instant]) for at in (point.held_at, getattr(point, whose))]
                _mark(picture, window, ends)
        worst = max(both.firm, key=lambda point: float(point.off_without[instant]))
        off = (1e3 * float(worst.off_with[instant]), 1e3 * float(worst.off_without[instant]))
        seconds = float(both.solved.seconds(both.stamps_ns[[instant]])[0])
        found.append(CloseUp(station.name, seconds, pictures[0], pictures[1], off))
    return tuple(found)


def _nearest(both: WithAndWithout, scene: OutsideScene) -> Station:
    """The station that has held points in its image most often, and of such the nearest."""

    def rank(station: Station) -> tuple[float, float]:
        points = np.concatenate([point.held_at for point in both.firm])
        here = transform_points(inverse(station.world_T_camera), points)
        pixels, valid = station.camera.project(here)
        size = [station.camera.width, station.camera.height]
        inside = valid & (pixels > 0.0).all(axis=1) & (pixels < size).all(axis=1)
        return float(np.round(inside.mean(), 1)), -float(np.linalg.norm(here, axis=1).mean())

    return max(scene.stations.values(), key=rank)


def _instants(both: WithAndWithout) -> list[int]:
    """The instant of each part of the recording at which a point is furthest off without the constraint."""
    seconds = 1e-9 * (both.stamps_ns - both.solved.start_ns)
    early = np.flatnonzero(seconds <= max(_LATEST_S, float(seconds[0])))
    worst = np.max([point.off_without for point in both.firm], axis=0)
    parts = [part for part in np.array_split(early, min(COLUMNS, len(early))) if len(part)]
    return [int(part[np.argmax(worst[part])]) for part in parts]


def _images(
    both: WithAndWithout, recording: Path, station: str, instants: Sequence[int]
) -> list[tuple[int, CameraImage]]:
    """The images of a station nearest to some instants, of those that it has."""
    found: list[tuple[int, CameraImage]] = []
    waiting = list(instants)
    with open_recording(recording) as images:
        for image in images.images([station]):
            while waiting and image.stamp_ns > both.stamps_ns[waiting[0]] + both.solved.frame_ns // 2:
                waiting.pop(0)
            if not waiting:
                break
            if abs(image.stamp_ns - int(both.stamps_ns[waiting[0]])) <= both.solved.frame_ns // 2:
                found.append((waiting.pop(0), image))
    return found


def _window(both: WithAndWithout, station: Station, instant: int) -> Window:
    """A square around all that is held."""
    places = np.concatenate([[p.held_at[instant], p.with_it[instant], p.without[instant]] for p in both.firm])
    pixels = np.array([_pixel(station, place) for place in places])
    depth = float(transform_points(inverse(station.world_T_camera), places)[:, 2].mean())
    around = 2.0 * _AROUND_M / max(depth, 0.1) * float(station.camera.width) / 2.0
    side = max(_SMALLEST_PX, round(_ROOM * float(np.ptp(pixels, axis=0).max()) + around))
    left, top = np.rint(pixels.mean(axis=0) - side / 2.0).astype(int).tolist()
    return Window(left, top, side, side, -(-_SHARP_PX // side))


def _painted(scene: OutsideScene, station: str, pixels: Image, stamp_ns: int, window: Window) -> Image:
    """The body's surface and contour, without forces: these are of the tracker, not of the constraint."""
    contour = scene.contour(station, pixels, scene.poses_at(stamp_ns))
    return paint_contour(pixels, replace(contour, shifts=np.zeros(len(contour.shifts))), scene.colours, window)


def _pixel(station: Station, place: Array) -> Array:
    here = transform_points(inverse(station.world_T_camera), place[None])
    return np.asarray(station.camera.project(here)[0][0])


def _mark(picture: Image, window: Window, ends: Sequence[Array]) -> None:
    """A ring where the equipment holds a point, a dot where the body has it, and what is between."""
    ring, dot = (tuple(np.rint(window.place(end)).astype(int).tolist()) for end in ends)
    cv2.line(picture, ring, dot, (255, 255, 255), 3, cv2.LINE_AA)
    cv2.line(picture, ring, dot, bgr(EQUIPMENT), 2, cv2.LINE_AA)
    cv2.circle(picture, ring, 11, (255, 255, 255), 4, cv2.LINE_AA)
    cv2.circle(picture, ring, 11, bgr(EQUIPMENT), 2, cv2.LINE_AA)
    cv2.circle(picture, dot, 5, (255, 255, 255), cv2.FILLED, cv2.LINE_AA)
    cv2.circle(picture, dot, 4, bgr(EQUIPMENT), cv2.FILLED, cv2.LINE_AA)
