"""The steps of a folder and of a study: the same commands, each understood, its inputs there or made before."""

import os
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.cli.main import join_command, make_parser
from bodycam_ros.errors import OutputError, RecordingError, StudyError
from bodycam_ros.study.study import Step, Study, study_steps
from bodycam_ros.study.study_file import LAYOUT, check_results_folder, list_missing, read_recording_folder, read_study

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
exports: [bvh, mot]
"""


def folder_with(path: Path, *files: str) -> Study:
    for file in files:
        (path / file).parent.mkdir(parents=True, exist_ok=True)
        (path / file).write_text("/**: {ros__parameters: {}}\n")
    return read_recording_folder(path)


def check(steps: list[Step]) -> None:
    """Every command is understood, and its inputs exist or are outputs of earlier steps."""
    made: set[Path] = set()
    for step in steps:
        assert all(path.exists() or path in made for path in step.inputs), step.name
        made.add(step.output)
        words = join_command([*step.words, *(["--jobs", "2"] if step.is_parallel else [])])
        assert make_parser(words).parse_args(words).run


def test_all_steps_of_a_folder(tmp_path: Path) -> None:
    study = folder_with(tmp_path, *ALL)
    steps = study_steps(study, tmp_path / "solved")
    names = [step.name for step in steps]
    assert names[:3] == ["map", "ingest range of motion", "body"]
    assert names[3:] == ["run: replay", "run: evaluate", "walk: ingest", "walk: replay", "walk: evaluate"]
    assert not list_missing(study)
    check(steps)


def test_a_recording_in_stretches_has_a_step_for_each(tmp_path: Path) -> None:
    folder_with(tmp_path, *(file for file in ALL if file != "equipment.yaml"))
    text = STUDY.replace("equipment: equipment.yaml\n", "").replace("path: takes/*", "path: takes/run, stretches: 3")
    (tmp_path / "study.yaml").write_text(text)
    steps = study_steps(read_study(tmp_path / "study.yaml"), tmp_path / "results")
    check(steps)
    first, *stretches, merge = [step for step in steps if step.name.startswith("run: replay")]
    assert [step.words[:2] for step in (first, *stretches, merge)] == [
        ("replay", "first"), *[("replay", "stretch")] * 3, ("replay", "merge")
    ]  # fmt: skip
    assert all(first.output in step.inputs for step in (*stretches, merge))
    assert {step.output for step in stretches} <= set(merge.inputs)
    assert merge.output == tmp_path / "results/takes/run/out"
    assert sum(step.share for step in stretches) == pytest.approx(1.0)


def test_equipment_is_not_solved_in_stretches(tmp_path: Path) -> None:
    folder_with(tmp_path, *ALL)
    (tmp_path / "study.yaml").write_text(STUDY.replace("path: takes/*", "path: takes/run, stretches: 3"))
    with naming(StudyError, tmp_path / "study.yaml", "recordings[0].stretches"):
        read_study(tmp_path / "study.yaml")


def test_a_study_runs_the_commands_of_a_folder(tmp_path: Path) -> None:
    alone = [step.words for step in study_steps(folder_with(tmp_path, *ALL), tmp_path / "results")]
    (tmp_path / "study.yaml").write_text(STUDY)
    steps = study_steps(read_study(tmp_path / "study.yaml"), tmp_path / "results")
    check(steps)
    places = (f"{tmp_path}/results/places/hall", f"{tmp_path}/results/subjects/anna")
    words = [
        tuple(
            word.replace(places[0], f"{tmp_path}/results").replace(places[1], f"{tmp_path}/results")
            for word in step.words
        )
        for step in steps
        if step.stage != "export"
    ]
    assert words == alone
    assert [step.output.name for step in steps if step.stage == "export"] == [
        "run.bvh",
        "run.mot",
        "walk.bvh",
        "walk.mot",
    ]


@pytest.mark.parametrize(
    ("files", "steps", "lacks"),
    [
        (("map/map.yaml", "body.yaml", "takes/walk.mcap"), ["walk: replay", "walk: evaluate"], []),
        (("takes/walk/metadata.yaml",), [], ["reference/", "rom/"]),
        (("reference/a.jpg",), ["map"], ["rom/", "takes/"]),
        (("map/map.yaml", "rom/metadata.yaml", "takes/walk/metadata.yaml"), [], ["rig.yaml"]),
        (("rom/head.mp4", "rig.yaml"), ["ingest range of motion"], ["reference/", "takes/"]),
    ],
)
def test_what_is_possible_is_done_and_what_is_missing_is_named(
    tmp_path: Path, files: tuple[str, ...], steps: list[str], lacks: list[str]
) -> None:
    study = folder_with(tmp_path, *files)
    assert [step.name for step in study_steps(study, tmp_path / "solved")] == steps
    missing = list_missing(study)
    assert len(missing) == len(lacks) and all(text.startswith(name) for text, name in zip(missing, lacks, strict=True))


def test_a_take_with_braces_in_its_name_is_solved(tmp_path: Path) -> None:
    study = folder_with(tmp_path, "map/map.yaml", "body.yaml", "takes/walk {1}/metadata.yaml")
    assert [recording.name for recording in study.recordings] == ["walk _1_"]


def test_names_of_takes_become_names_of_files_anywhere(tmp_path: Path) -> None:
    take = os.fsdecode(b"takes/walk\xff\n1/metadata.yaml")
    study = folder_with(tmp_path, "map/map.yaml", "body.yaml", take)
    assert [recording.name for recording in study.recordings] == ["walk__1"]


def test_a_link_to_a_disk_that_is_not_there_is_named(tmp_path: Path) -> None:
    folder_with(tmp_path, *ALL)
    (tmp_path / "takes" / ".#walk").symlink_to("anna@desk.1234")  # an editor's
    assert len(read_recording_folder(tmp_path).recordings) == 2
    (tmp_path / "takes" / "far").symlink_to("/nowhere/far")
    with naming(RecordingError, tmp_path / "takes" / "far", "/nowhere/far"):
        read_recording_folder(tmp_path)
    (tmp_path / "study.yaml").write_text(STUDY)
    with naming(StudyError, "recordings[0].path", tmp_path / "takes" / "far", "/nowhere/far"):
        read_study(tmp_path / "study.yaml")


def test_other_folders_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(RecordingError) as refused:
            read_recording_folder(path)
        assert str(path) in str(refused.value) and LAYOUT in str(refused.value)
    with naming(RecordingError, tmp_path / "takes" / "walk.mcap", tmp_path / "takes" / "walk"):
        folder_with(tmp_path, "takes/walk/metadata.yaml", "takes/walk.mcap")


def test_results_go_to_a_folder_of_their_own(tmp_path: Path) -> None:
    folder_with(tmp_path, *ALL)
    (tmp_path / "study.yaml").write_text(STUDY)
    study = read_study(tmp_path / "study.yaml")
    with naming(OutputError, tmp_path, tmp_path / "study.yaml"):
        check_results_folder(tmp_path, study)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").touch()
    with naming(OutputError, tmp_path / "other"):
        check_results_folder(tmp_path / "other", study)
