"""One picture that shows at a glance whether a solved recording is any good."""

from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from bodycam_ros.body.stick_figure import HEAD, Bone, limb_bones
from bodycam_ros.evaluate.equipment import draw_equipment
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figures import EvaluationFigures
from bodycam_ros.evaluate.time_panels import ERROR_PANELS, draw_errors
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid, transform_points
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results import colours
from bodycam_ros.results import picture_style as style
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.verdict import Level, Verdict

_VERDICT_COLOURS = {Level.GOOD: colours.GOOD, Level.DOUBTFUL: colours.CAUTION, Level.WRONG: colours.WARNING}
_MAX_LETTERS = 150
"""Longest text of the line below the name; the report and summary.json have the rest."""

_WIDTH, _HEIGHT, _EQUIPMENT_HEIGHT = 16.0, 11.6, 2.6  # [in]
_COLUMN = (0.095, 0.85)  # of all panels over time

_MAX_COLUMNS = 900
"""Columns of the strip; of the images that share one, the worst shows."""

_NO_IMAGE = "#f7f8f9"
_COLOURS = MappingProxyType(
    {
        CameraSight.RELATIVE: colours.RELATIVE,
        CameraSight.ROTATION_ONLY: colours.ROTATION_ONLY,
        CameraSight.BLIND: colours.WARNING,
    }
)


def draw_summary(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    equipment = evaluation.solved.equipment
    height = _HEIGHT + (_EQUIPMENT_HEIGHT if equipment is not None else 0.0)
    with style.open_picture(path, _WIDTH, height) as figure:

        def add_panel(column: tuple[float, float], bottom: float, top: float, shared: Axes | None = None) -> Axes:
            """Axes between two heights, given as shares of a picture without equipment."""
            low, high = (1.0 - (1.0 - share) * _HEIGHT / height for share in (bottom, top))
            return figure.add_axes((column[0], low, column[1], high - low), sharex=shared)

        _draw_headline(figure, evaluation, height)
        draw_figures(add_panel((0.03, 0.94), 0.545, 0.88), evaluation)
        registrations = add_panel(_COLUMN, 0.232, 0.49)
        _draw_registrations(registrations, evaluation.solved)
        bottom = 0.055
        top = 0.182
        gap = 0.018
        heights = np.linspace(top + gap, bottom, ERROR_PANELS + 1)
        panels = [add_panel(_COLUMN, low, high - gap, registrations) for high, low in pairwise(heights)]
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
        draw_errors(panels, evaluation)
        if equipment is not None:
            panel = add_panel(_COLUMN, -0.16, -0.03, registrations)
            draw_equipment(panel, evaluation.solved, equipment)
        figure.align_ylabels()


def _draw_headline(figure: Figure, evaluation: Evaluation, height: float) -> None:
    """Name, duration, verdict and key figures."""
    solved = evaluation.solved
    name, below, verdict = (1.0 - inches / height for inches in (0.29, 0.66, 0.93))
    figure.text(0.03, name, solved.path.resolve().name, fontsize=17.0, weight="bold", va="top")
    what = f"{solved.duration_s:.1f} s, frames: {len(solved.stamps_ns)}, cameras: {len(solved.cameras)}"
    if solved.stations:
        what += f", static cameras: {len(solved.stations)}"
    if evaluation.comparison is not None:
        what += f", truth: {evaluation.comparison.truth_name}"
    elif evaluation.agreement is not None:
        what += f", compared with {evaluation.agreement.name}"
    figure.text(0.03, below, what, fontsize=10.0, color=colours.QUIET, va="top")
    colour = _VERDICT_COLOURS[evaluation.verdict.level]
    figure.text(0.03, verdict, verdict_line(evaluation.verdict), fontsize=11.0, weight="bold", color=colour, va="top")
    figures = key_figures(evaluation.figures)
    for index, (value, caption) in enumerate(figures):
        across = 0.97 - 0.112 * (len(figures) - 1 - index)
        figure.text(across, name, value, fontsize=17.0, color=colours.INK, va="top", ha="right")
        figure.text(across, below, caption, fontsize=9.0, color=colours.QUIET, va="top", ha="right")


def verdict_line(verdict: Verdict) -> str:
    """The verdict and the likely cause of the worst finding, shortened to a line."""
    line = verdict.text
    if verdict.findings and verdict.findings[0].why:
        line += f" ({verdict.findings[0].subject}: {verdict.findings[0].why})"
    return line if len(line) <= _MAX_LETTERS else f"{line[: _MAX_LETTERS - 3]}..."


def key_figures(figures: EvaluationFigures) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    shown = [(f"{figures.image_coverage:.1%}", "body solved"), *_camera_figures(figures)]
    if (truth := figures.truth) is not None:
        return [
            *shown[:2],
            (f"{truth.position_cm.mean:.2f} cm", "position error, mean"),
            (f"{truth.rotation_deg.mean:.2f}°", "rotation error, mean"),
            (f"{100.0 * (truth.scale - 1.0):+z.2f} %", "scale error"),
            (f"{truth.tilt_deg:.2f}°", "tilt"),
        ]
    if (agreement := figures.agreement) is not None:
        return [*shown, (f"{agreement.position_cm.mean:.2f} cm", "position difference, mean")]
    medians = figures.root_position_sigma_mm.median, figures.jitter_mm.median
    texts = ("unknown" if np.isnan(value) else f"{value:.1f} mm" for value in medians)
    return [*shown, *zip(texts, ("root sigma, median", "jitter, median"), strict=True)]


def _camera_figures(figures: EvaluationFigures) -> list[tuple[str, str]]:
    """Shares of images: registered by body cameras; without any, observed by static ones."""
    if not figures.cameras:
        stations = [*(figures.stations or {}).values()]
        images = [station.images for station in stations]
        observed = np.average([station.seen for station in stations], weights=images)
        segments = np.average([station.segments for station in stations], weights=images)
        return [(f"{observed:.1%}", "body observed"), (f"{segments:.1f}", "segments per image")]
    body_cameras = [*figures.cameras.values()]
    registered = np.average(
        [camera.registered for camera in body_cameras], weights=[camera.images for camera in body_cameras]
    )
    counts = [camera.landmarks for camera in body_cameras if not np.isnan(camera.landmarks)]  # unknown in a slim bag
    landmarks = [(f"{np.mean(counts):.0f}", "landmarks per image")] if counts else []
    return [(f"{registered:.1%}", "cameras registered"), *landmarks]


def _draw_registrations(axes: Axes, solved: SolvedRecording) -> None:
    """A row per camera, darker with more landmarks, or segments; other colours where it is not registered."""
    rows = {record.camera: record.registered for record in solved.cameras}
    rows = rows or {record.station: record.observes for record in solved.stations}
    counts, sights = sight_table(solved, _MAX_COLUMNS)
    known = counts[np.isfinite(counts)]
    most = float(np.percentile(known, 98)) if known.size else 1.0
    most = max(10.0, 10.0 * np.ceil(most / 10.0)) if solved.cameras else max(1.0, most)
    start_s, end_s = solved.seconds(np.array([solved.start_ns, solved.end_ns + solved.frame_ns])).tolist()
    cells = style.LANDMARKS(np.nan_to_num(counts) / most)
    cells[np.isnan(counts)] = to_rgba(_NO_IMAGE)
    for sight, colour in _COLOURS.items():
        cells[sights == sight] = to_rgba(colour)
    axes.imshow(cells, extent=(start_s, end_s, len(rows) - 0.5, -0.5), aspect="auto", interpolation="nearest")
    axes.hlines(np.arange(len(rows) - 1) + 0.5, start_s, end_s, color="white", linewidth=1.5)
    style.name_rows(axes, [*rows])
    for row, registered in enumerate(rows.values()):
        share = float(registered.mean())
        axes.annotate(
            "100 %" if share == 1.0 else f"{100.0 * share:.1f} %", (1.0, row), (5, 0),
            xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=8.0,
            color=colours.QUIET if share == 1.0 else colours.WARNING,
        )  # fmt: skip
    axes.tick_params(length=0)
    title, what = ("Camera registration", "landmarks") if solved.cameras else ("Static cameras", "observed segments")
    style.panel_title(axes, title, f"dark: {most:.0f} {what} or more")
    axes.legend(
        handles=[Patch(color=colour, label=sight.label) for sight, colour in _COLOURS.items()],
        loc="lower right", bbox_to_anchor=(1.0, 0.995), ncols=len(_COLOURS),
        handlelength=0.9, handleheight=0.9, borderaxespad=0.0, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip


def sight_table(solved: SolvedRecording, max_columns: int) -> tuple[Array, Array]:
    """Fewest landmarks (C, N) and the worst ``CameraSight`` (C, N), by camera and time; NaN without an image.

    Where there are static cameras alone, fewest segments; without any it is ``CameraSight.BLIND``.
    """
    blind, seen = int(CameraSight.BLIND), int(CameraSight.REGISTERED)
    found = [(each.stamps_ns, each.landmarks, each.sights) for each in solved.cameras]
    found = found or [(s.stamps_ns, s.segments, np.where(s.observes, seen, blind)) for s in solved.stations]
    frames = round((solved.end_ns - solved.start_ns) / solved.frame_ns) + 1
    columns = min(frames, max_columns)
    counts, sights = np.full((2, len(found), columns), np.nan)
    for row, (stamps_ns, count, sight) in enumerate(found):
        column = np.round((stamps_ns - solved.start_ns) / solved.frame_ns).astype(int) * columns // frames
        np.fmin.at(counts[row], column, count.astype(np.float64))
        np.fmax.at(sights[row], column, sight.astype(np.float64))
    return counts, sights


_FIGURES = 8  # times that are shown, evenly spread
_STEP_M = 1.1  # between two figures on the screen
_HEAD_RADIUS_M = 0.10
_TURN, _ELEVATION = np.radians(35.0), np.radians(14.0)  # of the view, from the side towards the front, and from above
_RIGHT = np.array([np.cos(_TURN), np.sin(_TURN), 0.0])
_AWAY = np.array([-np.sin(_TURN), np.cos(_TURN), 0.0])
_UP = np.array([0.0, 0.0, np.cos(_ELEVATION)]) + np.sin(_ELEVATION) * _AWAY
_DEPTH = np.cross(_UP, _RIGHT)

_SIDES = MappingProxyType({"left": colours.LEFT, "right": colours.RIGHT, "centre": colours.CENTRE})
_TRUTH_STYLE: Any = {"color": colours.TRUTH, "linewidth": 5.5, "alpha": 0.55}


def draw_figures(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: left, right and centre in their colours, the truth in grey beneath."""
    solved, comparison = evaluation.solved, evaluation.comparison
    rows = np.unique(np.linspace(0, len(solved.stamps_ns) - 1, _FIGURES).round().astype(int)).tolist()
    body = solved.bones()
    truth = [] if comparison is None else limb_bones(comparison.true_segments, solved.parents)
    floor_z = min(float(np.minimum(b.start, b.end)[:, 2].min()) for b in body if not b.is_equipment)
    for number, row in enumerate(rows):
        world_T_root = solved.world_T_root[row]
        turned = exp_so3(np.array([0.0, 0.0, np.arctan2(world_T_root[1, 0], world_T_root[0, 0])]))
        world_T_view = rigid(turned, np.array([*world_T_root[:2, 3], floor_z]))
        if comparison is not None:
            nearest = int(np.argmin(np.abs(comparison.stamps_ns - solved.stamps_ns[row])))
            for bone in truth:
                line, _ = _projected(bone, nearest, world_T_view, number)
                axes.plot(*line.T, solid_capstyle="round", zorder=2, **_TRUTH_STYLE)
        shown = [bone for bone in body if solved.placed[row] or not bone.is_equipment]
        lines = [(*_projected(bone, row, world_T_view, number), bone) for bone in shown]
        for line, _, bone in sorted(lines, key=lambda each: -each[1]):  # the far side first; nearer lines cover it
            _draw_bone(axes, bone, line)
        seconds, x = float(solved.seconds(solved.stamps_ns[[row]])[0]), _STEP_M * number
        axes.plot([x - 0.3, x + 0.3], [0.0, 0.0], color=colours.FAINT, linewidth=0.8, zorder=0)
        axes.annotate(
            f"{seconds:.1f} s", (x, 0.0), (0, -13), textcoords="offset points", ha="center", va="top", fontsize=8.0,
            color=colours.QUIET,
        )  # fmt: skip
    has_equipment = any(bone.is_equipment for bone in body) and bool(solved.placed[rows].any())
    key: list[tuple[str, Any]] = [
        *((name, {"color": colour, "linewidth": 2.4}) for name, colour in _SIDES.items()),
        *([("equipment", {"color": colours.EQUIPMENT, "linewidth": 1.2})] if has_equipment else []),
        *([("truth", _TRUTH_STYLE)] if comparison is not None else []),
    ]
    axes.legend(
        handles=[Line2D([], [], label=name, **looks) for name, looks in key], loc="lower right",
        bbox_to_anchor=(1.0, 1.0), ncols=len(key), labelcolor=colours.INK, handlelength=1.6, borderaxespad=0.0,
    )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.axis("off")
    travelled = np.linalg.norm(np.diff(solved.world_T_root[:, :2, 3], axis=0), axis=1).sum()
    style.panel_title(axes, "Skeleton", f"side by side; the root travels {travelled:.1f} m")


def _projected(bone: Bone, row: int, world_T_view: Array, number: int) -> tuple[Array, float]:
    """Ends (2, 2) of a line on the screen [m] of one of the figures, and its depth."""
    ends = transform_points(inverse(world_T_view), np.stack([bone.start[row], bone.end[row]]))
    screen = np.stack([ends @ _RIGHT + _STEP_M * number, ends @ _UP], axis=1)
    return screen, float((ends @ _DEPTH).sum())


def _draw_bone(axes: Axes, bone: Bone, line: Array) -> None:
    if bone.is_equipment:
        axes.plot(*line.T, color=colours.EQUIPMENT, linewidth=1.2, solid_capstyle="round", zorder=3)
        return
    colour = colours.side_colour(bone.segment)
    if bone.segment == HEAD:
        head = Circle(line[1], _HEAD_RADIUS_M, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=3.1)
        axes.add_patch(head)
    axes.plot(*line.T, color=colour, linewidth=2.4, solid_capstyle="round", zorder=3)
    axes.plot(*line[0], "o", color=colour, markersize=3.6, zorder=3)
