"""The report of an evaluation as one page: what people read who do not read tables on a terminal."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from bodycam_ros.evaluate.agreement.agreement_section import BLAND_ALTMAN, JOINTS, WAYS, agreement_section
from bodycam_ros.evaluate.agreement.bland_altman_picture import draw_bland_altman
from bodycam_ros.evaluate.agreement.joints_picture import draw_joints
from bodycam_ros.evaluate.agreement.ways_picture import cameras_shown, draw_ways
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.page.page import Block, Page, Picture, Text

MARKDOWN, HTML = "report.md", "report.html"


def report_pictures(evaluation: Evaluation) -> Mapping[str, Callable[[Path], None]]:
    """Name of a file -> draws it, of all pictures that are of the page alone."""
    found: dict[str, Callable[[Path], None]] = {}
    if (agreement := evaluation.agreement) is not None:
        found[WAYS] = partial(draw_ways, evaluation.solved, agreement)
        found[JOINTS] = partial(draw_joints, evaluation.solved, agreement)
        if agreement.angles:
            found[BLAND_ALTMAN] = partial(draw_bland_altman, agreement)
    return found


def report_page(evaluation: Evaluation, pictures: Mapping[str, str]) -> Page:
    """The page.

    Args:
        evaluation: what was found.
        pictures: file -> caption of pictures that are in the folder besides.
    """
    solved = evaluation.solved
    duration_s = 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns)
    blocks: list[Block] = [
        Text(f"{duration_s:.2f} s, {len(solved.stamps_ns)} instants. Verdict: {evaluation.verdict.text}."),
    ]
    if evaluation.agreement is not None:
        blocks += agreement_section(evaluation.agreement, bool(cameras_shown(solved, evaluation.agreement)))
    blocks += [Picture(file, caption) for file, caption in pictures.items()]
    return Page(solved.path.resolve().name, tuple(blocks))
