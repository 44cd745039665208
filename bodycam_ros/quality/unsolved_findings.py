"""Frames at the start of a recording that were not solved, for their cameras contradict each other."""

from collections.abc import Iterator, Mapping

from bodycam_ros.files.shown import few
from bodycam_ros.results.verdict import Finding, Level

_DOUBTFUL_SHARE, _WRONG_SHARE = 0.05, 0.5  # of the frames that have images


def unsolved_findings(solved: int, contradictory: int, rejected: Mapping[str, int]) -> Iterator[Finding]:
    """The finding that a result begins late, if it does: what is there says nothing of the frames before it.

    Args:
        solved: frames with a state.
        contradictory: frames at the start without one.
        rejected: camera -> frames in which the others contradict it.
    """
    share = contradictory / max(1, solved + contradictory)
    if share <= _DOUBTFUL_SHARE:
        return
    most_first: list[str] = sorted(rejected, key=lambda camera: (-rejected[camera], camera))
    names = few(most_first)
    yield Finding(
        "",
        Level.WRONG if share > _WRONG_SHARE else Level.DOUBTFUL,
        f"{contradictory} of {solved + contradictory} frames, at the start, are not solved: cameras contradict each "
        f"other{f', {names} most of all' if names else ''}",
        "the names of cameras are exchanged, cameras were strapped on again, or they show something else",
        "compare their places and names with the body file; a longer recording shows which cameras are wrong",
        part="recording",
        check="start",
    )
