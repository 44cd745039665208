"""The steps of a study are those of ``bodycam run``, and the workflow that is written has a rule for each."""

import json
import os
import re
import shlex
from pathlib import Path

import pytest

from bodycam_ros.cli.main import _parser
from bodycam_ros.errors import OutputError
from bodycam_ros.study.job_resources import JobResources
from bodycam_ros.study.steps import RecordingFolder, steps_of
from bodycam_ros.study.study import STAGES, StageResources, StudySteps, study_steps
from bodycam_ros.study.study_file import read_study
from bodycam_ros.study.workflow_folder import SNAKEFILE, STEPS, WorkflowFolder, stages_of

ALL = (
    "reference/a.jpg", "rig.yaml", "rom/head.mp4", "takes/walk/head.mp4", "takes/run/metadata.yaml", "settings.yaml",
    "lenses/head.yaml", "equipment.yaml",
)  # fmt: skip

STUDY = """\
places: {hall: {reference: reference}}
subjects: {anna: {rig: rig.yaml, range_of_motion: rom}}
recordings: [{path: takes/*}]
settings: settings.yaml
lenses: lenses
equipment: equipment.yaml
"""


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for file in ALL:
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("/**: {ros__parameters: {}}\n")
    return tmp_path


def planned(data: Path, text: str = STUDY) -> tuple[WorkflowFolder, StudySteps]:
    (data / "study.yaml").write_text(text)
    study = read_study(data / "study.yaml")
    folder = WorkflowFolder.at(data / "study", study)
    return folder, study_steps(study, folder.path)


def test_they_are_the_commands_that_one_folder_needs(data: Path) -> None:
    """Each with the same words, but for where things are made."""
    folder, steps = planned(data)
    alone = RecordingFolder.look_into(data)
    places = {
        alone.solved / "map": folder.path / "places/hall/map",
        alone.solved / "rom": folder.path / "subjects/anna/bag",
        alone.solved / "body.yaml": folder.path / "subjects/anna/body.yaml",
        **{
            alone.solved / "takes" / take / made: folder.path / "takes" / take / made
            for take in ("run", "walk")
            for made in ("bag", "out", "report")
        },
    }
    as_paths = {str(old): str(new) for old, new in places.items()}
    words = [tuple(as_paths.get(word, word) for word in step.words) for step in steps_of(alone)]
    assert [step.words for step in steps] == words


def test_every_command_is_understood_and_what_it_reads_is_there_or_made_before(data: Path) -> None:
    _, steps = planned(data, f"{STUDY}exports: [bvh, mot]\n")
    made: set[Path] = set()
    for step in steps:
        assert all(path.exists() or path in made for path in step.inputs), step.name
        made |= {step.output, *step.beside}
        assert _parser(step.words).parse_args([*step.words, *(["--jobs", "2"] if step.is_parallel else [])]).run
    assert len(made) == 2 * 2 + 2 + 1 + 2 * 2 + 2 * 2, "two bags and their clocks, a body and its page, a map, ..."


def write(folder: WorkflowFolder, steps: StudySteps, cores: int = 4) -> dict[str, dict[str, dict[str, str]]]:
    folder.write(steps, JobResources.on_this_machine(cores, stages_of(steps), folder.study.resources))
    written: dict[str, dict[str, dict[str, str]]] = json.loads((folder.path / STEPS).read_text())["steps"]
    return written


def test_the_rule_of_each_stage_makes_what_its_steps_make(data: Path) -> None:
    folder, steps = planned(data, f"{STUDY}exports: [bvh]\n")
    written = write(folder, steps)
    rules = (folder.path / SNAKEFILE).read_text()
    for stage in STAGES:
        assert written[stage]
        rule = re.search(rf"^rule {stage}:\n(.*?)\n\n", f"{rules}\n\n", re.MULTILINE | re.DOTALL)
        assert rule is not None
        outputs = re.findall(r'"([^"]*)"', re.findall(r"output: (.*)", rule[1])[0])
        (log,) = re.findall(r'log: "(.*)"', rule[1])
        for at, job in written[stage].items():
            assert [pattern.replace("{at}", at) for pattern in outputs] == job["makes"]
            step = next(each for each in steps if each.name == job["name"])
            assert folder.log_of(step) == folder.path / log.replace("{at}", at)


def test_a_study_that_is_moved_with_its_recordings_is_the_same(
    data: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    before = write(*planned(data))
    moved = tmp_path_factory.mktemp("other") / "place"
    os.rename(data, moved)
    assert write(*planned(moved)) == before
    words = shlex.split(before["replay"]["run"]["words"])
    assert words[:4] == ["replay", "../takes/run", "--map", "places/hall/map"]


def test_what_is_written_again_keeps_its_time_unless_it_says_something_else(data: Path) -> None:
    text = STUDY.replace("settings: settings.yaml", "settings: {tracker: {max_track_age: 1.5}}")
    folder, steps = planned(data, text)
    write(folder, steps)
    times = {path.name: path.stat().st_mtime_ns for path in folder.path.iterdir()}
    write(folder, steps)
    assert {path.name: path.stat().st_mtime_ns for path in folder.path.iterdir()} == times
    write(*planned(data, text.replace("1.5", "1.6")))
    assert "1.6" in (folder.path / "settings.yaml").read_text()


def test_nothing_else_is_taken_for_a_folder_of_a_study(data: Path) -> None:
    with pytest.raises(OutputError, match="contains what this command reads"):
        WorkflowFolder.at(data, planned(data)[0].study)
    (data / "other").mkdir()
    (data / "other" / "letter.txt").touch()
    with pytest.raises(OutputError, match=r"other: is there, and is no folder of a study \(it has no steps\.json\)"):
        WorkflowFolder.at(data / "other", planned(data)[0].study)


def test_cores_are_shared_among_the_jobs_of_a_stage() -> None:
    jobs = {"map": 1, "ingest": 3, "body": 2, "replay": 40, "evaluate": 40, "export": 40}
    said = {"replay": StageResources(threads=2), "body": StageResources(memory_mb=10**9)}
    here = JobResources.on_this_machine(16, jobs, said)
    assert here.threads == {"map": 16, "ingest": 5, "body": 8, "replay": 2, "evaluate": 1, "export": 1}
    assert here.memory_mb["body"] == here.limit_mb, "else it would never be begun"
    cluster = JobResources.on_a_cluster(said)
    assert cluster.threads["replay"] == 2 and cluster.threads["map"] == 4
    assert cluster.memory_mb["body"] == 10**9


def test_paths_that_are_called_as_commands_are_paths(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (data / "reference").rename(data / "map")
    (data / "takes" / "run").rename(data / "bicycle")
    (data / "study.yaml").write_text(
        STUDY.replace("reference: reference", "reference: map")
        .replace("takes/*", "bicycle")
        .replace("equipment.yaml", "bicycle")
    )
    monkeypatch.chdir(data)
    study = read_study(Path("study.yaml"))
    folder = WorkflowFolder.at(Path("study"), study)
    steps = study_steps(study, folder.path)
    folder.write(steps, JobResources.on_a_cluster({}))
    jobs = json.loads((folder.path / STEPS).read_text())["steps"]
    assert shlex.split(jobs["map"]["hall"]["words"])[:2] == ["map", "../map"]
    replay = shlex.split(jobs["replay"]["bicycle"]["words"])
    assert replay[:2] == ["replay", "../bicycle"] and replay[replay.index("--equipment") + 1] == "bicycle"
