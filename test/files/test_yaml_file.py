"""The one reader of YAML: what it refuses, with which line, and that it takes neither time nor memory for it."""

import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.boards.board import read_board
from bodycam_ros.body.body_file import read_body
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import camera_from_yaml
from bodycam_ros.errors import BodycamError, MapError
from bodycam_ros.files.yaml_file import MOST_NODES, read_yaml, yaml_document
from bodycam_ros.ingest.timing_file import read_offsets
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import read_settings_file

KINDS = {
    "body.yaml": "body file",
    "rom/rig.yaml": "rig file",
    "reference/camera.yaml": "camera_info YAML",
    "reference/board.yaml": "board description",
    "map/map.yaml": "summary of a map",
    "study.yaml": "study file",
    "../config/all_settings.yaml": "settings file",
    "../config/equipment/bicycle.yaml": "equipment file",
}


def bomb(first: str, again: str) -> str:
    """A kilobyte that stands for nine to the ninth power of what its first line holds."""
    lines = [f"a: &a {first}"]
    for before, name in zip("abcdefghi", "bcdefghij", strict=True):
        lines.append(f"{name}: &{name} " + again % ", ".join([f"*{before}"] * 9))
    return "\n".join(lines)


def test_plain_values_are_as_pyyaml_has_them(sample: Path) -> None:
    for name, kind in KINDS.items():
        expected = yaml.safe_load((sample / name).read_text())
        assert read_yaml(sample / name, kind, MapError) == expected
    with_exponents = "{a: 1e-4, b: -2E5, c: '1e-4', d: 1e, e: x1e4}"
    expected = {"a": 1e-4, "b": -2e5, "c": "1e-4", "d": "1e", "e": "x1e4"}
    assert yaml_document(with_exponents, "file", MapError) == expected
    assert yaml_document("{a: &a [1, 2.5], b: *a, c: {<<: {d: 2001-02-03}}}", "file", MapError)["b"] == [1, 2.5]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[" * 3000, ("line 1", 50)),
        ("{a: " * 3000, ("line 1", 50)),
        ("\n".join(" " * depth + "a:" for depth in range(3000)), ("line 51",)),
        ("\na: " + "9" * 5000, ("line 2", 5000)),
        ("a: 0x" + "f" * 5000, ("line 1", 5002)),
        ("a: 1" + ":0" * 400 + ".0", ("line 1", 803)),
        (bomb("[0, 0, 0, 0, 0, 0, 0, 0, 0]", "[%s]"), ("line 6", MOST_NODES)),
        (bomb("{x: 0, y: 0}", "{<<: [%s]}"), ("line 6", MOST_NODES)),
        ("a: &a [*a]", ("line 1", "*a")),
        ("a: 1\na: 2", ("line 2", "'a'")),
        ("a: 2001-99-99", ("line 1", "2001-99-99", "timestamp")),
        ("a: !!timestamp soon", ("line 1", "soon", "timestamp")),
        ("a: !!int many", ("line 1", "many", "int")),
        ("a: !!python/object/apply:os.system [ls]", ("line 1",)),
        ("{[1]: 2}", ("line 1",)),
        ("a: \x1b[31m", ()),
        ("a: 1\n---\nb: 2", ("line 2",)),
        ("a: [", ("line 2",)),
    ],
)
def test_what_no_person_writes_is_refused_with_its_line(text: str, named: tuple[object, ...]) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    started = time.process_time()
    with naming(MapError, "map", *named) as caught:
        yaml_document(text, "map", MapError)
    assert len(str(caught.value)) < 500
    assert time.process_time() - started < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000, "kilobytes"


def test_many_names_in_a_table_take_no_time() -> None:
    names = MOST_NODES // 2 - 1
    started = time.process_time()
    assert len(yaml_document("\n".join(f"k{n}: 1" for n in range(names)), "body", MapError)) == names
    assert time.process_time() - started < 10.0


@pytest.mark.parametrize(("name", "kind"), KINDS.items())
def test_a_file_of_another_kind_is_named_for_what_it_is(sample: Path, name: str, kind: str) -> None:
    assert read_yaml(sample / name, kind, MapError)
    with naming(MapError, sample / name, "file of offsets", kind):
        read_yaml(sample / name, "file of offsets", MapError)


@pytest.mark.parametrize(
    "name", ["attachments", "camera_matrix", "corners_in_board", "square_size_m", "gravity_aligned"]
)
def test_names_of_a_users_choice_make_no_file_of_another_kind(tmp_path: Path, name: str) -> None:
    """Cameras are named as their videos: attachments.mp4."""
    (tmp_path / "offsets.yaml").write_text(f"{{hand: 0.0, {name}: 1.5}}")
    assert read_offsets(tmp_path / "offsets.yaml", ["hand", name]).times[name].start_s == 1.5


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path, tmp_path / "none", tmp_path / ("x" * 300)):
        with naming(MapError, path):
            read_yaml(path, "map", MapError)


def test_other_encodings_and_large_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_bytes("\nname: Müller".encode("latin-1"))
    with naming(MapError, file, "line 2", "UTF-8"):
        read_yaml(file, "map", MapError)
    with file.open("wb") as large:
        large.truncate(2**34)
    with naming(MapError, file, "16 MB"):
        read_yaml(file, "map", MapError)
    file.write_bytes(b"\xef\xbb\xbfname: Bj\xc3\xb6rn")
    assert read_yaml(file, "map", MapError) == {"name": "Björn"}


def load_map(path: Path) -> ReferenceMap:
    path.rename(path.parent / "map.yaml")
    return ReferenceMap.load(path.parent)


READERS: dict[str, Callable[[Path], object]] = {
    "body": read_body,
    "rig": Rig.from_yaml,
    "settings": read_settings_file,
    "camera": camera_from_yaml,
    "board": read_board,
    "map": load_map,
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    "text",
    [
        bomb("[0, 0, 0, 0, 0, 0, 0, 0, 0]", "[%s]"),
        "a: " + "[" * 3000,
        "version: " + "9" * 5000,
        "{1: 2, null: 3, 2001-02-03: 4}",
        "2001-02-03",
        "name: [" + "0, " * 1000 + "]\ncameras: " + "x" * 10_000,
        None,
    ],
    ids=["bomb", "deep", "number", "keys", "date", "long", "pipe"],
)
def test_every_file_of_ours_is_read_by_it(tmp_path: Path, reader: str, text: str | None) -> None:
    path = tmp_path / "file.yaml"
    os.mkfifo(path) if text is None else path.write_text(text)
    with naming(BodycamError, tmp_path / "map.yaml" if reader == "map" else path) as caught:
        READERS[reader](path)
    assert len(str(caught.value)) < 700 + 3 * len(str(tmp_path))
