"""Writes an evaluation into a folder: all of its files or none."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.constraint.close_ups import CloseUp
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.overlay_picture import OverlayView, draw_overlays
from bodycam_ros.evaluate.page.write_page import html, markdown
from bodycam_ros.evaluate.report_page import HTML, MARKDOWN, PAGE_FILES, report_page, report_pictures
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.evaluate.summary_picture import draw_summary
from bodycam_ros.whole_file import whole_files

FIGURES, PICTURE, OVERLAY = "summary.json", "summary.png", "overlay.png"
OUTSIDE, FEET, VIDEO = "outside.png", "feet.png", "outside.mp4"
WRITTEN = (PICTURE, OVERLAY, OUTSIDE, FEET, VIDEO, *PAGE_FILES)
"""Names of what may be written beside the figures."""

_CAPTIONS = {
    PICTURE: "The recording at a glance.",
    OVERLAY: "What worn cameras saw, with limbs and landmarks where the body puts them.",
    OUTSIDE: "What static cameras saw, with the body's contour and the forces on it.",
    FEET: "Ways of the balls of the feet.",
}


def check_report_folder(folder: Path) -> None:
    """Refuse a place that cannot become a report folder, before the work is done.

    Raises:
        RecordingError: it is a file, or a bag, which a report has no business in.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file; give a folder for {FIGURES} and {PICTURE}")
    if (folder / "metadata.yaml").exists():
        raise RecordingError(f"{folder}: is a ros2 bag folder; give another folder for {FIGURES} and {PICTURE}")


def write_report(
    evaluation: Evaluation,
    folder: Path,
    overlay: Sequence[OverlayView] = (),
    more: Mapping[str, Callable[[Path], None]] = MappingProxyType({}),
    close_ups: Sequence[CloseUp] = (),
) -> None:
    """Write figures, pictures and the page with them, as Markdown and as HTML; earlier ones are replaced.

    Args:
        evaluation: what was found.
        folder: to write to.
        overlay: views of worn cameras.
        more: name of another file -> writes it to a path.
        close_ups: what static cameras saw with equipment and without.

    Raises:
        RecordingError: the place cannot become a report folder.
        OutputError: it cannot be written.
    """
    check_report_folder(folder)
    with whole_files(folder) as unfinished:
        (unfinished / FIGURES).write_text(json.dumps(summary(evaluation), indent=1, allow_nan=False) + "\n")
        draw_summary(evaluation, unfinished / PICTURE)
        if overlay:
            draw_overlays(overlay, unfinished / OVERLAY)
        for name, draw in more.items():
            draw(unfinished / name)
        for name, draw in report_pictures(evaluation, close_ups).items():
            draw(unfinished / name)
        captions = {name: caption for name, caption in _CAPTIONS.items() if (unfinished / name).exists()}
        page = report_page(evaluation, captions)
        (unfinished / MARKDOWN).write_text(markdown(page), encoding="utf-8")
        (unfinished / HTML).write_text(html(page, unfinished), encoding="utf-8")
