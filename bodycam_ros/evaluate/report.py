"""Writes an evaluation into a folder: figures, pictures and one page with all of them, or nothing."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement import Agreement
from bodycam_ros.evaluate.angle_panels import draw_angles
from bodycam_ros.evaluate.camera_centres import draw_centres
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figures import SameMotion, figures_text
from bodycam_ros.evaluate.gait_cycle import CONVENTION
from bodycam_ros.evaluate.image_views import BODY_KEY, STATIC_KEY, ImageView, draw_views
from bodycam_ros.evaluate.report_sections import ANGLES, CENTRES, WITHOUT, report_sections
from bodycam_ros.evaluate.sections import Picture, Section, render_page
from bodycam_ros.evaluate.summary_picture import draw_summary
from bodycam_ros.evaluate.time_panels import draw_joint_errors, draw_sensors
from bodycam_ros.evaluate.way_picture import draw_way
from bodycam_ros.evaluate.with_and_without import draw_constraints
from bodycam_ros.files.output_place import check_file, check_output
from bodycam_ros.files.whole_file import whole_files
from bodycam_ros.registration.reference_map import ReferenceMap

FIGURES, PAGE = "summary.json", "report.html"
_CAPTIONS = {
    "summary.png": "The recording at a glance.",
    "angles.png": (
        f"Angles of joints in the sagittal plane, left and right; {CONVENTION}. Where three strides or more were found "
        "the angles are over the gait cycle, the mean and one standard deviation over the strides; else over time."
    ),
    "way.png": (
        "The way of the pelvis on the ground, over the photograph of the map that shows most of it, and from above."
    ),
    "joints.png": "Error of each joint against the truth, over time.",
    "centres.png": "Centres of the body cameras against the truth, before the optimisation and after it.",
    "constraints.png": (
        "The recording solved with the equipment and without: distances from its points, and the paths of the attached "
        "points in space."
    ),
    "sensors.png": "Inertial sensors: how far each gyroscope is from its camera as solved.",
    "overlay.png": (
        "Images of the body cameras that see most of the limbs; the solved body puts limbs and landmarks there."
    ),
    "outside.png": (
        "Images of static cameras, with the contour of the solved body; lines show how far the colours of the image "
        "pull it outward or inward."
    ),
}
_NORMAL_CAPTION = (
    " The grey band is normal by {name}: mean and one standard deviation between people. Compare its level only "
    "if its zero is the N-pose too; its shape can be compared in any case."
)
_SECTIONS = {
    "angles.png": (ANGLES,),
    "joints.png": (
        "joints against the truth: position [cm]",
        "joint angles by anatomical plane",
        "error of each joint",
    ),
    "centres.png": (CENTRES,),
    "constraints.png": (WITHOUT,),
    "way.png": ("the way",),
    "sensors.png": ("inertial sensors",),
    "overlay.png": ("cameras", "images of body cameras"),
    "outside.png": ("static cameras", "images of static cameras"),
}
"""Picture -> headings of tables that it explains; without any of them it has a section of the last of these."""


def check_report_folder(folder: Path, inputs: Iterable[Path], force: bool) -> None:
    """Refuse a place that cannot become a report folder, before the work is done.

    Args:
        folder: to be.
        inputs: what the evaluation reads.
        force: replace pictures that no evaluation wrote, too: it writes a summary with them.

    Raises:
        RecordingError: it is a file, or a bag.
        OutputError: it cannot be written to, or there are such pictures.
    """
    what = f"give another folder for {FIGURES} and {PAGE}"
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file; {what}")
    if (folder / "metadata.yaml").exists():
        raise RecordingError(f"{folder}: is a ros2 bag folder; {what}")
    check_output(folder, inputs)
    if force:
        return
    check_file(folder / FIGURES, force=True, mark=b'"image_coverage"', what="summary of 'bodycam evaluate'")
    if not (folder / FIGURES).exists():
        for name in (*_CAPTIONS, PAGE):
            check_file(folder / name, force=False, mark=b"", what="part of a report")


def report_lines(evaluation: Evaluation) -> list[str]:
    """What is not in tables, in sentences."""
    figures = evaluation.figures
    lines = [
        f"{figures.states} states in {figures.duration_s:.2f} s, {figures.image_coverage:.1%} of the images "
        f"covered; {figures.instants_without_camera} frames without any camera"
    ]
    lines += evaluation.made_from.lines
    lines += [f"not solved: {start:.2f} to {end:.2f} s" for start, end in figures.gaps_s]
    if (match := figures.same_motion) is not None:
        lines.append(f"same motion as {evaluation.truth_name}: {_describe_match(match, evaluation.agreement)}")
    return lines if evaluation.agreement is None else [*lines, *evaluation.agreement.lines()]


def _describe_match(match: SameMotion, agreement: Agreement | None) -> str:
    """How sure it is that two motions are the same."""
    likeness, chance = match.correlation, match.by_chance
    if math.isnan(likeness):
        return "the recording is too short to compare"
    text = f"correlation {likeness:.3f}"
    if math.isnan(chance):
        return f"{text}; the recording is too short for its probability by chance"
    if agreement is None or agreement.clock.start_sigma_s == 0.0:
        return f"{text}; it is as high at {chance:.0%} of other clock offsets"
    return f"{text}; unrelated motions reach it with a probability of {max(chance, 1e-9):.2g}"


def _with_pictures(sections: Sequence[Section], pictures: Mapping[str, Picture]) -> list[Section]:
    """The sections, each with the pictures that belong to its table; others have sections of their own."""
    placed = list(sections)
    for name, picture in pictures.items():
        headings = [section.heading for section in placed]
        at = next((headings.index(heading) for heading in _SECTIONS[name] if heading in headings), None)
        if at is not None:
            placed[at] = replace(placed[at], pictures=[*placed[at].pictures, picture])
        else:
            own = Section(_SECTIONS[name][-1], pictures=[picture])
            placed.insert(0 if name == "angles.png" else len(placed), own)
    return placed


def write_report(
    evaluation: Evaluation,
    folder: Path,
    overlay: Sequence[ImageView] = (),
    outside: Sequence[ImageView] = (),
    reference_map: ReferenceMap | None = None,
) -> None:
    """Write figures, pictures and the page; earlier ones are replaced.

    Args:
        evaluation: what was found.
        folder: to write to.
        overlay: views of body cameras.
        outside: views of static cameras.
        reference_map: that it was solved in, to draw the way in it.

    Raises:
        MapError: a photograph of the map is damaged.
        OutputError: they cannot be written.
    """
    figures = evaluation.figures
    with whole_files(folder) as unfinished:
        (unfinished / FIGURES).write_text(figures_text(figures))
        draw_summary(evaluation, unfinished / "summary.png")
        draw_angles(evaluation.solved, evaluation.cycles, unfinished / "angles.png", evaluation.normal)
        if reference_map is not None:
            draw_way(evaluation.solved, reference_map, unfinished / "way.png")
        if evaluation.truth_name:
            draw_joint_errors(evaluation, unfinished / "joints.png")
        if evaluation.centres:
            draw_centres(evaluation.solved, evaluation.centres, unfinished / "centres.png")
        if evaluation.constraints is not None:
            draw_constraints(evaluation.constraints, unfinished / "constraints.png")
        if evaluation.gyroscopes:
            draw_sensors(evaluation.gyroscopes, unfinished / "sensors.png")
        for views, key, name in ((overlay, BODY_KEY, "overlay.png"), (outside, STATIC_KEY, "outside.png")):
            if views:
                draw_views(views, key, unfinished / name)
        captions = dict(_CAPTIONS)
        if evaluation.normal is not None and evaluation.cycles:
            captions["angles.png"] += _NORMAL_CAPTION.format(name=evaluation.normal.name)
        pictures = {
            name: Picture((unfinished / name).read_bytes(), caption)
            for name, caption in captions.items()
            if (unfinished / name).exists()
        }
        verdict = evaluation.verdict
        doubts = () if evaluation.agreement is None else evaluation.agreement.doubts
        warnings = [*(f"{f.level.word}: {f.text}" for f in verdict.findings), *(f"doubtful: {d}" for d in doubts)]
        sections = [
            Section(warnings=warnings, pictures=[pictures.pop("summary.png")]),
            *_with_pictures([*report_sections(figures)], pictures),
        ]
        lines = [f"Verdict: {verdict.text}.", *report_lines(evaluation)]
        page = render_page(evaluation.solved.path.resolve().name, lines, sections)
        (unfinished / PAGE).write_text(page, encoding="utf-8")
