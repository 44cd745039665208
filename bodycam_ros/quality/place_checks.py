"""Checks of a recording in its place: board, registration, lenses by field of view, N-pose, exercise of the joints."""

from collections.abc import Collection, Iterator
from itertools import product
from pathlib import Path

import numpy as np

from bodycam_ros.boards.apriltag import FAMILIES, find_tags
from bodycam_ros.boards.board import Board
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.rest_search import MAX_SHIFT_M, MAX_TURN_RAD
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.rig_check import find_misplaced
from bodycam_ros.geometry import Array, inverse, log_so3, nearest_rotation
from bodycam_ros.lens.lens_check import find_mismatches
from bodycam_ros.progress import Progress
from bodycam_ros.quality.sampled_recording import RegisteredSamples, SampledRecording
from bodycam_ros.recording.topic_names import TopicNames
from bodycam_ros.results.verdict import Finding, Level, good, limit_level

_ENOUGH_BOARD_IMAGES = 3
_MAX_BOARD_IMAGES = 48  # tags of a fisheye picture take a tenth of a second


def check_board(recording: SampledRecording, board: Board, has_map: bool) -> Iterator[Finding]:
    """Detect tags of the board, in the middle of the recording first.

    Args:
        recording: samples.
        board: description.
        has_map: whether there is a map, whose scale makes the board unnecessary.
    """
    seen: list[str] = []
    examined, count = 0, len(recording.times_s)
    order = sorted(range(count), key=lambda number: abs(2 * number - count))
    for number, camera in product(order, recording.cameras):
        grey = camera.images.get(number)
        if len(seen) < _ENOUGH_BOARD_IMAGES and examined < _MAX_BOARD_IMAGES and camera.fits_lens(grey):
            assert grey is not None and camera.lens is not None
            examined += 1
            if {tag for tag, _ in find_tags(grey, camera.lens, FAMILIES[board.family])} & set(board.corners_board):
                seen.append(camera.name)
    if seen:
        yield good("board", f"seen by {', '.join(sorted(set(seen)))} in {len(seen)} of {examined} images")
    elif has_map:
        yield good("board", f"not seen in {examined} images; the map has its scale already")
    else:
        what = f"not seen in {examined} images"
        remedy = "put it where cameras see it from 1 to 2 m, or make a map from photographs that show it"
        yield Finding("", Level.DOUBTFUL, what, remedy=remedy, part="recording", check="board")


_REGISTERED, _HARDLY_REGISTERED = 0.6, 0.2  # share of single images; of images that follow each other more register


def check_registration(registered: RegisteredSamples) -> Iterator[Finding]:
    """Compute the share of each camera's sampled images that can be registered in the map."""
    check = "registered"
    shares = {camera: registered.share(camera) for camera in registered.poses}
    shares = {camera: share for camera, share in shares.items() if np.isfinite(share)}
    for camera in sorted(registered.mirrored):
        what = "its images are mirrored: left is right"
        yield Finding(camera, Level.WRONG, what, remedy="switch mirroring off in the camera", check=check)
        shares.pop(camera)
    if registered.mirrored and not shares:
        return
    if not any(shares.values()):
        what, remedy = "no image could be registered", "first correct the findings on lenses and images"
        if shares:
            what = "no camera is registered in the map"
            remedy = "check that map and lenses are right; if so, photograph more (see coverage.png in the map)"
        yield Finding("", Level.WRONG, what, remedy=remedy, part="recording", check=check)
        return
    for camera, share in sorted(shares.items()):
        if level := limit_level(share, _REGISTERED, _HARDLY_REGISTERED):
            what = f"is registered in {share:.0%} of {len(registered.poses[camera])} images"
            remedy = "photograph what it sees and build the map again, or use 'bodycam map extend' on this recording"
            yield Finding(camera, level, what, remedy=remedy, check=check)
    images = sum(len(registered.poses[camera]) for camera in shares)
    mean = np.mean(list(shares.values()))
    yield good(check, f"{mean:.0%} of {images} single images are registered; 'bodycam replay' will register more")


def check_field_of_view(
    recording: Path, registered: RegisteredSamples, progress: Progress, names: TopicNames
) -> Iterator[Finding]:
    """Compare lenses with the tracks of their cameras: some seconds a camera, so only of those that register badly."""
    lost = {camera for camera in registered.poses if registered.share(camera) < _REGISTERED}
    doubted = sorted(lost - registered.mirrored)
    if not doubted:
        return
    with progress.step("lenses", len(doubted)) as advance:
        for camera in doubted:
            for match in find_mismatches(recording, [camera], names):
                yield Finding(camera, Level.WRONG, match.cause, check="lens")
            advance()


OPENING_S = (0.1, 0.7, 1.3)
"""Times at which the person should stand still."""


def check_rest(registered: RegisteredSamples, body_cameras: Collection[str]) -> Iterator[Finding]:
    """Compare the poses of the body cameras in the first second.

    Args:
        registered: the images of ``OPENING_S`` among others.
        body_cameras: cameras of the rig.
    """
    check = "N-pose"
    opening = np.flatnonzero(registered.times_s <= OPENING_S[-1] + 1e-6).tolist()
    known = {camera: [p for n, p in registered.known(camera).items() if n in opening] for camera in body_cameras}
    compared = {camera: poses for camera, poses in known.items() if len(poses) > 1}
    if not compared:
        yield good(check, "no camera is registered in the first second; the N-pose may come later")
        return
    moving = 0
    for poses in compared.values():
        moved = inverse(poses[0]) @ np.array(poses[1:])
        turn = float(np.linalg.norm(log_so3(moved[:, :3, :3]), axis=1).max())
        shift = float(np.linalg.norm(moved[:, :3, 3], axis=1).max())
        if turn > MAX_TURN_RAD or shift > MAX_SHIFT_M:
            moving += 1
    # It may be held at any time, between the samples as well.
    where = "'bodycam body' searches the recording for the N-pose" if moving else "this may be the N-pose"
    yield good(check, f"{len(compared) - moving} of {len(compared)} cameras stand still at the start; {where}")


_MIN_EXERCISE_INSTANTS = 6  # of which a range can be computed
_EXERCISE_DEG, _HARDLY_EXERCISED_DEG = 40.0, 10.0  # the farther a joint turns the better its place is known
_SECOND_AXIS_DEG = 15.0  # about one axis alone, the place of a ball along it stays open


def check_exercise(registered: RegisteredSamples, rig: Rig) -> Iterator[Finding]:
    """Find joints of a range of motion that turned too little, or about one axis only."""
    check, judged = "exercise", 0
    for segment in rig.segments:
        parent = rig.parents[segment]
        if parent is None:
            continue
        named = SegmentName(segment)
        turns = _relative_rotations(registered, rig, parent, segment)
        if len(turns) < _MIN_EXERCISE_INSTANTS:
            what = f"the cameras next to it are registered together in only {len(turns)} of the sampled images"
            remedy = "its exercise cannot be checked; record where both cameras see the mapped place"
            yield Finding(named.joint, Level.DOUBTFUL, what, remedy=remedy, part="joint", check=check)
            continue
        judged += 1
        far, second = _ranges_deg(turns)
        what = f"turned by {far:.0f} deg, and by {second:.0f} deg about a second axis, in {len(turns)} images"
        level = limit_level(far, _EXERCISE_DEG, _HARDLY_EXERCISED_DEG)
        if not level and second < _SECOND_AXIS_DEG and not named.straight_in_rest:
            level = Level.DOUBTFUL
        if level:
            yield Finding(named.joint, level, what, remedy=named.exercise, part="joint", check=check)
    if judged:
        yield good(check, f"{judged} joints were checked in the sampled images; more may have turned between these")


def check_rig(registered: RegisteredSamples, rig: Rig) -> Iterator[Finding]:
    """Find out whether cameras are on the segments that the rig of a range of motion has for them.

    Samples are too few to tell which cameras are elsewhere: left and right of a limb fit about as well exchanged.
    """
    check = "rig"
    numbers = sorted({number for camera in rig.cameras for number in registered.known(camera)})
    poses = np.tile(np.eye(4), (len(numbers), len(rig.cameras), 1, 1))
    known = np.zeros(poses.shape[:2], bool)
    for column, camera in enumerate(rig.cameras):
        for number, pose in registered.known(camera).items():
            row = numbers.index(number)
            poses[row, column], known[row, column] = pose, True
    if not numbers:
        return
    misplaced = find_misplaced(rig, tuple(rig.cameras), poses, known)
    if misplaced is not None:
        what = (
            "cameras are exchanged, or on other segments than in the rig: cameras of one segment or joint contradict "
            f"each other by up to {1e3 * misplaced.gap_m:.0f} mm"
        )
        remedy = "run 'bodycam body', which names them; correct the rig, or the names of the files"
        yield Finding("", Level.WRONG, what, remedy=remedy, part="recording", check=check)


def _relative_rotations(registered: RegisteredSamples, rig: Rig, parent: str, segment: str) -> Array:
    """(K, 3, 3) rotations of a segment's camera in its parent's, of the pair that is registered together most often."""
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
