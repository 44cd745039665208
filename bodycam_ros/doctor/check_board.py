"""Whether the AprilTag board is seen, which gives a map of worn cameras its scale and what is up."""

from collections.abc import Iterator

from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.sampled_recording import SampledRecording
from bodycam_ros.mapping.apriltag import FAMILIES
from bodycam_ros.mapping.board import Board
from bodycam_ros.mapping.tag_search import find_tags

_CHECK = "board"
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
            _CHECK, Light.GREEN, f"seen by {', '.join(sorted(seen))} in {sum(seen.values())} of {looked} images"
        )
    elif has_map:
        yield Finding(_CHECK, Light.GREEN, f"not seen in {looked} images; the map has its scale already")
    else:
        what = f"not seen in {looked} images"
        remedy = "let it lie where cameras see it from 1 to 2 m, or map the place by photographs that show it"
        yield Finding(_CHECK, Light.AMBER, what, remedy)
