"""What all stretches of a recording share: where they begin, and by a first pass clocks, read-out times, joints.

The file is JSON, for ``bodycam replay stretch`` and ``merge``.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.timing.clock_state import ClockState
from bodycam_ros.timing.stamps import SharedStamps

BLOCK_S = 30.0
"""Time between two places at which cameras are tracked anew, and stretches may begin [s]: it costs 2 s of work."""

SAMPLE_S, EVERY_S = 4.8, 120.0
"""Clocks are estimated from four seconds and some margin; an hour of 30 samples knows them to 0.5 ms."""

SAMPLED_SHARE = SAMPLE_S / EVERY_S
"""Share of a long recording that the first pass reads."""

_VERSION = 2

_KIND = "first pass of bodycam replay"

FIRST_PASS_MARK = _KIND.encode()
"""What every such file begins with, nearly."""

_MOST_BYTES = 50_000_000


@dataclass(frozen=True)
class FirstPass:
    """What all stretches of a recording share.

    Attributes:
        recording: name of the bag, and stamp of its first image [ns].
        bounds_ns: where cameras are tracked anew, with begin and end of what is published: ascending stamps [ns].
        count: stretches, each from one of these on.
        recorded_ahead_ns: by how much images are recorded after their stamps [ns].
        shared: which cameras share their stamps; None where the recording is too short to tell.
        clocks: camera -> its clock, from one stamp on each.
        readouts: camera -> its read-out time.
        rotations: joint -> (3, 3) how it was turned while it was observed, see ``PosePrior.joint_sums``.
    """

    recording: tuple[str, int]
    bounds_ns: tuple[int, ...]
    count: int
    recorded_ahead_ns: int
    shared: SharedStamps | None
    clocks: Mapping[str, tuple[ClockState, ...]]
    readouts: Mapping[str, Readout]
    rotations: Mapping[str, tuple[tuple[float, ...], ...]]

    @property
    def anew_ns(self) -> tuple[int, ...]:
        """Times that cameras are tracked anew for [ns]."""
        return self.bounds_ns[1:-1]

    def stretch_ns(self, number: int) -> tuple[int, int]:
        """First stamp of a stretch, from 0 on, and the stamp after its last [ns].

        Raises:
            RecordingError: there is no such stretch.
        """
        if not 0 <= number < self.count:
            raise RecordingError(
                f"there is no stretch {number + 1}: the recording has {self.count}, of half a minute or more; ask for "
                "no more ('stretches' of a study)"
            )
        blocks = len(self.bounds_ns) - 1
        return self.bounds_ns[number * blocks // self.count], self.bounds_ns[(number + 1) * blocks // self.count]

    def check_recording(self, path: Path, first_stamp_ns: int) -> None:
        """Refuse another recording than the one that this was made of.

        Args:
            path: its bag.
            first_stamp_ns: stamp of its first image [ns].

        Raises:
            RecordingError: its name or first image is another.
        """
        if self.recording != (path.resolve().name, first_stamp_ns):
            raise RecordingError(
                f"{path}: its first pass was made of {self.recording[0]}, whose first image has the stamp "
                f"{self.recording[1]} ns, here {first_stamp_ns}; make it again with 'bodycam replay first'"
            )

    def write(self, path: Path) -> None:
        """Write the file.

        Raises:
            OutputError: it cannot be written.
        """
        write_whole(
            path, json.dumps({"kind": _KIND, "version": _VERSION, **asdict(self)}, default=sorted, indent=1) + "\n"
        )

    @classmethod
    def read(cls, path: Path) -> "FirstPass":
        """Read a file that ``write`` wrote.

        Raises:
            RecordingError: it cannot be read, or is another file.
        """
        try:
            if path.stat().st_size > _MOST_BYTES:
                raise ValueError("too large")
            return _parsed(json.loads(path.read_text()))
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise RecordingError(
                f"{path}: is not a first pass of this version; make it with 'bodycam replay first'"
            ) from error


def _parsed(document: dict[str, Any]) -> FirstPass:
    if (document["kind"], document["version"]) != (_KIND, _VERSION):
        raise ValueError("of another version")
    bounds_ns, count = tuple(map(int, document["bounds_ns"])), int(document["count"])
    if list(bounds_ns) != sorted(set(bounds_ns)) or not 1 <= count < len(bounds_ns):
        raise ValueError("not ascending")
    name, first_stamp_ns = document["recording"]
    shared = document["shared"]
    return FirstPass(
        (str(name), int(first_stamp_ns)),
        bounds_ns,
        count,
        int(document["recorded_ahead_ns"]),
        shared
        and SharedStamps(frozenset(map(str, shared["cameras"])), int(shared["period_ns"]), str(shared["reference"])),
        {camera: tuple(ClockState(**state) for state in states) for camera, states in document["clocks"].items()},
        {camera: Readout(**readout) for camera, readout in document["readouts"].items()},
        {joint: _matrix(rows) for joint, rows in document["rotations"].items()},
    )


def _matrix(rows: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    if [len(row) for row in rows] != [3, 3, 3]:
        raise ValueError("not 3 x 3")
    return tuple(tuple(map(float, row)) for row in rows)


def block_bounds(window_ns: tuple[int, int], block_s: float) -> tuple[int, ...]:
    """Bounds of equal blocks of a window [ns], none shorter than ``block_s``, the last not twice as long."""
    begin_ns, end_ns = window_ns
    blocks = max(1, int((end_ns - begin_ns) / (1e9 * block_s)))
    return (*(begin_ns + number * round(1e9 * block_s) for number in range(blocks)), end_ns)
