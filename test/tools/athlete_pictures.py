"""Draw what equipment is for, as figures 9, 10 and 12 of Rosenhahn et al. 2008 (B), of athletes that are simulated.

    python test/tools/athlete_pictures.py -o FOLDER

Writes boot.png, how far a snowboarder's second boot is from its binding, and feet.png, where a cyclist's feet go once
no camera on the legs sees any more.
"""

import argparse
import sys
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent.parent))
from athlete_frames import (  # noqa: E402
    JUMPING,
    LEGS,
    Sight,
    Solved,
    boot_from_its_binding,
    leg_errors,
    solved,
)
from athletes import AIRBORNE_S, BALL_OF_FOOT, cyclist, snowboarder  # noqa: E402

from bodycam_ros.drawing.picture_style import (  # noqa: E402
    CAUTION,
    CENTRE,
    FAINT,
    GOOD,
    LEFT,
    QUIET,
    RIGHT,
    TRUTH,
    TYPOGRAPHY,
    light_grid,
    panel_title,
)
from bodycam_ros.geometry import inverse  # noqa: E402

Array = NDArray[np.float64]

_DOTS_PER_INCH = 110
_WITHOUT, _WITH = CAUTION, GOOD
_BLIND_FROM_S, _RIDE_S = 1.5, 4.5
_MM = 1000.0
_ASKEW = np.array([[1.0, -1.1, 0.0], [0.0, -0.25, 1.0]])
"""From the frame of the bicycle to the picture, forward to the right; the feet do not hide each other."""


def draw_boot(path: Path) -> None:
    """B figure 12: distance of the second boot from its binding, with the board and without."""
    athlete = snowboarder()
    free, bound = solved(athlete, JUMPING), solved(athlete, JUMPING, athlete.equipment)
    curves = [
        ("without the board", _WITHOUT, _MM * boot_from_its_binding(free)),
        ("with it", _WITH, _MM * boot_from_its_binding(bound)),
        ("with it, from the board as solved", CENTRE, _MM * bound.attachment_gaps("binding_right")),
    ]
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = _figure((10.0, 4.6))
        _headline(figure, "A jump on a snowboard, half a turn in the air", "second boot from its binding, B figure 12")
        axes = figure.add_axes((0.07, 0.13, 0.9, 0.6))
        for start, end in JUMPING.dark["foot_right"]:
            axes.axvspan(start, end, color=FAINT, linewidth=0.0)
        top = 1.12 * max(values.max() for _, _, values in curves)
        for x in AIRBORNE_S:
            axes.axvline(x, color=QUIET, linewidth=0.7, linestyle=(0, (3, 3)))
        axes.text(np.mean(AIRBORNE_S), 0.97 * top, "in the air", ha="center", va="top", color=QUIET, fontsize=8.5)
        axes.text(3.0, 0.97 * top, "grey: no image of the foot", va="top", color=QUIET, fontsize=8.5)
        for number, (name, colour, values) in enumerate(curves):
            axes.plot(athlete.times, values, color=colour, linewidth=1.6)
            label = f"{name}: mean {values.mean():.1f} mm, at most {values.max():.0f} mm"
            figure.text(0.56, 0.92 - 0.05 * number, f"● {label}", color=colour, fontsize=9.0)
        axes.set(xlim=(athlete.times[0], athlete.times[-1]), ylim=(0.0, top), xlabel="time [s]")
        light_grid(axes)
        panel_title(axes, "Distance", "[mm], of the board that the first boot carries")
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def draw_feet(path: Path) -> None:
    """B figures 9 and 10: the way of the feet beside the bicycle, and what the legs' joints are wrong by."""
    athlete = cyclist(_RIDE_S)
    sight = Sight(dark={camera: ((_BLIND_FROM_S, np.inf),) for camera in LEGS})
    both = [("without the bicycle", solved(athlete, sight)), ("with it", solved(athlete, sight, athlete.equipment))]
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = _figure((13.0, 4.6))
        note = f"no image of six leg cameras after {_BLIND_FROM_S:g} s, B figures 9 and 10"
        _headline(figure, "Feet on the pedals", note)
        for column, (name, done) in enumerate(both):
            axes = figure.add_axes((0.05 + 0.3 * column, 0.12, 0.26, 0.64))
            _draw_way(axes, done)
            panel_title(axes, name.capitalize(), "way of the balls of the feet")
        axes = figure.add_axes((0.69, 0.12, 0.29, 0.64))
        axes.axvspan(_BLIND_FROM_S, athlete.times[-1], color=FAINT, linewidth=0.0)
        for (name, done), colour in zip(both, (_WITHOUT, _WITH), strict=True):
            errors = _MM * leg_errors(done).mean(axis=1)
            unseen = errors[athlete.times > _BLIND_FROM_S]
            axes.plot(athlete.times, errors, color=colour, linewidth=1.6)
            height = 0.9 if colour == _WITHOUT else 0.85
            label = f"● {name}: mean {unseen.mean():.0f} mm unseen"
            figure.text(0.69, height, label, color=colour, fontsize=9.0)
        axes.set(xlim=(athlete.times[0], athlete.times[-1]), xlabel="time [s]")
        axes.set_ylim(bottom=0.0)
        light_grid(axes)
        panel_title(axes, "Joints of the legs", "mean error [mm]")
        for number, (label, colour) in enumerate((("left", LEFT), ("right", RIGHT), ("truth", TRUTH))):
            figure.text(0.05 + 0.07 * number, 0.025, f"● {label}", color=colour, fontsize=8.5)
        figure.text(0.27, 0.025, "thin while cameras see the legs", color=QUIET, fontsize=8.5)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_way(axes: Axes, done: Solved) -> None:
    """Both balls of the feet in the frame of the bicycle, truth behind."""
    athlete = done.athlete
    bike_T_world = inverse(athlete.equipment_poses[:, 0])
    unseen = athlete.times > _BLIND_FROM_S
    for side, colour in (("left", LEFT), ("right", RIGHT)):
        row = athlete.body.segment_index[f"foot_{side}"]
        truth, ours = (
            _MM * (bike_T_world @ poses[:, row] @ np.append(BALL_OF_FOOT, 1.0))[:, :3] @ _ASKEW.T
            for poses in (athlete.poses, done.poses)
        )
        axes.plot(*truth.T, color=TRUTH, linewidth=3.0)
        axes.plot(*ours[~unseen].T, color=colour, linewidth=0.7)
        axes.plot(*ours[unseen].T, color=colour, linewidth=1.6)
    spindles = _MM * np.array([[0.0, 0.125, 0.0], [0.0, -0.125, 0.0]]) @ _ASKEW.T
    axes.plot(*spindles.T, marker="+", color=CENTRE, markersize=7.0, linewidth=0.6)
    left, bottom = axes.get_xlim()[0], axes.get_ylim()[0] - 20.0
    axes.plot([left, left + 100.0], [bottom, bottom], color=QUIET, linewidth=1.6)
    axes.text(left + 110.0, bottom, "100 mm", va="center", color=QUIET, fontsize=8.0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()


def _figure(size: tuple[float, float]) -> Figure:
    figure = Figure(figsize=size, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _headline(figure: Figure, title: str, note: str) -> None:
    figure.text(0.03, 0.96, title, fontsize=13.0, weight="bold", va="top")
    figure.text(0.03, 0.875, note, fontsize=10.0, color=QUIET, va="top")


def main() -> None:
    """Solve, draw, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write the pictures to")
    output: Path = parser.parse_args().output
    output.mkdir(parents=True, exist_ok=True)
    draw_boot(output / "boot.png")
    draw_feet(output / "feet.png")
    print(f"drawn in {output}")


if __name__ == "__main__":
    sys.exit(main())
