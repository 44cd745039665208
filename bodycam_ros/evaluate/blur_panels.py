"""Panels: registered share against blur, and each camera's brightness over time."""

import numpy as np
from matplotlib.axes import Axes

from bodycam_ros.evaluate.brightness import BlurClass, blur_classes
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.plots.picture_style import LANDMARKS, QUIET, WARNING, light_grid, panel_title, side_colour

_NARROW_RANGE = (0.5, 2.0)
"""Of the brightness scale at least: light that stays shall look so."""


def draw_blur(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: a bar per class of image motion, registered in green and lost in red."""
    classes = blur_classes(evaluation.solved.cameras)
    panel_title(axes, "Registered against blur", "motion of the picture from image to image, by its tracks")
    if not classes:
        _say(axes, "the bag has no tracks")
        return
    places = np.arange(len(classes))
    share = np.array([100.0 * c.registered for c in classes])
    axes.bar(places, share, width=0.8, color=LANDMARKS(0.6))
    axes.bar(places, 100.0 - share, width=0.8, bottom=share, color=WARNING)
    for place, c in zip(places, classes, strict=True):
        images = f"{c.images} image{'s' if c.images > 1 else ''}"
        note = images if c.registered == 1.0 else f"{100.0 * c.registered:.1f} %\n{images}"
        axes.annotate(
            note,
            (place, 100.0),
            (0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7.5,
            color=QUIET,
        )
    axes.set_xticks(places, [span_text(c) for c in classes])
    axes.set_xlabel("motion [px per image]")
    axes.set_ylabel("registered [%]")
    axes.set_ylim(0.0, 128.0)
    axes.set_yticks([0, 50, 100])
    light_grid(axes)


def draw_brightness(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: a line per camera, against its own median."""
    panel_title(axes, "Brightness", "of what is neither black nor saturated, against the camera's median")
    if not evaluation.brightness:
        _say(axes, "--recording BAG shows it")
        return
    lowest, highest = _NARROW_RANGE
    for camera, light in evaluation.brightness.items():
        relative = light.level / max(float(np.median(light.level)), 1.0)
        lowest, highest = min(lowest, 0.9 * relative.min()), max(highest, 1.1 * relative.max())
        axes.plot(light.seconds, relative, color=side_colour(camera), linewidth=1.0, alpha=0.7)
    axes.set_yscale("log")
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if lowest <= tick <= highest]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
    axes.set_yticks([], minor=True)
    axes.set_ylim(lowest, highest)
    axes.set_ylabel("brightness")
    axes.set_xlabel("time [s]")
    light_grid(axes)


def span_text(blur: BlurClass) -> str:
    """The ends of a class as a person writes them."""
    return f"{blur.low_px:g}+" if np.isinf(blur.high_px) else f"{blur.low_px:g} to {blur.high_px:g}"


def _say(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=QUIET)
    # The time axis is shared: without ticks here, the other panels would have none either.
    axes.tick_params(bottom=False, labelbottom=False)
    axes.set_yticks([])
