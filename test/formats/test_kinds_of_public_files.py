"""Kinds of files that public collections have, and that were refused or misread: each is written here, small."""

import json
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.formats.read_captured import read_captured, read_joint_points

ROWS = 3


def written(path: Path, *lines: str) -> CapturedMotion:
    path.write_text("\n".join(lines) + "\n")
    return read_captured(path)


def body_kinematics(path: Path, title: str = "Positions", angle: str = "90") -> CapturedMotion:
    """As OpenSim's BodyKinematics writes all three of its files: the description is the same."""
    names = [
        f"{body}_{part}" for body in ("pelvis", "femur_r", "tibia_r") for part in ("X", "Y", "Z", "Ox", "Oy", "Oz")
    ]
    rows = ["\t".join([f"{0.01 * row:.2f}", *["1", "2", "3", angle, "0", "0"] * 3]) for row in range(ROWS)]
    described = ("This file contains the kinematics (positions and orientations,", "velocities or accelerations)")
    return written(
        path, title, "version=1", "inDegrees=no", *described, "Angles are in degrees.", "endheader",
        "\t".join(["time", *names]), *rows,
    )  # fmt: skip


def test_positions_of_opensim_are_read_though_their_description_names_velocities(tmp_path: Path) -> None:
    captured = body_kinematics(tmp_path / "a_pos_global.sto")
    np.testing.assert_allclose(captured.points["pelvis"][0], [1.0, -3.0, 2.0])
    with pytest.raises(RecordingError, match="velocities, and not positions"):
        body_kinematics(tmp_path / "a_vel_global.sto", "Velocities")


def test_angles_of_opensim_are_degrees_where_its_description_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    R = body_kinematics(tmp_path / "a.sto").rotations["femur_r"][0]
    np.testing.assert_allclose(R, Y_UP_TO_Z_UP @ Rotation.from_euler("x", 90.0, degrees=True).as_matrix(), atol=1e-9)
    assert "inDegrees=no and angles in degrees" in caplog.text


def test_a_name_twice_is_no_fault_of_columns_that_are_no_points(tmp_path: Path) -> None:
    points = "\t".join(f"{name}_t{axis}" for name in ("a", "b", "c") for axis in "xyz")
    rows = ["\t".join([str(row), *["1", "2", "3"] * 3, "7", "8"]) for row in range(ROWS)]
    captured = written(tmp_path / "a.mot", "ik", "endheader", f"time\t{points}\tforce_vx\tforce_vx", *rows)
    np.testing.assert_allclose(captured.points["c"][-1], [1.0, -3.0, 2.0])
    with pytest.raises(RecordingError, match="two columns are named 'a_tx'"):
        written(tmp_path / "b.mot", "ik", "endheader", f"time\t{points}\ta_tx\tforce_vx", *rows)


@pytest.mark.parametrize("kind", ["sto", "trc", "tum"])
def test_a_row_that_repeats_its_time_is_left_out_and_named(
    tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    times, path = (0.0, 0.1, 0.1, 0.2), tmp_path / f"a.{kind}"
    if kind == "sto":
        names = "\t".join(f"{name}_{axis}" for name in "abc" for axis in "XYZ")
        rows = ["\t".join([str(time), *[str(row)] * 9]) for row, time in enumerate(times, 1)]
        captured = written(path, "Positions", "endheader", f"time\t{names}", *rows)
    elif kind == "trc":
        rows = [f"{row}\t{time}\t{row}\t{row}\t{row}" for row, time in enumerate(times, 1)]
        head = ("PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumMarkers\tUnits", "10\t1\tm", "Frame#\tTime\ta")
        captured = written(path, *head, "\t\tX1\tY1\tZ1", *rows)
    else:
        captured = written(path, *(f"{time} {row} 0 0 0 0 0 1" for row, time in enumerate(times, 1)))
    assert captured.points["a"][:, 0].tolist() == [1.0, 2.0, 4.0]
    assert "1 of its 4 rows have the time of the row before, the first of them row 3" in caplog.text


def test_times_rounded_to_milliseconds_are_no_other_rate(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    head = ("PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumMarkers\tUnits", "120.0\t1\tm", "Frame#\tTime\ta")
    rows = (f"{row}\t{round(row / 120, 3)}\t1\t2\t3" for row in range(1, 121))
    captured = written(tmp_path / "a.trc", *head, "\t\tX1\tY1\tZ1", *rows)
    assert 1e9 / captured.frame_ns == pytest.approx(120.0, rel=1e-3)
    assert "frames a second" not in caplog.text


def test_bodies_of_qualisys_are_read_with_a_blank_column_between_them(tmp_path: Path) -> None:
    turned = Rotation.from_euler("xyz", [20.0, -40.0, 70.0], degrees=True).as_matrix()
    bodies = [
        [1000.0, 2000.0, 3000.0, 0, 0, 0, 0.2, *np.eye(3).ravel()],
        [4e3, 5e3, 6e3, 0, 0, 0, 0.3, *turned.T.ravel()],
    ]
    row = "\t\t".join("\t".join(f"{value:.9f}" for value in body) for body in bodies) + "\t"
    titles = "\t".join(f" {title}" for title in ("X", "Y", "Z", "Yaw", "Pitch", "Roll", "Residual", *"012345678"))
    head = ("NO_OF_FRAMES\t2", "FREQUENCY\t256", "DATA_INCLUDED\t6D", "BODY_NAMES\tThigh IMU\tFoot IMU")
    captured = written(tmp_path / "a_6D.tsv", *head, titles, row, row)
    np.testing.assert_allclose(captured.points["Foot IMU"][1], [4.0, 5.0, 6.0])
    np.testing.assert_allclose(captured.rotations["Foot IMU"][1], turned, atol=1e-8)
    with pytest.raises(RecordingError, match="it has 'Angle', and neither MARKER_NAMES"):
        written(tmp_path / "a.tsv", "NO_OF_FRAMES\t2", "FREQUENCY\t9", "DATA_INCLUDED\tAngle", "1\t2", "1\t2")


def test_headers_of_motive_and_bvh_that_contradict_their_rows_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    heads = (
        ",Type,Marker,Marker,Marker",
        ",Name,a,a,a",
        ",ID,1,1,1",
        ",,Position,Position,Position",
        "Frame,Time,X,Y,Z",
    )
    first = "Format Version,1.25,Export Frame Rate,100,Total Exported Frames,17263,Length Units,Meters"
    written(tmp_path / "a.csv", first, "", *heads, *(f"{row},{row / 50},1,2,3" for row in range(4)))
    assert "says 17263 frames, it has 4; these are read" in caplog.text
    assert "says 100 frames a second, its times 50; the times are taken" in caplog.text
    joint = (
        "HIERARCHY",
        "ROOT a",
        "{",
        "OFFSET 0 0 0",
        "CHANNELS 1 Xrotation",
        "End Site",
        "{",
        "OFFSET 0 1 0",
        "}",
        "}",
    )
    written(tmp_path / "a.bvh", *joint, "MOTION", "Frames: 2", "Frame Time: 0.1", "1", "2", "3")
    assert "says 2 frames, it has 3; these are read" in caplog.text


def gltf(path: Path, interpolation: str, animations: int = 1) -> CapturedMotion:
    """A bar of 1 m that turns by 90 degrees about x between two key frames, a second apart."""
    half = float(np.sqrt(0.5))
    turns = [[0.0, 0.0, 0.0, 1.0], [half, 0.0, 0.0, half]]
    if interpolation == "CUBICSPLINE":
        still = [0.0] * 4  # both slopes of each key frame: it starts and stops softly
        turns = [still, turns[0], still, still, turns[1], still]
    content = struct.pack("<2f", 0.0, 1.0) + np.array(turns, "<f4").tobytes()
    (path.parent / "a.bin").write_bytes(content)
    animation = {
        "name": "turn",
        "samplers": [{"input": 0, "output": 1, "interpolation": interpolation}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
    }
    document = {
        "nodes": [{"name": "base", "children": [1]}, {"name": "tip", "translation": [0.0, 1.0, 0.0]}],
        "skins": [{"joints": [0, 1]}],
        "animations": [animation] + [{**animation, "name": f"other {k}"} for k in range(1, animations)],
        "buffers": [{"uri": "a.bin", "byteLength": len(content)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0}, {"buffer": 0, "byteOffset": 8}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "SCALAR", "count": 2},
            {"bufferView": 1, "componentType": 5126, "type": "VEC4", "count": len(turns)},
        ],
    }
    path.write_text(json.dumps(document))
    return read_captured(path)


@pytest.mark.parametrize(("interpolation", "share"), [("LINEAR", 0.25), ("CUBICSPLINE", None)])
def test_a_joint_moves_on_an_arc_between_key_frames(tmp_path: Path, interpolation: str, share: float | None) -> None:
    captured = gltf(tmp_path / "a.gltf", interpolation)
    tip = captured.points_at("tip", np.array([0.25]))[0]
    if share is None:  # the spline of both quaternions, made a rotation: Hermite's 3 t^2 - 2 t^3 at a quarter
        weight = 3 * 0.25**2 - 2 * 0.25**3
        x, w = weight * np.sqrt(0.5), 1.0 - weight + weight * np.sqrt(0.5)
        angle = 2.0 * np.arctan2(x, w)
    else:
        angle = share * np.pi / 2.0
    # About x, y turns towards z; with z up, towards -y.
    np.testing.assert_allclose(tip, [0.0, -np.sin(angle), np.cos(angle)], atol=1e-4)
    assert np.linalg.norm(tip) == pytest.approx(1.0, abs=1e-4)


def test_animations_that_are_not_read_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        gltf(tmp_path / "a.gltf", "LINEAR", animations=3)
    assert "has 3 animations; the first is read, 'turn', and not other 1, other 2" in caplog.text


def test_a_decimal_comma_is_named(tmp_path: Path) -> None:
    head = (
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tNumMarkers\tUnits",
        "10\t1\tm",
        "Frame#\tTime\ta",
        "\t\tX1\tY1\tZ1",
    )
    with pytest.raises(RecordingError, match="line 6: '1,5' is no number; write decimals with a point"):
        written(tmp_path / "a.trc", *head, "1\t0\t1,5\t2\t3")
    (tmp_path / "a.csv").write_text('LHip_x,LHip_y,LHip_z\n"1,5",2,3\n')
    with pytest.raises(BodyError, match="point 'LHip': '1,5' is no number; write decimals with a point"):
        read_joint_points(tmp_path / "a.csv")


TRC = ("PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumMarkers\tUnits", "10\t2\tm", "Frame#\tTime\ta\t\t\tb", "\t\tX1")


@pytest.mark.parametrize("kind", ["trc", "sto", "tsv", "csv"])
def test_a_row_that_a_copy_cut_off_is_left_out_and_named(
    tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    path, mark, heads = tmp_path / f"a.{kind}", "\t", TRC
    first = [["1", "0"], ["2", "0.1"], ["3", "0.2"]]
    if kind == "sto":
        first = [row[1:] for row in first]
        heads = ("Positions", "endheader", "\t".join(["time", *(f"{name}_{axis}" for name in "abc" for axis in "XYZ")]))
    elif kind == "tsv":
        heads = ("NO_OF_FRAMES\t3", "FREQUENCY\t10", "MARKER_NAMES\ta\tb\tc")
    elif kind == "csv":
        mark, kinds = ",", [",".join([",", *[word] * 9]) for word in ("Marker", "", "Position")]
        names = ",".join([",Name", *(name for name in "abc" for _ in range(3))])
        heads = ("Format Version,1.2", kinds[0], names, kinds[1], kinds[2], "Frame,Time," + ",".join("XYZ" * 3))
    values = 6 if kind == "trc" else 9
    text = "\n".join([*heads, *(mark.join([*row, *["1.25"] * values]) for row in first)])
    path.write_text(text[: -len("25,1.25")])
    assert len(read_captured(path).stamps_ns) == 2
    assert "ends within its last row, which is left out" in caplog.text
    path.write_text(text)
    assert len(read_captured(path).stamps_ns) == 3


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_names_and_ends_of_lines_of_other_systems_are_read(tmp_path: Path, encoding: str, end: str) -> None:
    lines = (
        *TRC[:3],
        "Frame#\tTime\tHüfte\t\t\tKnie…",
        "\t\tX1",
        "1\t0\t1\t2\t3\t4\t5\t6",
        "2\t0.1\t1\t2\t3\t4\t5\t6",
        "",
    )
    (tmp_path / "a.trc").write_bytes(end.join(lines).encode(encoding))
    assert [*read_captured(tmp_path / "a.trc").points] == ["Hüfte", "Knie…"]
    bvh = ("HIERARCHY", "ROOT Hüfte", "{", "OFFSET 0 0 0", "CHANNELS 1 Xrotation", "}", "MOTION", "Frames: 2")
    (tmp_path / "a.bvh").write_bytes(end.join([*bvh, "Frame Time: 0.1", "1", "2"]).encode(encoding))
    assert [*read_captured(tmp_path / "a.bvh").points] == ["Hüfte"]


def test_a_c3d_that_was_cut_off_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["a"]
    file["data"]["points"] = np.ones((4, 1, 300))
    file.write(str(tmp_path / "whole.c3d"))
    assert len(read_captured(tmp_path / "whole.c3d").stamps_ns) == 300
    assert not caplog.records
    content = (tmp_path / "whole.c3d").read_bytes()
    (tmp_path / "cut.c3d").write_bytes(content[:-2000])
    assert 100 < len(read_captured(tmp_path / "cut.c3d").stamps_ns) < 300
    assert "its header says 300 frames, it has" in caplog.text


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.csv", b"Format Version,1.2\n" + b"0" * 200_000, "field larger than field limit"),
        ("a.tum", b"1 0 0 0 0 0 0 1\n2 0,5 0 0 0 0 0 1\n", "line 2: '0,5' is no number"),
        ("a.tum", b"1 0 0 0 0 0 0 1\n2 0 0\n", "line 2: expected 8 numbers"),
    ],
)
def test_damage_is_named_with_its_place(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=told):
        read_captured(tmp_path / name)
