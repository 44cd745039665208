"""Which images of a recording a replay reads, and of which times it publishes states: all, a stretch, or a preview."""

from collections.abc import Collection
from dataclasses import dataclass

from bodycam_ros.recording.bag_reader import LAST_NS, Recording
from bodycam_ros.replaying.first_pass import FirstPass
from bodycam_ros.replaying.fresh_fronts import LEAD_NS
from bodycam_ros.replaying.preview import preview_text, preview_windows, with_margins
from bodycam_ros.replaying.recorded_part import part_s

_ALL_NS = -LAST_NS, LAST_NS
_FOLLOWING_NS = 12_000_000_000  # states wait for ten seconds at most until limbs are observed again

Window = tuple[int, int]
"""The first stamp of a part of a recording, and the stamp after its last [ns]."""


@dataclass(frozen=True)
class ReplayWindows:
    """Parts of a recording, in order of time.

    Attributes:
        read: of which images are read.
        published: that which is published: images, and what the verdict is by.
        states: those of it whose states are published.
        anew: times at which cameras are tracked anew [ns].
        solved_s: how long the states last together [s].
        ends_s: from the first to the last image that is read [s].
        preview: what is solved, in words, where that is a preview; else empty.
    """

    read: tuple[Window, ...]
    published: Window
    states: tuple[Window, ...]
    anew: tuple[int, ...]
    solved_s: float
    ends_s: float
    preview: str = ""

    @classmethod
    def of_all(cls, window_ns: Window, recording: Recording) -> "ReplayWindows":
        """All of a window."""
        lasting_s = part_s(window_ns, recording)
        return cls((window_ns,), _ALL_NS, (_ALL_NS,), (), lasting_s, lasting_s)

    @classmethod
    def of_stretch(cls, first: FirstPass, number: int | None, recording: Recording) -> "ReplayWindows":
        """A stretch of a first pass by its number, with what goes before and after it; None: all of them in one go."""
        solved_ns = read_ns = whole_ns = first.bounds_ns[0], first.bounds_ns[-1]
        if number is not None:
            solved_ns = first.stretch_ns(number)
            read_ns = max(whole_ns[0], solved_ns[0] - LEAD_NS), min(whole_ns[1], solved_ns[1] + _FOLLOWING_NS)
        # A stretch begins with what the whole recording begins anew with there.
        anew = tuple(stamp_ns for stamp_ns in first.anew_ns if stamp_ns > solved_ns[0])
        lasting_s = part_s(solved_ns, recording)
        return cls((read_ns,), solved_ns, (solved_ns,), anew, lasting_s, lasting_s)

    @classmethod
    def of_preview(
        cls, window_ns: Window, most: int, recording: Recording, cameras: Collection[str]
    ) -> "ReplayWindows":
        """Parts of a window, so many at most, in which there are images of some cameras."""
        spans_ns = list(recording.camera_spans(cameras).values()) or [window_ns]
        begin_ns, end_ns = min(begin for begin, _ in spans_ns), max(end for _, end in spans_ns) + 1
        states = preview_windows((max(window_ns[0], begin_ns), min(window_ns[1], end_ns)), most)
        read = with_margins(states)
        return cls(
            read,
            _ALL_NS,
            states,
            tuple(part_ns[0] for part_ns in read[1:]),
            sum(part_s(each_ns, recording) for each_ns in states),
            part_s((read[0][0], read[-1][1]), recording),
            preview_text(states, part_s(window_ns, recording)),
        )
