"""Which cameras contradict the others, as the fewest that explain what does not fit."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.verdict.agreement import Agreement
from bodycam_ros.verdict.camera_link import CameraLink, camera_links
from bodycam_ros.verdict.thresholds import DOUBTFUL_GAP_M, LEAST_STAY_S

_LEAST_ROWS = 3
"""Instants that a link must be known at before it says anything."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """What does not fit.

    Attributes:
        core: cameras that agree with each other.
        gaps: camera that contradicts them -> its worst lasting gap [m].
        rivals: camera that contradicts -> the one that could be blamed as well, where nothing tells which.
    """

    core: tuple[str, ...]
    gaps: Mapping[str, float]
    rivals: Mapping[str, str]


def contradiction(agreement: Agreement, body: BodyModel, cameras: Sequence[str]) -> Contradiction:
    """Find the cameras whose own poses contradict the body that the others agree on.

    Args:
        agreement: poses over time.
        body: segments, joints and mounts.
        cameras: those that were registered at all.
    """
    limit = DOUBTFUL_GAP_M
    gaps = lasting_gaps(agreement, camera_links(body, body.mounts, cameras))
    blamed, rivals = blame(gaps, limit, lambda camera: _registration_rank(agreement, camera))
    core = [camera for camera in cameras if camera not in blamed]
    # Without the blamed, cameras on either side of them are linked over more joints: another may not fit.
    while len(core) > 1:
        gaps = gaps | lasting_gaps(agreement, camera_links(body, body.mounts, core))
        of_core = {pair: gap for pair, gap in gaps.items() if set(pair) <= set(core)}
        more, more_rivals = blame(of_core, limit, lambda camera: _registration_rank(agreement, camera))
        if not more:
            break
        blamed, rivals = [*blamed, *more], rivals | more_rivals
        core = [camera for camera in core if camera not in more]
    worst = {camera: max(gap for pair, gap in gaps.items() if camera in pair) for camera in blamed}
    return Contradiction(tuple(core), worst, rivals)


def blame(
    gaps: Mapping[tuple[str, str], float], limit: float, rank: Callable[[str], float]
) -> tuple[list[str], dict[str, str]]:
    """The fewest cameras that all links beyond the limit have part in: greedily, the most contradicted first.

    Args:
        gaps: (camera, camera) -> by how much the two disagree.
        limit: what is too much.
        rank: how well a camera is registered; of two that are alike the worse is blamed.

    Returns:
        The cameras, and for each whose opposite could be blamed as well, that one.
    """
    bad = {pair: gap for pair, gap in gaps.items() if gap > limit}
    good = set(gaps) - set(bad)
    blamed: list[str] = []
    rivals: dict[str, str] = {}
    while bad:
        weights = {camera: _weight(camera, bad, good) for camera in {camera for pair in bad for camera in pair}}
        worst = max(weights, key=lambda camera: (weights[camera], -rank(camera), camera))
        own = [pair for pair in bad if worst in pair]
        opposite = own[0][0] if own[0][1] == worst else own[0][1]
        if len(own) == 1 and weights[opposite] == weights[worst]:
            rivals[worst] = opposite
        blamed.append(worst)
        bad = {pair: gap for pair, gap in bad.items() if worst not in pair}
        # Who agrees with one that is blamed is not the better for it.
        good = {pair for pair in good if worst not in pair}
    return blamed, rivals


def _weight(camera: str, bad: Iterable[tuple[str, str]], good: Iterable[tuple[str, str]]) -> int:
    """How many more cameras a camera contradicts than it agrees with."""
    return sum(camera in pair for pair in bad) - sum(camera in pair for pair in good)


def lasting_gaps(agreement: Agreement, links: Iterable[CameraLink]) -> dict[tuple[str, str], float]:
    """(camera, camera) -> the gap that the two keep for ``min_stay`` in their worst time [m], of known links."""
    found = {}
    for link in links:
        gaps = link.gap(agreement.registered(link.first), agreement.registered(link.second))
        worst = lasting(gaps, agreement.seconds, LEAST_STAY_S)
        if np.isfinite(worst):
            found[link.first, link.second] = worst
    return found


def lasting(values: Array, seconds: Array, min_stay_s: float) -> float:
    """The largest median of values (T,) over a stretch of time; NaN of too few. Shorter recordings are one stretch."""
    known = np.isfinite(values)
    values, seconds = values[known], seconds[known]
    if len(values) < _LEAST_ROWS:
        return float("nan")
    step_s = float(np.median(np.diff(seconds)))
    rows = max(_LEAST_ROWS, round(min_stay_s / step_s))
    if len(values) <= rows:
        return float(np.median(values))
    # A stretch with a pause in it is none.
    whole = seconds[rows - 1 :] - seconds[: 1 - rows] < 2.0 * rows * step_s
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, rows), axis=1)[whole]
    return float(medians.max()) if len(medians) else float(np.median(values))


def gaps_over_time(agreement: Agreement, body: BodyModel, core: Sequence[str], camera: str) -> Array:
    """(T,) by how much a camera contradicts the core [m], the median of its links; NaN where nothing tells."""
    others = [name for name in core if name != camera]
    links = [link for link in camera_links(body, body.mounts, [*others, camera]) if camera in (link.first, link.second)]
    gaps = [link.gap(agreement.registered(link.first), agreement.registered(link.second)) for link in links]
    return median_of(np.array(gaps)) if gaps else np.full(len(agreement.seconds), np.nan)


def median_of(values: Array) -> Array:
    """Medians (T,) of columns of values (K, T); NaN of a column that is all NaN."""
    medians = np.full(values.shape[1], np.nan)
    known = np.isfinite(values).any(axis=0)
    medians[known] = np.nanmedian(values[:, known], axis=0)
    return medians


def _registration_rank(agreement: Agreement, camera: str) -> float:
    """How well a camera is registered: where nothing else tells, the lens and the share of images do."""
    lens = agreement.lens_errors.get(camera)
    return agreement.counts[camera].share - (0.0 if lens is None else abs(lens.scale) + lens.centre)
