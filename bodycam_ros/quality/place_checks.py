"""Whether the AprilTag board is seen, which gives a map of worn cameras its scale and what is up."""

from collections.abc import Collection, Iterator

import numpy as np

from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.calibration.rest_pose import MAX_SHIFT_M, MAX_TURN_RAD
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.geometry import Array, inverse, log_so3, nearest_rotation
from bodycam_ros.mapping.apriltag import FAMILIES, find_tags
from bodycam_ros.mapping.board import Board
from bodycam_ros.quality.doctor_settings import DoctorSettings
from bodycam_ros.quality.finding import Finding, Light, by_limits
from bodycam_ros.quality.sampled_recording import RegisteredSamples, SampledRecording

_BOARD = "board"
_ENOUGH = 3  # images; the check is over by then
_LOOKED_AT = 48  # images at most: fisheye pictures take a tenth of a second


def check_board(recording: SampledRecording, board: Board, has_map: bool) -> Iterator[Finding]:
    """Look for tags of the board, in the middle of the recording first.

    Args:
        recording: samples.
        board: what it looks like.
        has_map: there is a map already, so nobody needs the board.
    """
    seen: dict[str, int] = {}
    looked = 0
    for number in sorted(
        range(len(recording.instants_s)), key=lambda number: abs(2 * number - len(recording.instants_s))
    ):
        for camera in recording.cameras:
            grey = camera.images.get(number)
            if grey is None or camera.lens is None or grey.shape != (camera.lens.height, camera.lens.width):
                continue
            if sum(seen.values()) >= _ENOUGH or looked >= _LOOKED_AT:
                break
            looked += 1
            tags = {tag for tag, _ in find_tags(grey, camera.lens, FAMILIES[board.family])}
            if tags & set(board.corners_board):
                seen[camera.name] = seen.get(camera.name, 0) + 1
    if seen:
        yield Finding(
            _BOARD, Light.GREEN, f"seen by {', '.join(sorted(seen))} in {sum(seen.values())} of {looked} images"
        )
    elif has_map:
        yield Finding(_BOARD, Light.GREEN, f"not seen in {looked} images; the map has its scale already")
    else:
        what = f"not seen in {looked} images"
        remedy = "let it lie where cameras see it from 1 to 2 m, or map the place by photographs that show it"
        yield Finding(_BOARD, Light.AMBER, what, remedy)


_REGISTRATION = "registered"


def check_registration(registered: RegisteredSamples, settings: DoctorSettings) -> Iterator[Finding]:
    """Say of each camera in how many of the sampled images it knows where it is."""
    shares = {camera: registered.share(camera) for camera in registered.poses}
    shares = {camera: share for camera, share in shares.items() if np.isfinite(share)}
    if not shares:
        yield Finding(_REGISTRATION, Light.RED, "no image could be asked", "see to lenses and images first")
        return
    if not any(shares.values()):
        what = "no camera finds itself in the map"
        remedy = (
            "is it the map of this place? are the lenses those of the cameras? photograph more ('bodycam map check')"
        )
        yield Finding(_REGISTRATION, Light.RED, what, remedy)
        return
    for camera, share in sorted(shares.items()):
        if light := by_limits(share, settings.registered, settings.hardly_registered):
            what = f"finds itself in {share:.0%} of {len(registered.poses[camera])} images"
            remedy = "photograph what it looks at and map that too ('bodycam map extend' takes this recording)"
            yield Finding(_REGISTRATION, light, what, remedy, f"camera {camera}")
    images = sum(len(poses) for poses in registered.poses.values())
    what = (
        f"{np.mean(list(shares.values())):.0%} of {images} single images find themselves; one after the other more do"
    )
    yield Finding(_REGISTRATION, Light.GREEN, what)


_REST = "N-pose"
OPENING_S = (0.1, 0.7, 1.3)
"""Instants at which the person should stand still."""


def check_rest(registered: RegisteredSamples, worn: Collection[str]) -> Iterator[Finding]:
    """Compare where the worn cameras are in the first second.

    Args:
        registered: the images of ``OPENING_S`` among others.
        worn: cameras of the rig.
        settings: what counts as standing still.
    """
    opening = np.flatnonzero(registered.instants_s <= OPENING_S[-1] + 1e-6).tolist()
    known = {camera: [p for n, p in registered.known(camera).items() if n in opening] for camera in worn}
    told = {camera: poses for camera, poses in known.items() if len(poses) > 1}
    if not told:
        what = "no camera is registered in the first second"
        yield Finding(_REST, Light.RED, what, "stand where the cameras see the mapped place, then begin")
        return
    for camera, poses in sorted(told.items()):
        moved = inverse(poses[0]) @ np.array(poses[1:])
        turn = float(np.linalg.norm(log_so3(moved[:, :3, :3]), axis=1).max())
        shift = float(np.linalg.norm(moved[:, :3, 3], axis=1).max())
        if turn > MAX_TURN_RAD or shift > MAX_SHIFT_M:
            what = f"moves by {1e3 * shift:.0f} mm and {np.degrees(turn):.0f} deg in the first {OPENING_S[-1]:g} s"
            remedy = "stand still in the N-pose, arms down, for 1.5 s, then begin"
            yield Finding(_REST, Light.RED, what, remedy, f"camera {camera}")
    yield Finding(_REST, Light.GREEN, f"{len(told)} cameras seen in the first {OPENING_S[-1]:g} s")


_EXERCISE = "exercise"
_FEWEST = 6  # instants, of which a range can be told
_HARDLY = 0.25  # of what a joint should turn by, which is red


def check_exercise(registered: RegisteredSamples, rig: Rig, settings: DoctorSettings) -> Iterator[Finding]:
    """Say which joints of a range of motion turned too little, or about one axis only."""
    told = 0
    for segment in rig.segments:
        parent = rig.parents[segment]
        if parent is None:
            continue
        named = SegmentName(segment)
        of, turns = f"joint {named.joint}", _turns(registered, rig, parent, segment)
        if len(turns) < _FEWEST:
            what = f"cameras on both sides are registered together in {len(turns)} of the sampled images"
            yield Finding(_EXERCISE, Light.AMBER, what, "so nobody can tell how far it was moved", of)
            continue
        told += 1
        far, second = _ranges_deg(turns)
        seen = f"turned by {far:.0f} deg, about a second axis by {second:.0f}, in {len(turns)} instants"
        if far < settings.exercise:
            light = Light.RED if far < _HARDLY * settings.exercise else Light.AMBER
            yield Finding(_EXERCISE, light, seen, named.exercise, of)
        elif second < settings.second_axis and not named.straight_in_rest:
            yield Finding(_EXERCISE, Light.AMBER, seen, named.exercise, of)
    if told:
        yield Finding(
            _EXERCISE,
            Light.GREEN,
            f"{told} joints could be judged by the sampled images; between them more may be",
        )


def _turns(registered: RegisteredSamples, rig: Rig, parent: str, segment: str) -> Array:
    """(K, 3, 3) rotations of a segment's camera in its parent's, of the pair that is seen together most often."""
    best: list[Array] = []
    for above in rig.cameras_on(parent):
        for below in rig.cameras_on(segment):
            first, second = registered.known(above), registered.known(below)
            both = [first[n][:3, :3].T @ second[n][:3, :3] for n in sorted(first.keys() & second.keys())]
            best = both if len(both) > len(best) else best
    return np.array(best).reshape(-1, 3, 3)


def _ranges_deg(turns: Array) -> tuple[float, float]:
    """How far rotations (K, 3, 3) go about their main axis and the one across it [deg]."""
    middle = nearest_rotation(turns.mean(axis=0))
    vectors = np.degrees(log_so3(middle.T @ turns))
    axes = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)[2]
    ranges = np.sort(np.ptp(vectors @ axes.T, axis=0))[::-1]
    return float(ranges[0]), float(ranges[1])
