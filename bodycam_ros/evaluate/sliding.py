"""How far feet slide in stance.

A stance (``results.stances``) slides by the horizontal distance of the point from its mean place in the stance; its
path, the sum over all frames, is longer.

Against the truth the stances are those of the true foot, which is not quite still: people in motion capture slide, too.
The error of its place moves by the same measure, beyond what the true foot does.
"""

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.figures import SlidingFigures
from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.stances import Stance, feet_of, find_stances, sole_of

ALL = "all"
"""All feet together."""


def sliding_figures(solved: SolvedRecording, comparison: Comparison | None) -> dict[str, SlidingFigures]:
    """Foot, and ``ALL`` -> figures of its sliding; empty without feet."""
    soles = {foot: sole_of(solved, foot, solved.world_T_link[foot]) for foot in feet_of(solved)}
    figures = _measure(soles, find_stances(soles, solved.stamps_ns, solved.longest_step_ns), solved.stamps_ns)
    if comparison is None:
        return figures
    inside = np.isin(solved.stamps_ns, comparison.stamps_ns)
    segments = comparison.true_segments
    true = {foot: sole_of(solved, foot, segments[foot]) for foot in soles if foot in segments}
    stances = find_stances(true, comparison.stamps_ns, solved.longest_step_ns)
    errors = {foot: soles[foot][inside] - true[foot] for foot in true}
    for name, points in (("true_mean_mm", true), ("beyond_mean_mm", errors)):
        for foot, measured in _measure(points, stances, comparison.stamps_ns).items():
            figures[foot] = msgspec.structs.replace(figures[foot], **{name: measured.mean_mm})
    return figures


def _measure(
    soles: Mapping[str, Array], stances: Mapping[str, Sequence[Stance]], stamps_ns: NDArray[np.int64]
) -> dict[str, SlidingFigures]:
    figures = {}
    for name, feet in {**{foot: [foot] for foot in soles}, **({ALL: [*soles]} if soles else {})}.items():
        spans = [(foot, *stance) for foot in feet for stance in stances[foot]]
        paths = [1e3 * soles[foot][first:last, point, :2] for foot, point, first, last in spans]
        distances = np.concatenate([np.zeros(0), *(np.linalg.norm(p - p.mean(axis=0), axis=1) for p in paths)])
        lengths = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths]
        figures[name] = SlidingFigures(
            stances=len(spans),
            standing_s=1e-9 * sum(int(stamps_ns[last - 1] - stamps_ns[first]) for *_, first, last in spans),
            mean_mm=float(distances.mean()) if spans else np.nan,
            max_mm=float(distances.max()) if spans else np.nan,
            path_mm=float(np.mean(lengths)) if spans else np.nan,
        )
    return figures
