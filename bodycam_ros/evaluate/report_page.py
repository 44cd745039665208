"""The report of an evaluation as one page: what people read who do not read tables on a terminal."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from bodycam_ros.evaluate.agreement.agreement_section import BLAND_ALTMAN, JOINTS, WAYS, agreement_section
from bodycam_ros.evaluate.agreement.bland_altman_picture import draw_bland_altman
from bodycam_ros.evaluate.agreement.joints_picture import draw_joints
from bodycam_ros.evaluate.agreement.ways_picture import cameras_shown, draw_ways
from bodycam_ros.evaluate.constraint.close_ups import CloseUp
from bodycam_ros.evaluate.constraint.constraint_picture import draw_constraints
from bodycam_ros.evaluate.constraint.constraint_section import CONSTRAINTS, HELD_WAYS, constraint_section
from bodycam_ros.evaluate.constraint.ways_with_and_without import draw_ways_with_and_without
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.page.page import Block, Page, Picture, Text
from bodycam_ros.evaluate.walking.gait_picture import draw_gait
from bodycam_ros.evaluate.walking.gait_section import GAIT, gait_section

MARKDOWN, HTML = "report.md", "report.html"
PAGE_FILES = (MARKDOWN, HTML, WAYS, JOINTS, BLAND_ALTMAN, GAIT, CONSTRAINTS, HELD_WAYS)
"""Names of the page and of the pictures that are of it alone."""


def report_pictures(evaluation: Evaluation, close_ups: Sequence[CloseUp] = ()) -> Mapping[str, Callable[[Path], None]]:
    """Name of a file -> draws it, of all pictures that are of the page alone.

    Args:
        evaluation: what was found.
        close_ups: what static cameras saw with equipment and without.
    """
    found: dict[str, Callable[[Path], None]] = {}
    if (agreement := evaluation.agreement) is not None:
        found[WAYS] = partial(draw_ways, evaluation.solved, agreement)
        found[JOINTS] = partial(draw_joints, evaluation.solved, agreement)
        if agreement.angles:
            found[BLAND_ALTMAN] = partial(draw_bland_altman, agreement)
    if evaluation.gait is not None:
        found[GAIT] = partial(draw_gait, evaluation.gait, evaluation.true_gait)
    if (both := evaluation.constraints) is not None:
        found[CONSTRAINTS] = partial(draw_constraints, both, close_ups)
        found[HELD_WAYS] = partial(draw_ways_with_and_without, both)
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
    if evaluation.gait is not None:
        blocks += gait_section(evaluation.gait, evaluation.true_gait)
    if evaluation.constraints is not None:
        blocks += constraint_section(evaluation.constraints)
    blocks += [Picture(file, caption) for file, caption in pictures.items()]
    return Page(solved.path.resolve().name, tuple(blocks))
