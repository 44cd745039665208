"""Where the time goes between an image and the joint state that it is part of, and what each process costs.

The clock of an instant starts when the first image of it is published: the time of exposure is the camera's own affair.
What follows is that of the camera whose landmarks reach the solver last, the one that the instant waited for.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.moments import Moment, Noted

STAGES = ("play", "track", "register", "way", "later", "solve")
"""Rows of ``Latency.stages_s``.

play: the other cameras' images, which the player publishes one after the other where cameras would all at once.
track: in the tracker, which decodes as well; its queue is not included.
register: in the registration.
way: between processes; the queues of those that are busy with another image or camera are in it.
later: landmarks are at the solver, but the instant waits for later ones (``output_delay``, the assembler).
solve: in the solver, up to the joint state's publication.
"""

_SAME_INSTANT_NS = 8_000_000
"""Cameras' stamps apart, as the assembler takes them together."""

_WARM_UP = 2 / 3
"""Share of the instants: the first images find their place in the whole map, the solver waits for its first second and
solves it at once, and what queued meanwhile has to go."""

_OF_CAMERA = (
    Moment.PLAYED,
    Moment.IMAGE_HEARD,
    Moment.TRACKING,
    Moment.TRACKED,
    Moment.TRACKS_HEARD,
    Moment.REGISTERED,
    Moment.LANDMARKS_HEARD,
)


@dataclass(frozen=True)
class Latency:
    """From image to joint state.

    Attributes:
        stamps_ns: (N,) instants, ascending: the last third of a run.
        stages_s: (N, 6) what each of ``STAGES`` took; the sum of a row is the latency.
    """

    stamps_ns: NDArray[np.int64]
    stages_s: NDArray[np.float64]

    @property
    def total_s(self) -> NDArray[np.float64]:
        """(N,) latency of each instant."""
        return np.asarray(self.stages_s.sum(axis=1))

    def total_in_real_time_s(self, rate: float) -> NDArray[np.float64]:
        """(N,) latency where later frames come as fast as they were recorded, and not at a rate below 1."""
        return np.asarray(self.total_s - (1.0 - rate) * self.stages_s[:, STAGES.index("later")])

    @property
    def way_s(self) -> float:
        """What an instant spends on the way in the median: where that is longer than between two images, they queue."""
        of_instants = self.stages_s[:, STAGES.index("way")]
        return float(np.median(of_instants)) if len(of_instants) else float("inf")


def latency_of(noted: Iterable[Noted]) -> Latency:
    """The latency of every instant of which all moments were noted.

    Args:
        noted: by all processes.
    """
    of_camera: defaultdict[str, dict[Moment, dict[int, int]]] = defaultdict(lambda: {m: {} for m in Moment})
    begun: dict[int, int] = {}
    solved: dict[int, int] = {}
    for note in noted:
        if note.moment is Moment.SOLVING:
            begun[note.stamp_ns] = note.at.steady_ns
        elif note.moment is Moment.SOLVED:
            solved[note.stamp_ns] = note.at.steady_ns
        else:
            of_camera[note.camera][note.moment][note.stamp_ns] = note.at.steady_ns
    chains = {camera: _chains(moments) for camera, moments in of_camera.items()}
    stamps, stages = [], []
    # An instant at either end of the run can lack a moment: it began before the notes did, or never ended.
    for stamp_ns in sorted(begun.keys() & solved.keys()):
        found = (_nearest(*of_one, stamp_ns) for of_one in chains.values())
        near = [one for one in found if one is not None and one[-1] <= solved[stamp_ns]]
        if near:
            stamps.append(stamp_ns)
            stages.append(_stages(near, begun[stamp_ns], solved[stamp_ns]))
    cold = round(_WARM_UP * len(stamps))
    return Latency(np.array(stamps[cold:], np.int64), 1e-9 * np.array(stages, float).reshape(-1, len(STAGES))[cold:])


def _chains(moments: Mapping[Moment, Mapping[int, int]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(F,) stamps of a camera's frames that came all the way, and (F, 7) when they passed each moment [ns]."""
    stamps = sorted(set.intersection(*(set(moments[moment]) for moment in _OF_CAMERA)))
    rows = [[moments[moment][stamp] for moment in _OF_CAMERA] for stamp in stamps]
    return np.array(stamps, np.int64), np.array(rows, np.int64).reshape(-1, len(_OF_CAMERA))


def _nearest(stamps_ns: NDArray[np.int64], rows: NDArray[np.int64], stamp_ns: int) -> NDArray[np.int64] | None:
    if not len(stamps_ns):
        return None
    nearest = int(np.abs(stamps_ns - stamp_ns).argmin())
    return rows[nearest] if abs(int(stamps_ns[nearest]) - stamp_ns) <= _SAME_INSTANT_NS else None


def _stages(chains: Sequence[NDArray[np.int64]], begun_ns: int, solved_ns: int) -> tuple[int, ...]:
    """What each stage took of one instant [ns], by the chains of all cameras that it has."""
    first_ns = min(int(chain[0]) for chain in chains)
    awaited = max(chains, key=lambda one: int(one[-1]))
    played, heard, tracking, tracked, tracks_heard, registered, landmarks = awaited.tolist()
    on_the_way = (tracking - heard) + (heard - played) + (tracks_heard - tracked) + (landmarks - registered)
    # The solver may begin an instant in the same call in which it hears of it, and notes the beginning after.
    waited = max(0, begun_ns - landmarks)
    return (
        played - first_ns,
        tracked - tracking,
        registered - tracks_heard,
        on_the_way,
        waited,
        solved_ns - landmarks - waited,
    )


def cost_of_image(noted: Iterable[Sequence[Noted]]) -> float:
    """Processor time that the whole graph spends for an image, what it spends on messages included [s].

    Of the last third of the images while they are played; NaN where too few are.

    Args:
        noted: by each process, in any order.
    """
    processes = [sorted(notes, key=lambda note: note.at.steady_ns) for notes in noted if notes]
    played = sorted(n.at.steady_ns for notes in processes for n in notes if n.moment is Moment.PLAYED)
    warm = played[round(_WARM_UP * len(played)) :]
    if len(warm) < 2:
        return float("nan")
    between = (warm[0], warm[-1])
    spent_ns = 0.0
    for notes in processes:
        at = [note.at.steady_ns for note in notes]
        spent_ns += float(np.diff(np.interp(between, at, [note.at.cpu_ns for note in notes]))[0])
    return 1e-9 * spent_ns / (len(warm) - 1)
