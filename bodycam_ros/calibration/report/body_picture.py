"""A calibrated body and how well it is known, in one picture."""

import textwrap
from io import BytesIO

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report import joint_panels
from bodycam_ros.calibration.report.body_views import draw_views
from bodycam_ros.calibration.report.report_tables import MM_PER_M
from bodycam_ros.drawing.picture_style import INK, QUIET, TYPOGRAPHY, WARNING

_WIDTH = 16.0  # [in] here and below
_HEADLINE = 1.35
_VIEWS = 7.5
_BELOW_VIEWS = 0.75
_TITLE = 0.26
_LINE = 0.19
_DOTS_PER_INCH = 110
_LINE_LETTERS = 185
_MOST_LINES = 12
_MARGIN = 0.03  # of the width


def body_png(body: BodyModel, diagnosis: CalibrationDiagnosis) -> bytes:
    """The picture as a PNG file's content."""
    content = BytesIO()
    with matplotlib.rc_context(TYPOGRAPHY):
        body_figure(body, diagnosis).savefig(content, dpi=_DOTS_PER_INCH, format="png")
    return content.getvalue()


def body_figure(body: BodyModel, diagnosis: CalibrationDiagnosis) -> Figure:
    """The N-pose from the front and from the right, a row of panels per joint, and what to look at."""
    lines = _fitted(diagnosis.warnings)
    below = _BELOW_VIEWS + _TITLE + _LINE * (len(lines) + 1)
    height = _HEADLINE + _VIEWS + below
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_WIDTH, height), dpi=_DOTS_PER_INCH, facecolor="white")
        FigureCanvasAgg(figure)
        _draw_headline(figure, body, diagnosis)
        upright = below / height, _VIEWS / height
        front = figure.add_axes((_MARGIN, upright[0], 0.35, upright[1]))
        side = figure.add_axes((0.385, upright[0], 0.145, upright[1]), sharey=front)
        draw_views(front, side, body, diagnosis)
        motion = figure.add_axes((0.625, upright[0], 0.145, upright[1]))
        values = figure.add_axes((0.79, upright[0], 0.08, upright[1]), sharey=motion)
        gap = figure.add_axes((0.89, upright[0], 0.08, upright[1]), sharey=motion)
        joint_panels.draw_exercise(motion, diagnosis.joints)
        joint_panels.draw_singular_values(values, diagnosis.joints)
        joint_panels.draw_gaps(gap, diagnosis.joints)
        _draw_warnings(figure, lines)
    return figure


def _draw_headline(figure: Figure, body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    top, second = (1.0 - inches / figure.get_figheight() for inches in (0.28, 0.66))
    figure.text(_MARGIN, top, f"Body {body.name}", fontsize=17.0, weight="bold", va="top")
    start_s, end_s = diagnosis.rest_s
    what = f"{diagnosis.duration_s:.1f} s of motion, N-pose from {start_s:.1f} to {end_s:.1f} s"
    figure.text(_MARGIN, second, what, fontsize=10.0, color=QUIET, va="top")
    figures = key_figures(diagnosis)
    for number, (value, caption) in enumerate(figures):
        across = 1.0 - _MARGIN - 0.128 * (len(figures) - 1 - number)
        figure.text(across, top, value, fontsize=15.0, color=INK, va="top", ha="right")
        figure.text(across, second, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def key_figures(diagnosis: CalibrationDiagnosis) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    figures = [(f"{len(diagnosis.joints)}", "joints"), (f"{len(diagnosis.cameras)}", "cameras")]
    if diagnosis.stature_m is not None:
        figures.append((f"{diagnosis.stature_m:.2f} m", "stature by the bones"))
    if (gain := diagnosis.refinement) is not None:
        figures.append((f"{MM_PER_M * gain.moved_m:.1f} mm", "joints moved by refinement"))
        figures.append((f"{gain.before_px:.2f} → {gain.after_px:.2f} px", "reprojection, median"))
    return figures


def _draw_warnings(figure: Figure, lines: list[str]) -> None:
    """At the foot of the figure, the last line above its edge."""
    from_bottom = _LINE * (len(lines) + 1)
    title, colour = ("Look at", WARNING) if lines else ("Nothing to look at", QUIET)
    height = figure.get_figheight()
    figure.text(_MARGIN, (from_bottom + _TITLE) / height, title, fontsize=10.0, weight="bold", color=colour, va="top")
    for number, line in enumerate(lines):
        figure.text(_MARGIN, (from_bottom - number * _LINE) / height, line, fontsize=9.0, va="top")


def _fitted(warnings: tuple[str, ...]) -> list[str]:
    """As many of the warnings as there is room for, and how many are left."""
    lines: list[str] = []
    for number, warning in enumerate(warnings):
        wrapped = textwrap.wrap(f"{number + 1}.  {warning}", _LINE_LETTERS, subsequent_indent="     ")
        last = number == len(warnings) - 1
        if len(lines) + len(wrapped) > (_MOST_LINES if last else _MOST_LINES - 1):
            return [*lines, f"and {len(warnings) - number} more, in the tables"]
        lines += wrapped
    return lines
