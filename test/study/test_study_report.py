"""What is said of recordings: figures of those that are done, step and reason of those that are not."""

import csv
import io
import json
from pathlib import Path

import pytest

from bodycam_ros.evaluate.page.write_page import html, markdown
from bodycam_ros.study.recording_result import RecordingResult, failure_of, results_of
from bodycam_ros.study.study_file import read_study
from bodycam_ros.study.study_report import counted, study_csv, study_page
from bodycam_ros.study.study_steps import StudySteps, study_steps
from bodycam_ros.study.workflow_folder import WorkflowFolder

FIGURES = {
    "duration_s": 2.0,
    "verdict": {"level": "doubtful"},
    "cameras": {"a": {"images": 10, "registered": 1.0}, "b": {"images": 30, "registered": 0.5}},
    "truth": {"position_cm": {"mean": 0.5}, "angle_deg": {"mean": None}},
}


@pytest.fixture
def folder(tmp_path: Path) -> WorkflowFolder:
    for name in ("cut|off", "good", "later"):
        (tmp_path / "takes" / name).mkdir(parents=True)
        (tmp_path / "takes" / name / "metadata.yaml").touch()
    for name in ("rom", "hall"):
        (tmp_path / name).mkdir()
    for name in ("rom/metadata.yaml", "anna.yaml", "rig.yaml"):
        (tmp_path / name).touch()
    (tmp_path / "knees.yaml").write_text(
        "places: {hall: {map: hall}}\n"
        "subjects: {anna: {body: anna.yaml}, bert: {rig: rig.yaml, range_of_motion: rom}}\n"
        "recordings: [{path: 'takes/[cg]*', subject: anna}, {path: takes/later, subject: bert}]\n"
    )
    return WorkflowFolder.at(tmp_path / "knees", read_study(tmp_path / "knees.yaml"))


def done(folder: WorkflowFolder, steps: StudySteps) -> list[RecordingResult]:
    """One recording solved, one of which the replay failed, and one whose body could not be made."""
    by_name = {step.name: step for step in steps}
    (by_name["good: replay"].output).mkdir(parents=True)
    report = by_name["good: evaluate"].output
    report.mkdir()
    (report / "summary.json").write_text(json.dumps(FIGURES))
    said = {
        "cut_off: replay": "a table\nbodycam: error: bag: is cut off,\nwhat a pity\n",
        "bert: body": "",
        "good: replay": "fine\n",
    }
    for name, text in said.items():
        log = folder.log_of(by_name[name])
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(text)
    folder.log_of(by_name["good: replay"]).with_suffix(".tsv").write_text("s\th:m:s\n12.5\t0:00:12\n")
    return results_of(folder.study, folder, steps)


def test_every_recording_has_its_figures_or_its_reason(folder: WorkflowFolder) -> None:
    steps = study_steps(folder.study, folder.path)
    results = done(folder, steps)
    assert counted(results) == "3 recordings: 1 doubtful, 2 failed"
    cut_off, good, later = csv.DictReader(io.StringIO(study_csv(results, folder.path)))
    assert (cut_off["failed_step"], cut_off["reason"]) == ("cut_off: replay", "bag: is cut off, what a pity")
    assert (later["failed_step"], later["reason"]) == ("bert: body", "it was killed before it could say why")
    assert (good["verdict"], good["registered"], good["took_s"]) == ("doubtful", "0.625", "12.5")
    assert (good["position_error_cm"], good["angle_error_deg"], good["speed_m_s"]) == ("0.5", "", "")
    assert good["report"] == "takes/good/report"


def test_the_page_leads_to_the_reports(folder: WorkflowFolder) -> None:
    page = study_page("knees", done(folder, study_steps(folder.study, folder.path)), folder.path)
    text = html(page, folder.path)
    assert '<td><a href="takes/good/report/report.html">good</a></td>' in text and "62.5" in text
    assert "cadence" not in text, "nobody walks"
    said = markdown(page)
    assert "[good](takes/good/report/report.html)" in said and "| cut\\_off |" in said


def test_what_was_never_begun_has_no_reason(folder: WorkflowFolder) -> None:
    steps = study_steps(folder.study, folder.path)
    assert {failure_of(folder, step) for step in steps} == {""}
    assert counted(results_of(folder.study, folder, steps)) == "3 recordings: 3 not done"
