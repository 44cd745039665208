"""The part of a recording that is used: what the user asks for, else where most of the body's cameras run."""

from collections.abc import Collection

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_reader import Recording
from bodycam_ros.recording.time_span import TimeSpan, most_cameras_window

WHOLE = TimeSpan()


def window_with_images(recording: Recording, cameras: Collection[str], span: TimeSpan) -> tuple[int, int]:
    """First stamp of a part of a recording, and the stamp after its last [ns].

    Args:
        recording: that it is a part of.
        cameras: of which there should be images in it.
        span: what the user asks for.

    Raises:
        RecordingError: no camera has an image in that time.
    """
    window_ns = span.window_ns(recording.first_stamp_ns)
    if span != WHOLE:
        spans_ns = recording.camera_spans(cameras).values()
        if not any(first_ns < window_ns[1] and last_ns >= window_ns[0] for first_ns, last_ns in spans_ns):
            first_ns = recording.first_stamp_ns
            ends_s = 1e-9 * (max((last_ns for _, last_ns in spans_ns), default=first_ns) - first_ns)
            raise RecordingError(f"{recording.path}: has no image {span.text}; it lasts from 0 to {ends_s:.1f} s")
    return window_ns


def published_window(
    recording: Recording, cameras: Collection[str], span: TimeSpan, whole: bool
) -> tuple[tuple[int, int], str]:
    """Window of the stamps that a replay publishes [ns], and a line on what it leaves out; empty for nothing.

    Args:
        recording: that is replayed.
        cameras: on the body.
        span: what the user asks for.
        whole: publish it all, however few cameras run.
    """
    window_ns = window_with_images(recording, cameras, span)
    if whole or span != WHOLE or not (spans_ns := recording.camera_spans(cameras)):
        return window_ns, ""
    most_ns = most_cameras_window(spans_ns)
    begins_ns, ends_ns = (bound(span[end] for span in spans_ns.values()) for end, bound in ((0, min), (1, max)))
    before_s, after_s = 1e-9 * (most_ns[0] - begins_ns), 1e-9 * (ends_ns + 1 - most_ns[1])
    parts = [f"the first {before_s:.1f} s"] if before_s > 0.0 else []
    parts += [f"the last {after_s:.1f} s"] if after_s > 0.0 else []
    if not parts:
        return window_ns, ""
    return most_ns, (
        f"not solved: {' and '.join(parts)}, in which fewer than three quarters of the {len(spans_ns)} cameras run"
    )


def part_s(window_ns: tuple[int, int], recording: Recording) -> float:
    """How long a part of a recording lasts [s]."""
    first_ns = recording.first_stamp_ns
    end_ns = min(window_ns[1], first_ns + round(1e9 * recording.duration_s))
    return max(0.0, 1e-9 * (end_ns - max(window_ns[0], first_ns)))
