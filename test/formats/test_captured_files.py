"""Files of other systems are read as those who wrote them, and other readers, have them."""

from pathlib import Path

import numpy as np
import pybvh
import pytest
from helpers.captured_files import MIXAMO, Z_UP_TO_Y_UP, origins, seconds, write_bvh, write_c3d, write_trc, write_tum
from helpers.known_walk import FRAME_NS, Walk
from helpers.limited_memory import limited_memory
from helpers.naming import naming

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.read_captured import is_captured, read_captured

FRAME_S = 1e-9 * FRAME_NS


def assert_has(captured: CapturedMotion, walk: Walk, names: dict[str, str], atol: float) -> None:
    for segment, points in origins(walk).items():
        np.testing.assert_allclose(captured.points[names[segment]], points, atol=atol, err_msg=segment)


def test_a_trc_has_its_markers_unit_and_gaps(walk: Walk, tmp_path: Path) -> None:
    points = origins(walk)
    points["torso"] = points["torso"].copy()
    points["torso"][[3, 4, 59]] = np.nan
    for units, per_m in (("mm", 1e3), ("m", 1.0)):
        captured = read_captured(write_trc(tmp_path / "walk.trc", 5.0 + seconds(walk), points, units, per_m))
        for name, of in points.items():
            np.testing.assert_allclose(captured.points[name], of, atol=1e-6)
        np.testing.assert_allclose(1e-9 * captured.stamps_ns, 5.0 + seconds(walk), atol=1e-9)
        assert captured.kind == "TRC" and captured.has_unit


def test_a_c3d_has_its_markers_and_what_nobody_saw(walk: Walk, tmp_path: Path) -> None:
    points = origins(walk)
    points["torso"] = points["torso"].copy()
    points["torso"][7] = np.nan
    for units, per_m in (("mm", 1e3), ("mete", 1.0)):
        captured = read_captured(write_c3d(tmp_path / "walk.c3d", 30.0, points, units, per_m))
        np.testing.assert_allclose(captured.points["torso"], points["torso"], atol=1e-6)
        np.testing.assert_allclose(captured.points["foot_left"], points["foot_left"], atol=1e-6)
        np.testing.assert_allclose(1e-9 * captured.stamps_ns, np.arange(60) / 30.0, atol=1e-8)


def test_a_c3d_whose_label_is_no_text_has_names_that_can_be_written(walk: Walk, tmp_path: Path) -> None:
    """Such a name ended a report."""
    path = write_c3d(tmp_path / "walk.c3d", 30.0, origins(walk), "mm", 1e3)
    content = path.read_bytes()
    assert b"torso" in content
    path.write_bytes(content.replace(b"torso", b"tor\xff\xfe", 1))
    names = read_captured(path).points
    assert "torso" not in names and any(name.startswith("tor") for name in names)
    assert all(name.encode("utf-8") for name in names)


@pytest.mark.parametrize("orders", [("ZXY",), ("XYZ", "YZX", "ZYX", "XZY", "YXZ")])
def test_a_bvh_stands_where_another_reader_has_it(walk: Walk, tmp_path: Path, orders: tuple[str, ...]) -> None:
    path = write_bvh(tmp_path / "walk.bvh", walk, FRAME_S, orders=orders)
    captured = read_captured(path)
    assert not captured.has_unit
    assert_has(captured.scaled(0.01), walk, MIXAMO, 1e-6)
    for segment, row in walk.body.segment_index.items():
        np.testing.assert_allclose(
            captured.rotations[MIXAMO[segment]] @ Z_UP_TO_Y_UP, walk.world_T_segment[:, row, :3, :3], atol=1e-6
        )
    other = pybvh.read_bvh_file(path, world_up="+y")
    theirs = other.joint_positions()
    for column, name in enumerate(other.joint_names):
        np.testing.assert_allclose(captured.points[name] @ Z_UP_TO_Y_UP.T, theirs[:, column], atol=1e-4)


def test_names_of_a_bvh_may_have_spaces_and_the_word_motion(walk: Walk, tmp_path: Path) -> None:
    path = write_bvh(tmp_path / "walk.bvh", walk, FRAME_S)
    names = MIXAMO | {"pelvis": "Bip01 Pelvis", "torso": "MOTION Capture Spine"}
    text = path.read_text()
    for segment, name in names.items():
        text = text.replace(f" {MIXAMO[segment]}\n", f" {name}\n")
    path.write_text(text)
    assert_has(read_captured(path).scaled(0.01), walk, names, 1e-6)


def test_a_folder_of_tum_is_one_motion(walk: Walk, tmp_path: Path) -> None:
    (tmp_path / "tum").mkdir()
    times = 1_700_000_000.0 + seconds(walk)
    for segment, row in walk.body.segment_index.items():
        of = slice(None) if segment == "pelvis" else slice(0, 50)
        write_tum(tmp_path / "tum" / f"{segment}.tum", times[of], walk.world_T_segment[of, row])
    captured = read_captured(tmp_path / "tum")
    assert is_captured(tmp_path / "tum") and len(captured.stamps_ns) in (50, 60)
    np.testing.assert_allclose(captured.points["torso"][:50], origins(walk)["torso"][:50], atol=1e-6)
    np.testing.assert_allclose(
        captured.rotations["pelvis"], walk.world_T_segment[: len(captured.stamps_ns), 0, :3, :3], atol=1e-6
    )


def test_a_point_is_known_between_frames_but_not_across_gaps() -> None:
    stamps_ns = (1e7 * np.arange(100)).astype(np.int64)
    way = np.column_stack([np.sin(5e-9 * stamps_ns), np.cos(5e-9 * stamps_ns), np.zeros(100)])
    way[40:60] = np.nan
    captured = CapturedMotion(Path("made"), "TRC", stamps_ns, {"a": way})
    at = np.array([-0.001, 0.105, 0.45, 0.985, 0.991])
    found = captured.points_at("a", at)
    assert np.isfinite(found[:, 0]).tolist() == [False, True, False, True, False]
    np.testing.assert_allclose(found[1, 0], np.sin(5 * 0.105), atol=1e-6)


TRC = "PathFileType\t4\t(X/Y/Z)\ta\nUnits\n{units}\nFrame#\tTime\t{names}\n\tX1\n{rows}\n"


@pytest.mark.parametrize(
    ("name", "content", "named"),
    [
        ("a.trc", "hello", ("PathFileType",)),
        ("a.trc", TRC.format(units="ells", names="A\t\t", rows="1\t0\t1\t2\t3"), ("line 3", "ells")),
        ("a.trc", TRC.format(units="mm", names="A\t\t\tA\t\t", rows="1\t0\t1\t2\t3"), ("A",)),
        ("a.trc", TRC.format(units="mm", names="A\t\t", rows="1\t0\t1\t2\t3"), ("two frames",)),
        (
            "a.trc",
            TRC.format(units="mm", names="A\t\t", rows="1\t0\t1\t2\tx\n2\t1\t1\t1\t1"),
            ("line 6",),
        ),
        ("a.trc", TRC.format(units="mm", names="A\t\t", rows="1\t1\t1\t2\t3\n2\t0\t1\t2\t3"), ("frame 2",)),
        ("a.c3d", "hello", ("C3D",)),
        ("a.c3d", "\0P" + "\0" * 1022, ("C3D",)),
        ("a.bvh", "hello", ("HIERARCHY",)),
        ("a.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nMOTION", ("brackets",)),
        ("a.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 x\n}\nMOTION", ("'x'",)),
        ("a.bvh", "HIERARCHY\nROOT a\n{\nCHANNELS 1 Wrotation\n}\nMOTION", ("Wrotation",)),
        (
            "a.bvh",
            "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 2\nFrame Time: 0.1\n1\n1 2",
            ("frame 2", 2, 1),
        ),
        (
            "a.bvh",
            "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 3\nFrame Time: 0.1\n1\n2",
            ("2 frames", 3),
        ),
        ("a.bvh", "HIERARCHY\nROOT a\n{\nCHANNELS 1e15 Xrotation\n}\nMOTION", ("6 channels", "1e+15")),
        ("a.bvh", "HIERARCHY\nROOT a\n{\nCHANNELS -1\n}\nMOTION", ("6 channels", -1)),
        (
            "a.trc",
            TRC.format(units="mm", names="\t\t".join(f"m{k}" for k in range(20_000)), rows="1\n" * 100_000),
            ("line 4", 20000),
        ),
        ("a.tum", "1e9999999 0 0 0 0 0 0 1\n", ("TUM",)),
        ("a.tum", "1 2 3", ("TUM", 8)),
        ("a.tum", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1e200\n", ("TUM", "quaternion")),
        ("a.tum", "0 0 0 0 0 0 0 1\n1 1e30 0 0 0 0 0 1\n", ("TUM", "1e+30")),
        ("a.trc", TRC.format(units="mm", names="A\t\t", rows="1\t0\t1\t2\t3\n2\t1e300\t1\t2\t3"), ("1e+300",)),
        (
            "a.bvh",
            "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 2\nFrame Time: 0.1\n1\n1e308",
            ("'a'",),
        ),
        ("a.fbx", "", ()),
    ],
)
def test_what_is_damaged_is_named(tmp_path: Path, name: str, content: str, named: tuple[object, ...]) -> None:
    (tmp_path / name).write_text(content)
    with limited_memory(), naming(RecordingError, tmp_path / name, *named):
        read_captured(tmp_path / name)


def test_a_c3d_that_ends_its_library_is_named(walk: Walk, tmp_path: Path) -> None:
    """One byte of the parameters: ezc3d 1.7.2 follows it out of its memory."""
    path = write_c3d(tmp_path / "walk.c3d", 30.0, {"a": np.ones((10, 3)), "b": np.ones((10, 3))})
    content = bytearray(path.read_bytes())
    content[525] = 0xFF
    path.write_bytes(content)
    with naming(RecordingError, path, "C3D"):
        read_captured(path)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with naming(RecordingError, tmp_path / "a.trc"):
        read_captured(tmp_path / "a.trc")
    (tmp_path / "a.trc").mkdir()
    with naming(RecordingError, tmp_path / "a.trc", "*.tum"):
        read_captured(tmp_path / "a.trc")
