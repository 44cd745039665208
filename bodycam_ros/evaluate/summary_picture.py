"""One picture that shows at a glance whether a solved recording is any good."""

from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bodycam_ros.drawing.picture_style import TYPOGRAPHY
from bodycam_ros.evaluate import angle_panels, error_panels
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figure_panel import draw_figures
from bodycam_ros.evaluate.headline import draw_headline
from bodycam_ros.evaluate.registration_panel import draw_registrations

_SIZE_INCHES = (16.0, 11.6)
_DOTS_PER_INCH = 110


def draw_summary(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
        FigureCanvasAgg(figure)
        draw_headline(figure, evaluation, top=0.975)
        draw_figures(figure.add_axes((0.03, 0.545, 0.94, 0.335)), evaluation)
        left, right = (0.095, 0.405), (0.6, 0.365)
        registrations = figure.add_axes((left[0], 0.232, left[1], 0.258))
        draw_registrations(registrations, evaluation)
        error_panels.draw_errors(_stacked(figure, left, (0.045, 0.182), error_panels.PANELS, registrations), evaluation)
        angle_panels.draw_angles(_stacked(figure, right, (0.045, 0.49), angle_panels.PANELS, registrations), evaluation)
        figure.align_ylabels()
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _stacked(
    figure: Figure, across: tuple[float, float], span: tuple[float, float], count: int, shared: Axes
) -> list[Axes]:
    """Panels one upon the other that share their time axis; the lowest shows its ticks."""
    gap = 0.018
    height = (span[1] - span[0] - gap * (count - 1)) / count
    panels = []
    for number in range(count):
        bottom = span[1] - (number + 1) * height - number * gap
        axes = figure.add_axes((across[0], bottom, across[1], height), sharex=shared)
        axes.tick_params(labelbottom=number == count - 1)
        panels.append(axes)
    return panels
