"""Lines of one kind are one line with a count; nothing else is merged, and no name is lost."""

import re
from pathlib import Path

import bodycam_ros
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.files.merged_lines import merge_lines


def test_equal_remarks_are_one_line_with_all_names() -> None:
    lines = ["camera head: has no sound", "camera shin: is dark", "camera foot, part 2: has no sound"]
    assert merge_lines(lines) == ["each of 2 cameras (head, foot, part 2): has no sound", "camera shin: is dark"]


def test_remarks_that_differ_in_figures_and_file_names_are_one_line_from_three_on() -> None:
    lines = [f"camera {name}: {name}.mp4 has {count} of 90.5 frames" for name, count in (("head", 7), ("shin", 80))]
    assert merge_lines(lines) == lines
    (one,) = merge_lines([*lines, "camera foot: foot.mp4 has 3 of 12 frames"])
    assert one == "camera head: head.mp4 has 7 of 90.5 frames; likewise 2 more cameras: shin, foot"


def test_segments_keep_the_times_when_each_was_lost() -> None:
    spans = {"hand": "0.0 to 1.7 s", "shin": "0.2 to 3.0 s", "foot": "1.0 to 2.5 s"}
    lines = [f"segment {name}: not where the body has it: {span}; lost" for name, span in spans.items()]
    assert merge_lines(lines) == [f"{lines[0]}; likewise 2 more segments: shin (0.2 to 3.0 s), foot (1.0 to 2.5 s)"]


def test_other_lines_stay_and_equal_ones_are_one() -> None:
    lines = ["the map is not metric", "camera a: one thing", "joint a: one thing", "the map is not metric"]
    assert merge_lines(lines) == lines[:3]


def test_signed_figures_are_never_minus_zero() -> None:
    """A person writes 0.0: every signed figure of a sentence asks for it, as every cell of a table does."""
    package = Path(bodycam_ros.__file__).parent
    signed = re.compile(r":\+(?!z)\.?\d*[fe]\}")
    assert not [path.name for path in package.rglob("*.py") if signed.search(path.read_text())]
    (table,) = [column_table("t", "camera", [("x", "x", "+.1f")], {"head": {"x": -0.04}, "shin": {"x": -0.06}}).table]
    assert [row[1] for row in table.rows] == ["0.0", "-0.1"]
