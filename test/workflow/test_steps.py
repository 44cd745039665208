"""Which steps a folder of recordings needs, and which of them are done."""

import os
from pathlib import Path

import pytest

from bodycam_ros.cli.main import _parser
from bodycam_ros.errors import OutputError, RecordingError
from bodycam_ros.study.steps import LAYOUT, DoneSteps, RecordingFolder, Step, fingerprint, state_of, steps_of


def laid_out(folder: Path, *files: str) -> RecordingFolder:
    for file in files:
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file)
    return RecordingFolder.look_into(folder)


ALL = (
    "reference/a.jpg",
    "rig.yaml",
    "rom/head.mp4",
    "takes/walk/head.mp4",
    "takes/run/metadata.yaml",
    "settings.yaml",
    "lenses/head.yaml",
    "equipment.yaml",
)


def test_every_step_is_taken_in_its_order(tmp_path: Path) -> None:
    folder = laid_out(tmp_path, *ALL)
    steps = list(steps_of(folder))
    assert [step.name for step in steps] == [
        "map",
        "range of motion: ingest",
        "body",
        "run: replay",
        "run: evaluate",
        "walk: ingest",
        "walk: replay",
        "walk: evaluate",
    ]
    assert folder.missing() == []
    made = {folder.path / name for name in ("reference", "rig.yaml", "rom", "takes/walk", "takes/run", "lenses")}
    made |= {folder.path / "settings.yaml", folder.path / "equipment.yaml"}
    for step in steps:  # everything that is read is there, or has been made
        assert set(step.inputs) <= made, step.name
        made.add(step.output)
        words = list(step.words)
        assert _parser(words).parse_args([*words, *(["--jobs", "2"] if step.is_parallel else [])]).run


def test_what_is_ready_is_taken_as_it_is(tmp_path: Path) -> None:
    folder = laid_out(tmp_path, "map/map.yaml", "body.yaml", "takes/walk.mcap")
    steps = list(steps_of(folder))
    assert [step.name for step in steps] == ["walk: replay", "walk: evaluate"]
    assert {folder.path / "map", folder.path / "body.yaml"} < set(steps[0].inputs)


@pytest.mark.parametrize(
    ("files", "steps", "lacks"),
    [
        (("takes/walk/metadata.yaml",), [], ["reference/", "rom/"]),
        (("reference/a.jpg",), ["map"], ["rom/", "takes/"]),
        (("map/map.yaml", "rom/metadata.yaml", "takes/walk/metadata.yaml"), [], ["rig.yaml"]),
        (("rom/head.mp4", "rig.yaml"), ["range of motion: ingest"], ["reference/", "takes/"]),
    ],
)
def test_what_can_be_done_is_done_and_what_lacks_is_named(
    tmp_path: Path, files: tuple[str, ...], steps: list[str], lacks: list[str]
) -> None:
    folder = laid_out(tmp_path, *files)
    assert [step.name for step in steps_of(folder)] == steps
    missing = folder.missing()
    assert len(missing) == len(lacks) and all(said.startswith(name) for said, name in zip(missing, lacks, strict=True))


def test_a_folder_of_something_else_is_told_what_it_should_be(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(RecordingError) as refused:
            RecordingFolder.look_into(path)
        assert str(path) in str(refused.value) and LAYOUT in str(refused.value)


def test_takes_of_one_name_would_replace_each_other(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"walk\.mcap: is a take of the same name as .*walk; rename"):
        laid_out(tmp_path, "takes/walk/metadata.yaml", "takes/walk.mcap")


@pytest.fixture
def step(tmp_path: Path) -> Step:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "images.mcap").write_text("images")
    (tmp_path / "body.yaml").write_text("body")
    (tmp_path / "out").write_text("out")
    inputs = (tmp_path / "bag", tmp_path / "body.yaml")
    return Step("walk: replay", ("replay", *map(str, inputs), "--passes", "1"), inputs, tmp_path / "out")


@pytest.fixture
def done(tmp_path: Path, step: Step) -> DoneSteps:
    notes = DoneSteps(tmp_path / "steps")
    assert notes.exit_code(step, anew=False) is None
    notes.note(step, state_of(step), 3)
    return notes


def test_a_step_is_done_until_something_changes(done: DoneSteps, step: Step) -> None:
    assert done.exit_code(step, anew=False) == 3
    assert done.exit_code(step, anew=True) is None
    step.inputs[1].write_text("another body")
    assert done.exit_code(step, anew=False) is None


def test_another_flag_is_another_step(done: DoneSteps, step: Step) -> None:
    other = Step(step.name, (*step.words[:-1], "3"), step.inputs, step.output)
    assert done.exit_code(other, anew=False) is None


def test_what_was_made_and_is_gone_is_made_again(done: DoneSteps, step: Step) -> None:
    step.output.unlink()
    assert done.exit_code(step, anew=False) is None


def test_what_was_changed_by_hand_is_never_replaced(done: DoneSteps, step: Step) -> None:
    step.output.write_text("corrected")
    assert done.exit_code(step, anew=False) == 3  # a correction makes nothing stale but what reads it
    for anew in (True, False):
        step.inputs[1].write_text("another body")
        with pytest.raises(OutputError, match="was changed after 'bodycam run' wrote it"):
            done.exit_code(step, anew)


def test_a_damaged_note_is_none(done: DoneSteps, step: Step, tmp_path: Path) -> None:
    (note,) = (tmp_path / "steps").iterdir()
    note.write_text("{")
    assert done.exit_code(step, anew=False) is None


def test_a_fingerprint_knows_contents_names_and_large_files_by_time(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "a").write_text("1")
    first = fingerprint(folder)
    os.utime(folder / "a", ns=(0, 0))
    assert fingerprint(folder) == first
    (folder / "a").rename(folder / "b")
    assert fingerprint(folder) != first
    large = tmp_path / "large"
    large.write_bytes(bytes(5_000_000))
    before = fingerprint(large)
    os.utime(large, ns=(0, 0))
    assert fingerprint(large) != before
    assert fingerprint(tmp_path / "nowhere") == fingerprint(tmp_path / "neither")
