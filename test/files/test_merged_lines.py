"""Lines of one kind are one line with a count; nothing else is merged, and no name is lost."""

from bodycam_ros.files.merged_lines import merge_lines


def test_equal_remarks_are_one_line_with_all_names() -> None:
    lines = ["camera head: has no sound", "camera shin: is dark", "camera foot, part 2: has no sound"]
    assert merge_lines(lines) == ["each of 2 cameras (head, foot, part 2): has no sound", "camera shin: is dark"]


def test_remarks_that_differ_in_figures_and_file_names_are_one_line_from_three_on() -> None:
    lines = [f"camera {name}: {name}.mp4 has {count} of 90.5 frames" for name, count in (("head", 7), ("shin", 80))]
    assert merge_lines(lines) == lines
    (one,) = merge_lines([*lines, "camera foot: foot.mp4 has 3 of 12 frames"])
    assert one == "camera head: head.mp4 has 7 of 90.5 frames; likewise 2 more cameras: shin, foot"


def test_other_lines_stay_and_equal_ones_are_one() -> None:
    lines = ["the map is not metric", "camera a: one thing", "joint a: one thing", "the map is not metric"]
    assert merge_lines(lines) == lines[:3]
