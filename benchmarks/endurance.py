"""Time and memory of the solver over minutes: python -m benchmarks.endurance BAG --map MAP --body BODY.yaml.

The seconds of the recording are played forward and backward until the minutes are over.
"""

import argparse
import os
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.registrations import registrations
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_MINUTE_S = 60.0


@dataclass(frozen=True, eq=False)
class Endurance:
    """Cost of the states of a long motion.

    Attributes:
        stamps_s: (N,) of the states, without those of the first second, which come together [s].
        solve_ms: (N,) milliseconds of CPU, from registrations to the body's output, time synchronisation included.
        memory_mb: (N,) of the process after each.
    """

    stamps_s: NDArray[np.float64]
    solve_ms: NDArray[np.float64]
    memory_mb: NDArray[np.float64]

    def percentile_ms(self, percent: float) -> float:
        """Percentile over all states."""
        return float(np.percentile(self.solve_ms, percent))

    @property
    def first_minute_ms(self) -> float:
        """Mean over the first minute, or the first third of what is shorter."""
        return float(self.solve_ms[self.stamps_s < self._stretch_s].mean())

    @property
    def last_minute_ms(self) -> float:
        """Mean over the last minute, or the last third of what is shorter."""
        return float(self.solve_ms[self.stamps_s > self.stamps_s[-1] - self._stretch_s].mean())

    @property
    def growth_mb(self) -> float:
        """Growth of the process after the first minute [MB]."""
        return float(self.memory_mb[-1] - self.memory_mb[self.stamps_s < self._stretch_s][-1])

    @property
    def _stretch_s(self) -> float:
        return min(_MINUTE_S, float(self.stamps_s[-1]) / 3.0)


def endure(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: Sequence[LandmarkMatches],
    settings: PipelineSettings,
    lasting_s: float,
) -> Endurance:
    """Solve a recording to and fro for some time, as a live graph does, without its messages.

    Args:
        body: with its mounts.
        cameras: models by name.
        registered: of all images, in order of time; a second or more.
        settings: of all stages.
        lasting_s: of the motion [s].
    """
    skeleton = SkeletonPipeline(body, cameras, settings, live=True)
    stamps_ns, solve_s, memory = [], [], []
    begun, spent_s = False, 0.0  # time synchronisation delays the first second
    for matches in to_and_fro(registered, lasting_s):
        started_s = time.thread_time()
        outputs = skeleton.add(matches)
        spent_s += time.thread_time() - started_s
        for output in outputs if begun else ():
            stamps_ns.append(output.state.stamp_ns)
            solve_s.append(spent_s / len(outputs))
            memory.append(memory_bytes())
        if outputs:
            begun, spent_s = True, 0.0
    since_ns = np.array(stamps_ns, np.int64) - stamps_ns[0]
    return Endurance(1e-9 * since_ns.astype(np.float64), 1e3 * np.array(solve_s), 1e-6 * np.array(memory))


def to_and_fro(registered: Sequence[LandmarkMatches], lasting_s: float) -> Iterator[LandmarkMatches]:
    """Registrations of a motion that is repeated forward, backward, and so on.

    Args:
        registered: the motion, in order of time; a second or more.
        lasting_s: how long to go on [s].
    """
    stamps_ns = np.unique([matches.stamp_ns for matches in registered])
    first_ns, last_ns = int(stamps_ns[0]), int(stamps_ns[-1])
    backward = _backward(registered, first_ns + last_ns)
    at_ns, until_ns = first_ns, first_ns + round(1e9 * lasting_s)
    previous_ns: dict[str, int] = {}
    for played in cycle((registered, backward)):
        for matches in played:
            stamp_ns = matches.stamp_ns - first_ns + at_ns
            if stamp_ns > until_ns:
                return
            # The pose between the two directions occurs once.
            if stamp_ns == previous_ns.get(matches.camera):
                continue
            before_ns = previous_ns.get(matches.camera, 0) if matches.previous_stamp_ns else 0
            previous_ns[matches.camera] = stamp_ns
            yield replace(matches, stamp_ns=stamp_ns, previous_stamp_ns=before_ns)
        at_ns += last_ns - first_ns


def _backward(registered: Sequence[LandmarkMatches], mirror_ns: int) -> list[LandmarkMatches]:
    """The same images in reverse order of time, rotations between images inverted."""
    following: dict[str, LandmarkMatches] = {}
    mirrored = []
    for matches in reversed(registered):
        after = following.get(matches.camera)
        following[matches.camera] = matches
        turn: dict[str, Any] = {"previous_stamp_ns": 0, "current_R_previous": np.eye(3), "rotation_inliers": 0}
        if after is not None and after.previous_stamp_ns == matches.stamp_ns:
            turn = {
                "previous_stamp_ns": mirror_ns - after.stamp_ns,
                "current_R_previous": after.current_R_previous.T,
                "rotation_inliers": after.rotation_inliers,
            }
        mirrored.append(replace(matches, stamp_ns=mirror_ns - matches.stamp_ns, **turn))
    return mirrored


def memory_bytes() -> int:
    """Resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def main() -> None:
    """Print time and memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--body", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    settings, body = PipelineSettings(), read_body(arguments.body)
    cameras, registered = registrations(arguments.recording, arguments.map, body, settings, arguments.jobs)
    done = endure(body, cameras, registered, settings, _MINUTE_S * arguments.minutes)
    print(
        f"solver over {arguments.minutes:g} min: {done.percentile_ms(50):.1f} ms a state (median), "
        f"{done.percentile_ms(99):.1f} (p99), {done.percentile_ms(100):.0f} (worst); mean of the last minute "
        f"{done.last_minute_ms:.2f} ms, {done.last_minute_ms / done.first_minute_ms:.2f} of the first; "
        f"{done.growth_mb:+.1f} MB since the first minute"
    )


if __name__ == "__main__":
    main()
