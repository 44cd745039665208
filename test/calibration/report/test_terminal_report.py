import io
import re

from known_calibration import calibrated_body, good_diagnosis, worrying_diagnosis
from rich.console import Console

from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report.report_tables import report_tables
from bodycam_ros.calibration.report.terminal_report import WIDTH, print_report


def printed(diagnosis: CalibrationDiagnosis, **options: object) -> str:
    """What comes out of a pipe, or of what the options say."""
    console = Console(**{"file": io.StringIO(), **options})  # type: ignore[arg-type]
    print_report(diagnosis, console)
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return text


def test_a_hundred_columns_hold_all_figures_each_on_its_rows_line() -> None:
    diagnosis = worrying_diagnosis(calibrated_body())
    lines = printed(diagnosis).splitlines()
    assert max(map(len, lines)) <= WIDTH
    for table in report_tables(diagnosis):
        for row in table.rows:
            # A list of cameras may go on below.
            figures = [cell for cell in (row[:-1] if table.columns[-1] == "cameras" else row) if cell]
            pattern = r"\s+".join(map(re.escape, figures))
            assert any(re.search(pattern, line) for line in lines), figures
        for heading in table.columns:
            if unit := re.search(r"\[.*]", heading):
                assert any(unit.group() in line for line in lines)


def test_warnings_come_last_all_of_them() -> None:
    diagnosis = worrying_diagnosis(calibrated_body())
    text = " ".join(printed(diagnosis).split())
    tail = text[text.index("look at 1.") :]
    assert len(diagnosis.warnings) == 3
    for warning in diagnosis.warnings:
        assert warning in tail
    assert printed(good_diagnosis(calibrated_body())).rstrip().endswith("no warnings")
