"""Tables on terminals of 80 columns."""

import pytest
from known_calibration import calibrated_body, worrying_diagnosis
from rich.table import Table

from bodycam_ros.calibration.report.terminal_report import print_report
from bodycam_ros.terminal import Terminal

NAMES = ("waist_front", "upper_arm_right")
COLUMNS = ("images", "registered", "lost [s]", "tracks", "landmarks", "motion [px]", "gap [mm]", "gap [deg]")


def table(columns: tuple[str, ...] = COLUMNS) -> Table:
    made = Table("camera", *columns, title="cameras", caption="lost: the longest time without a pose")
    for name in NAMES:
        made.add_row(name, *(f"{100.0 + number:.1f}" for number in range(len(columns))))
    return made


def printed(made: Table, width: int) -> str:
    terminal = Terminal(width=width, force_terminal=True, color_system=None, record=True)
    with terminal.capture() as captured:
        terminal.print(made)
    return captured.get()


def test_a_table_that_fits_stays_as_it_is() -> None:
    assert "┃ registered ┃" in printed(table(), 120)


@pytest.mark.parametrize("columns", [COLUMNS, (*COLUMNS, "light")])
def test_no_name_and_no_figure_is_broken(columns: tuple[str, ...]) -> None:
    text = printed(table(columns), 80)
    assert max(map(len, text.splitlines())) <= 80
    for word in (*NAMES, *(f"{100.0 + number:.1f}" for number in range(len(columns))), "regis-", "tered", "tracks"):
        assert word in text.split()
    assert "…" not in text


def test_cells_of_several_words_break_between_them() -> None:
    made = Table("joint", "cameras")
    made.add_row("hip_left", " ".join(NAMES * 8))
    assert printed(made, 60).split().count("upper_arm_right") == 8


@pytest.mark.parametrize("width", [80, 100])
def test_the_report_of_a_calibration_fits_with_all_its_names(width: int) -> None:
    body = calibrated_body()
    terminal = Terminal(width=width, force_terminal=True, color_system=None)
    with terminal.capture() as captured:
        print_report(worrying_diagnosis(body), terminal)
    text = captured.get()
    assert max(map(len, text.splitlines())) <= width
    words = text.split()
    for camera, mount in body.mounts.items():
        row = next(line for line in text.splitlines() if line.split()[:2] == [camera, mount.segment])
        assert "…" not in row
    assert all(joint.name in words for joint in body.tree_joints)
