"""Centres of body cameras against the truth, before the optimisation and after it (A figure 6)."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.figures import BeforeAndAfter, spread
from bodycam_ros.formats.tum import read_tum
from bodycam_ros.geometry import Array, umeyama
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.results.colours import CAUTION, INK, QUIET
from bodycam_ros.results.picture_style import light_grid, open_picture, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording

_CAMERAS = "cameras"
_LEAST_MM = 0.01  # lower end of the logarithmic scale
_WIDTH, _ROW_HEIGHT, _MARGINS = 14.0, 0.26, 1.5  # [in]


@dataclass(frozen=True, eq=False)
class CentreErrors:
    """Errors of one camera's centre at its K registered images.

    Attributes:
        stamps_ns: (K,) increasing [ns].
        before: (K,) of the pose that the camera alone was registered at [m].
        after: (K,) of where the solved body has the camera [m].
    """

    stamps_ns: NDArray[np.int64]
    before: Array
    after: Array

    def figures(self) -> BeforeAndAfter:
        """The errors in figures."""
        return BeforeAndAfter(spread(self.before, 1e3), spread(self.after, 1e3))


def centre_errors(solved: SolvedRecording, truth: Path) -> dict[str, CentreErrors]:
    """Camera -> the errors of its centre, after one rigid alignment of all solved centres; empty without their truth.

    The paper's centres before the optimisation were already moved onto the skeleton (A 4.2); ours are those of each
    camera alone, which the optimisation begins with.

    Args:
        solved: the recording.
        truth: folder with ``cameras/*.tum``, poses of the optical frames.

    Raises:
        RecordingError: one of these files is malformed.
    """
    places = {}
    for record, world_T_camera in solved.solved_cameras():
        file = truth / _CAMERAS / f"{record.camera}.tum"
        if not file.is_file():
            continue
        true_ns, true_poses = read_tum(file)
        inside = (record.stamps_ns >= true_ns[0]) & (record.stamps_ns <= true_ns[-1])
        usable = record.registered & solved.is_solved_at(record.stamps_ns) & inside
        if usable.any():
            stamps_ns = record.stamps_ns[usable]
            after = interpolated(solved.stamps_ns, world_T_camera, stamps_ns)[:, :3, 3]
            true = interpolated(true_ns, true_poses, stamps_ns)[:, :3, 3]
            places[record.camera] = stamps_ns, record.world_T_camera[usable][:, :3, 3], after, true
    if not places:
        return {}
    solved_centres, true_centres = (np.concatenate([each[row] for each in places.values()]) for row in (2, 3))
    try:
        _, R, t = umeyama(solved_centres, true_centres, with_scale=False)
    except ValueError as error:
        raise RecordingError(f"{truth / _CAMERAS}: its camera centres cannot be aligned: {error}") from error
    return {
        camera: CentreErrors(stamps_ns, *(np.linalg.norm(each @ R.T + t - true, axis=1) for each in (before, after)))
        for camera, (stamps_ns, before, after, true) in places.items()
    }


def draw_centres(solved: SolvedRecording, errors: Mapping[str, CentreErrors], path: Path) -> None:
    """Write a picture as PNG: mean errors of each camera before and after, and of all cameras over time.

    Raises:
        OSError: the file cannot be written.
    """
    with open_picture(path, _WIDTH, _MARGINS + _ROW_HEIGHT * max(8, len(errors))) as figure:
        by_camera, over_time = figure.subplots(1, 2, width_ratios=(2, 3))
        for row, (camera, each) in enumerate(errors.items()):
            ends = [max(1e3 * float(e.mean()), _LEAST_MM) for e in (each.before, each.after)]
            by_camera.plot(ends, [row, row], color=QUIET, linewidth=1.0, zorder=1)
            by_camera.scatter(ends, [row, row], color=[CAUTION, INK], s=28, zorder=2)
            by_camera.text(-0.02, row, camera.replace("_", " "), transform=by_camera.get_yaxis_transform(), ha="right",
                           va="center")  # fmt: skip
        by_camera.set_yticks([])
        by_camera.invert_yaxis()
        by_camera.set_xlabel("error of the camera centre, mean [mm]")
        panel_title(by_camera, "By camera", "before and after the optimisation")
        stamps_ns = np.concatenate([each.stamps_ns for each in errors.values()])
        edges = np.arange(stamps_ns.min(), stamps_ns.max() + 2 * solved.frame_ns, solved.frame_ns)
        cells = np.searchsorted(edges, stamps_ns, "right") - 1
        for name, colour in (("before", CAUTION), ("after", INK)):
            values = 1e3 * np.concatenate([getattr(each, name) for each in errors.values()])
            mean = np.array([values[cells == cell].mean() for cell in np.unique(cells)])
            over_time.plot(*solved.curve(edges[np.unique(cells)], mean), color=colour, linewidth=1.4)
        over_time.set_xlabel("time [s]")
        over_time.set_ylabel("error, mean over the cameras [mm]")
        panel_title(over_time, "Over time", "mean over the cameras")
        for axes, axis in ((by_camera, by_camera.xaxis), (over_time, over_time.yaxis)):
            (axes.set_xscale if axes is by_camera else axes.set_yscale)("log")
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=5))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_locator(NullLocator())
            light_grid(axes)
        key = (("registered, each camera alone", CAUTION), ("solved, all cameras and the body", INK))
        handles = [Line2D([], [], color=c, marker="o", label=name) for name, c in key]
        figure.legend(handles=handles, loc="lower center", ncols=2, labelcolor=QUIET)
        figure.subplots_adjust(left=0.11, right=0.985, top=0.92, bottom=0.16, wspace=0.14)
