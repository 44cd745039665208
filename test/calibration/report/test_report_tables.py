import io
from dataclasses import replace

import numpy as np
import pytest
from helpers.known_calibration import (
    SHORT_THIGH,
    SLIPPED_CAMERA,
    STIFF_JOINT,
    calibrated_body,
    good_diagnosis,
    worrying_diagnosis,
)
from rich.console import Console

from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.cli.body import print_report
from bodycam_ros.evaluate.body_report import report_sections
from bodycam_ros.evaluate.sections import Table


@pytest.fixture(scope="module")
def diagnosis() -> CalibrationDiagnosis:
    return worrying_diagnosis(calibrated_body())


def tables(diagnosis: CalibrationDiagnosis) -> dict[str, Table]:
    return {section.heading: section.table for section in report_sections(diagnosis) if section.table is not None}


def column(table: Table, heading: str) -> list[str]:
    return [row[table.columns.index(heading)] for row in table.rows]


def numbers(cell: str) -> list[float]:
    return [float(word) for word in cell.split()]


def test_every_joint_is_there_with_its_figures_in_the_units_of_the_headings(diagnosis: CalibrationDiagnosis) -> None:
    table = tables(diagnosis)["joints"]
    for index, joint in enumerate(diagnosis.joints):
        assert column(table, "joint")[index] == joint.name
        assert numbers(column(table, "exercised [deg]")[index]) == pytest.approx(
            np.degrees(joint.exercised_rad), abs=0.5
        )
        assert float(column(table, "gap [mm]")[index]) == pytest.approx(1e3 * joint.gap_m, abs=0.05)
        assert numbers(column(table, "sigma [mm]")[index]) == pytest.approx(1e3 * joint.sigma_m, abs=0.05)


def test_rows_that_a_warning_speaks_of_are_flagged_and_no_others(diagnosis: CalibrationDiagnosis) -> None:
    found = tables(diagnosis)
    for title, name in (("joints", STIFF_JOINT), ("cameras", SLIPPED_CAMERA)):
        (index,) = found[title].flagged
        assert found[title].rows[index][0] == name
    (index,) = found["bones"].flagged
    assert diagnosis.bones[index].segment == SHORT_THIGH
    assert not any(table.flagged for table in tables(good_diagnosis(calibrated_body())).values())


def test_a_camera_that_is_named_as_a_doubtful_joint_is_not_flagged(diagnosis: CalibrationDiagnosis) -> None:
    cameras = [camera for camera in diagnosis.cameras if camera.camera != SLIPPED_CAMERA]
    renamed = replace(diagnosis, cameras=(replace(cameras[0], camera=STIFF_JOINT), *cameras[1:]))
    found = tables(renamed)
    assert len(found["joints"].flagged) == 1 and not found["cameras"].flagged


def test_the_terminal_shows_every_joint_camera_and_warning(diagnosis: CalibrationDiagnosis) -> None:
    console = Console(file=io.StringIO(), width=200)
    print_report(diagnosis, console)
    text = " ".join(console.file.getvalue().split())
    names = [joint.name for joint in diagnosis.joints] + [camera.camera for camera in diagnosis.cameras]
    assert all(shown in text for shown in (*names, *diagnosis.warnings))
