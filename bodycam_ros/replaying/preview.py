"""A preview: parts of a recording, evenly over all of it, are solved, and whoever reads the result is told so.

Images in a row are needed: of every tenth image of ``dev_walk`` each is searched for in the whole map, which takes as
long as to track ten, and a stride would have three states.
"""

from collections.abc import Sequence

from bodycam_ros.results.verdict import Finding, Level

PART_S = 2.0
"""Length of a part [s]: it has a stride of each leg; to search for its first images costs as much as another second."""

EVERY_S = 20.0
"""A part every so often at most [s]: a tenth of the states."""

PARTS = 36
"""Parts at most, unless the user says so: what two cores solve in a minute."""

_MARGIN_NS = 100_000_000  # three images of 30 Hz


def preview_windows(window_ns: tuple[int, int], most: int) -> tuple[tuple[int, int], ...]:
    """First stamp of each part, and the stamp after its last [ns]: each in the middle of its share of a window.

    Args:
        window_ns: first stamp that could be solved, and the stamp after the last [ns].
        most: parts; fewer where there would be one more often than every ``EVERY_S``.
    """
    begin_ns, end_ns = window_ns
    count = max(1, min(most, round(1e-9 * (end_ns - begin_ns) / EVERY_S)))
    share_ns = (end_ns - begin_ns) / count
    lasting_ns = min(round(1e9 * PART_S), end_ns - begin_ns)
    starts_ns = (begin_ns + round((number + 0.5) * share_ns - 0.5 * lasting_ns) for number in range(count))
    return tuple((start_ns, start_ns + lasting_ns) for start_ns in starts_ns)


def with_margins(parts_ns: Sequence[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """Windows of the images that are needed for the states of some parts [ns].

    The first images of cameras are less certain, and free-running ones are interpolated between two of their images.
    """
    return tuple((begin_ns - _MARGIN_NS, end_ns + _MARGIN_NS) for begin_ns, end_ns in parts_ns)


def preview_text(parts_ns: Sequence[tuple[int, int]], lasting_s: float) -> str:
    """What is solved of a recording that lasts so long [s], in words."""
    solved_s = 1e-9 * sum(end_ns - begin_ns for begin_ns, end_ns in parts_ns)
    places = "one place" if len(parts_ns) == 1 else f"{len(parts_ns)} places"
    return f"{solved_s:.1f} of {lasting_s:.1f} s, in {places}"


def preview_finding(text: str) -> Finding:
    """What a verdict says of a preview, however good it is otherwise.

    Args:
        text: of ``preview_text``.
    """
    return Finding(
        "",
        Level.DOUBTFUL,
        f"this is a preview: {text}",
        remedy="solve the recording without --preview before you use it: clocks and read-out times are less well "
        "known here, and what happens between these places is not in it",
        part="recording",
        check="preview",
    )
