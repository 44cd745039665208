"""Reading a study file: names, what is shared, and messages that say which key of which file is wrong."""

import re
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import StudyError
from bodycam_ros.study.study import Study
from bodycam_ros.study.study_file import read_study
from bodycam_ros.study.study_lock import LOCK

DOCS = Path(__file__).parents[2] / "docs" / "study.md"

STUDY = """\
places: {hall: {map: hall}}
subjects: {anna: {body: anna.yaml}}
recordings: [{path: takes/*}]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for bag in ("takes/run", "takes/walk 1", "days/mo/anna/bag", "days/tu/anna/bag", "rom"):
        (tmp_path / bag).mkdir(parents=True)
        (tmp_path / bag / "metadata.yaml").touch()
    for name in ("hall", "photos"):
        (tmp_path / name).mkdir()
    for name in ("anna.yaml", "rig.yaml", "takes/notes.txt", "takes/.hidden", "my_bicycle.yaml"):
        (tmp_path / name).touch()
    (tmp_path / "settings.yaml").write_text("/**: {ros__parameters: {tracker: {max_track_age: 1.5}}}\n")
    return tmp_path


def read(folder: Path, text: str) -> Study:
    (folder / "knees.yaml").write_text(text)
    return read_study(folder / "knees.yaml")


def test_a_pattern_means_all_recordings_that_fit_it(folder: Path) -> None:
    study = read(folder, STUDY)
    assert [recording.name for recording in study.recordings] == ["run", "walk_1"]
    assert {(each.subject, each.place) for each in study.recordings} == {("anna", "hall")}
    assert folder / "takes" / "walk 1" in study.inputs


def test_what_a_study_made_is_no_recording_of_the_next_run(folder: Path) -> None:
    for made in ("knees", "days/another"):
        (folder / made / "takes/run/bag").mkdir(parents=True)
        (folder / made / "takes/run/bag/metadata.yaml").touch()
        (folder / made / LOCK).touch()
    names = [recording.name for recording in read(folder, STUDY.replace("takes/*", "'**/bag'")).recordings]
    assert names == ["days_mo_anna", "days_tu_anna"]


def test_names_come_from_what_fits_the_wildcards(folder: Path) -> None:
    assert [r.name for r in read(folder, STUDY.replace("takes/*", "days/*/anna/bag")).recordings] == ["mo", "tu"]
    assert [r.name for r in read(folder, STUDY.replace("takes/*", "days/*/*/bag")).recordings] == ["mo_anna", "tu_anna"]


def test_everything_that_can_be_said_is_read(folder: Path) -> None:
    study = read(
        folder,
        """
        places: {hall: {map: hall}, yard: {reference: photos}}
        subjects: {anna: {body: anna.yaml}, bert: {rig: rig.yaml, range_of_motion: rom, place: yard}}
        recordings:
          - {path: takes/*, subject: anna, place: hall, truth: "{path}/metadata.yaml"}
          - {path: days/mo/anna/bag, name: monday, subject: bert, place: yard, equipment: my_bicycle.yaml}
        settings: settings.yaml
        equipment: bicycle
        exports: [bvh, csv]
        """,
    )
    run, _, monday = study.recordings
    assert run.truth == folder / "takes/run/metadata.yaml" and run.equipment == "bicycle"
    assert (monday.name, monday.subject, monday.equipment) == ("monday", "bert", folder / "my_bicycle.yaml")
    bert = study.subjects["bert"]
    assert bert.rom is not None and bert.rom.is_bag and bert.place == "yard"
    assert study.settings == folder / "settings.yaml" and study.exports == ("bvh", "csv")


@pytest.mark.parametrize(
    ("change", "by", "named"),
    [
        ("{path: takes/*}", "{path: takes/*, subject: ann}", ("recordings[0].subject", "ann")),
        ("{path: takes/*}", "{path: nowhere/*}", ("recordings[0].path", "nowhere/*")),
        ("{path: takes/*}", "{path: takes/ran}", ("recordings[0].path", "takes/ran")),
        ("{path: takes/*}", "{path: takes/notes.txt}", ("recordings[0].path", "takes/notes.txt")),
        ("{path: takes/*}", "{path: takes/*, name: run}", ("recordings[0].path", "name")),
        ("[{path: takes/*}]", "[{path: takes/*}, {path: takes/run}]", ("recordings[1]", "run")),
        (
            "{path: takes/*}",
            "{path: takes/*, truth: 'true/{name}'}",
            ("recordings[0].truth", "true/run"),
        ),
        ("{path: takes/*}", "{path: takes/*, paht: 1}", ("paht", "recordings[0]")),
        ("[{path: takes/*}]", "[]", ("$.recordings",)),
        ("{body: anna.yaml}", "{}", ("subjects.anna", "body")),
        ("{body: anna.yaml}", "{range_of_motion: rom}", ("subjects.anna", "rig")),
        ("{map: hall}", "{map: hall, reference: photos}", ("places.hall", "map")),
        ("{map: hall}", "{map: [hall]}", ("$.places[...].map",)),
        ("hall:", "../hall:", ("places",)),
        ("places: {hall: {map: hall}}", "places: {}", ("$.places",)),
        ("places: {hall: {map: hall}}", "", ("places",)),
        ("recordings", "exports: [bvh, bvx]\nrecordings", ("exports[1]", "bvx")),
        ("recordings", "settings: nowhere.yaml\nrecordings", ("settings", "nowhere.yaml")),
        ("recordings", "equipment: tricycle\nrecordings", ("equipment", "tricycle")),
        (STUDY, "- 1", ()),
    ],
)
def test_a_mistake_is_said_with_file_and_key(folder: Path, change: str, by: str, named: tuple[str, ...]) -> None:
    assert change in STUDY
    with naming(StudyError, "knees.yaml", *named):
        read(folder, STUDY.replace(change, by))


def test_the_example_in_the_docs_is_one(folder: Path) -> None:
    text = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)[0]
    for bag in ("anna/takes/run", "bert/rom", "bert/monday/walk", "bert/tuesday/walk", "bert/ride"):
        (folder / bag).mkdir(parents=True)
        (folder / bag / "metadata.yaml").touch()
    for made in ("maps/hall", "photographs/yard", "anna/body.yaml", "bert/rig.yaml", "bert/truth/monday.c3d"):
        (folder / made).mkdir(parents=True)
    (folder / "bert/truth/tuesday.c3d").touch()
    study = read(folder, text)
    assert [recording.name for recording in study.recordings] == ["run", "monday", "tuesday", "ride"]
