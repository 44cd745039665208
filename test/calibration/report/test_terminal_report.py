import io

from known_calibration import calibrated_body, good_diagnosis, worrying_diagnosis
from rich.console import Console

from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report.terminal_report import print_report


def printed(diagnosis: CalibrationDiagnosis, **options: object) -> str:
    """What comes out of a pipe, or of what the options say."""
    console = Console(**{"file": io.StringIO(), **options})  # type: ignore[arg-type]
    print_report(diagnosis, console)
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return text


def test_warnings_come_last_all_of_them() -> None:
    diagnosis = worrying_diagnosis(calibrated_body())
    text = " ".join(printed(diagnosis).split())
    tail = text[text.index("look at 1.") :]
    assert len(diagnosis.warnings) == 3
    for warning in diagnosis.warnings:
        assert warning in tail
    assert printed(good_diagnosis(calibrated_body())).rstrip().endswith("no warnings")
