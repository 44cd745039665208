"""Motions of Motive, Qualisys, Xsens and OpenSim, as those write them, are the known walk."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers.captured_files import Z_UP_TO_Y_UP, origins, seconds
from helpers.exported_files import JOINT_M, Exported
from helpers.known_walk import Walk
from scipy.spatial.transform import Rotation

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.read_captured import read_captured, read_joint_points
from bodycam_ros.geometry import Array

GAP = 7
RATE = 30.0


def with_gap(walk: Walk) -> dict[str, Array]:
    """Segment -> origins (T, 3) [m], those of the torso missing in one frame."""
    points = {name: rows.copy() for name, rows in origins(walk).items()}
    points["torso"][GAP] = np.nan
    return points


def rotations(walk: Walk) -> dict[str, Array]:
    return {name: walk.world_T_segment[:, row, :3, :3] for name, row in walk.body.segment_index.items()}


def motive(path: Path, walk: Walk, unit: str = "Meters", per_m: float = 1.0, more: str = "") -> Path:
    points = with_gap(walk)
    heads = [["", "Type"], ["", "Name"], ["", "ID"], ["", ""], ["Frame", "Time (Seconds)"]]
    for name in points:
        for part, axes in (("Rotation", "XYZW"), ("Position", "XYZ"), ("Mean Marker Error", " ")):
            for axis in axes:
                for row, cell in zip(heads, ("Bone", f"Skeleton:{name}", "12", part, axis.strip()), strict=True):
                    row.append(cell)
    lines = [f"Format Version,1.23,Take Name,a,Export Frame Rate,30,Rotation Type,Quaternion,Length Units,{unit}", ""]
    heads.insert(3, more.split(",")) if more else None
    lines += [",".join(row) for row in heads]
    for k, time in enumerate(seconds(walk)):
        cells = [str(k), f"{time:.6f}"]
        for name, rows in points.items():
            q = Rotation.from_matrix(Z_UP_TO_Y_UP @ rotations(walk)[name][k]).as_quat()
            place = per_m * Z_UP_TO_Y_UP @ rows[k]
            cells += [f"{v:.9f}" for v in q] + ["" if np.isnan(v) else f"{v:.6f}" for v in place] + ["0.001"]
        lines.append(",".join(cells))
    path.write_text("\ufeff" + "\n".join(lines) + "\n")
    return path


def qualisys(path: Path, walk: Walk, titles: bool = False, fixed: bool = False, gap: str = "0.000") -> Path:
    points = with_gap(walk)
    lines = [
        f"NO_OF_FRAMES\t{len(walk.stamps_ns)}",
        "NO_OF_CAMERAS\t8",
        f"NO_OF_MARKERS\t{len(points)}",
        "FREQUENCY\t30",
    ]
    lines += ["NO_OF_ANALOG\t0", "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--", "TIME_STAMP\t2026-11-28, 12:00:00\t1.5"]
    lines += ["DATA_INCLUDED\t3D", "MARKER_NAMES\t" + "\t".join(points)]
    if titles:
        lines.append("\t".join(["Frame", "Time", *(f"{name} {axis}" for name in points for axis in "XYZ")]))
    for k, time in enumerate(seconds(walk)):
        cells = [str(k + 1), f"{time:.5f}"] if titles or fixed else []
        cells += [gap if np.isnan(v) else f"{1000 * v:.4f}" for rows in points.values() for v in rows[k]]
        lines.append("\t".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def mvnx(path: Path, walk: Walk) -> Path:
    points = origins(walk)
    frames = []
    for k in range(-1, len(walk.stamps_ns)):
        row = max(k, 0)
        place = " ".join(f"{v:.9f}" for rows in points.values() for v in rows[row])
        q = [Rotation.from_matrix(R[row]).as_quat()[[3, 0, 1, 2]] for R in rotations(walk).values()]
        kind = "identity" if k < 0 else "normal"
        frames.append(
            f'<frame time="{round(33.333 * row)}" index="{row}" type="{kind}"><orientation>'
            f"{' '.join(f'{v:.9f}' for v in np.ravel(q))}</orientation><position>{place}</position></frame>"
        )
    segments = "".join(f'<segment label="{name}" id="{k}"/>' for k, name in enumerate(points, 1))
    path.write_text(
        '<?xml version="1.0"?><!DOCTYPE mvnx><mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
        f'<subject label="a" frameRate="30" segmentCount="{len(points)}"><segments>{segments}</segments>'
        f'<frames segmentCount="{len(points)}">{"".join(frames)}</frames></subject></mvnx>'
    )
    return path


def kinematics(path: Path, walk: Walk, endings: tuple[str, str, str] = ("_X", "_Y", "_Z"), turns: bool = True) -> Path:
    points = with_gap(walk)
    names = ["time"]
    for name in points:
        names += [name + ending for ending in endings] + ([f"{name}_O{axis}" for axis in "xyz"] if turns else [])
    lines = ["Positions", "version=1", f"nRows={len(walk.stamps_ns)}", f"nColumns={len(names)}", "inDegrees=yes"]
    lines += ["endheader", "\t".join(names)]
    for k, time in enumerate(seconds(walk)):
        cells = [f"{time:.6f}"]
        for name, rows in points.items():
            cells += ["NaN" if np.isnan(v) else f"{v:.9f}" for v in Z_UP_TO_Y_UP @ rows[k]]
            R = Rotation.from_matrix(Z_UP_TO_Y_UP @ rotations(walk)[name][k])
            cells += [f"{v:.7f}" for v in R.as_euler("XYZ", degrees=True)] if turns else []
        lines.append("\t".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def vec3(path: Path, walk: Walk) -> Path:
    points = with_gap(walk)
    lines = ["DataRate=30", "DataType=Vec3", "version=3", "endheader", "\t".join(["time", *points])]
    for k, time in enumerate(seconds(walk)):
        cells = [",".join(f"{v:.9f}" for v in Z_UP_TO_Y_UP @ rows[k]) for rows in points.values()]
        lines.append("\t".join([f"{time:.6f}", *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path


FILES: dict[str, Callable[[Path, Walk], Path]] = {
    "motive": lambda folder, walk: motive(folder / "a.csv", walk),
    "motive mm": lambda folder, walk: motive(folder / "a.csv", walk, "Millimeters", 1e3, ",Parent,1,1"),
    "qualisys": lambda folder, walk: qualisys(folder / "a.tsv", walk),
    "qualisys titles": lambda folder, walk: qualisys(folder / "a.tsv", walk, titles=True, gap=""),
    "qualisys times": lambda folder, walk: qualisys(folder / "a.tsv", walk, fixed=True, gap="NaN"),
    "mvnx": lambda folder, walk: mvnx(folder / "a.mvnx", walk),
    "sto": lambda folder, walk: kinematics(folder / "a.sto", walk),
    "mot": lambda folder, walk: kinematics(folder / "a.mot", walk, ("_tx", "_ty", "_tz"), turns=False),
    "sto vec3": lambda folder, walk: vec3(folder / "a.sto", walk),
}


@pytest.mark.parametrize("kind", FILES)
def test_points_gaps_and_rotations_are_those_of_the_walk(walk: Walk, tmp_path: Path, kind: str) -> None:
    captured = read_captured(FILES[kind](tmp_path, walk))
    expected = origins(walk) if kind == "mvnx" else with_gap(walk)
    named = {name.rpartition(":")[2]: name for name in captured.points}
    assert {*named} == {*expected}
    for name, rows in expected.items():
        np.testing.assert_allclose(captured.points[named[name]], rows, atol=2e-6, err_msg=name)
    np.testing.assert_allclose(1e-9 * (captured.stamps_ns - captured.stamps_ns[0]), seconds(walk), atol=1e-6)
    turned = ("motive", "motive mm", "mvnx", "sto")
    assert bool(captured.rotations) == (kind in turned)
    for name, R in captured.rotations.items():
        np.testing.assert_allclose(R, rotations(walk)[name.rpartition(":")[2]], atol=1e-6)


def test_points_of_motive_may_start_a_body_and_a_plain_csv_too(walk: Walk, tmp_path: Path) -> None:
    points = read_joint_points(motive(tmp_path / "a.csv", walk))
    assert points is not None and "Skeleton:pelvis" in points


def test_a_glb_moves_the_joints_that_it_was_made_from(sample_out: Path, tmp_path: Path) -> None:
    exported = Exported.of(sample_out, tmp_path)
    captured = read_captured(exported.file("glb"))
    for segment in exported.solved.body_segments:
        ours = exported.places(segment)
        np.testing.assert_allclose(captured.points[segment], ours, rtol=0.0, atol=JOINT_M, err_msg=segment)
    assert captured.parents["shin_left"] == "thigh_left"


STO = "a\nendheader\n"


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("a.csv", "time,LHip_x\n", "CSV of Motive: line 1: expected 'Format Version'"),
        ("a.csv", "Format Version,1.2,Length Units,Ells\n", "not 'Ells'"),
        ("a.csv", "Format Version,1.2\n\nFrame,Time\n", "expected lines of types, names"),
        ("a.tsv", "a\tb\n1\t2\n", "TSV of Qualisys: expected Qualisys' TSV"),
        ("a.tsv", "NO_OF_FRAMES\t2\nFREQUENCY\tx\nMARKER_NAMES\tA\n1\t2\t3\n", "FREQUENCY: expected a number"),
        ("a.tsv", "NO_OF_FRAMES\t2\nFREQUENCY\t9\nMARKER_NAMES\tA\tB\n1\t2\t3\t4\t5\n", "2 names and 5 columns"),
        ("a.mvnx", "<mvnx><subject", "MVNX:"),
        ("a.mvnx", '<!DOCTYPE a [<!ENTITY b "c">]><mvnx/>', "has entities"),
        ("a.mvnx", "<mvnx/>", "expected <subject frameRate"),
        ("a.sto", "time a\n", "expected a line 'endheader'"),
        ("a.sto", "endheader\ntime\n", "it has no columns or no rows"),
        ("a.sto", "Of accelerations.\nendheader\ntime\ta_X\n0\t1\n", "it has accelerations, and not positions"),
        ("a.sto", STO + "time\tpelvis_tilt\n0\t1\n1\t2\n", "joint angles or forces alone place nothing"),
        ("a.mot", STO + "time\tg_force_vx\tg_force_vy\tg_force_vz\n0\t1\t2\t3\n1\t1\t2\t3\n", "alone place nothing"),
        ("a.sto", "DataType=Quaternion\nendheader\ntime\ta\n0\t1,0,0,0\n", "orientations alone place nothing"),
        ("a.sto", STO + "time\ta_X\ta_Y\n0\t1\n", "line 4: 2 columns, expected 3"),
        ("a.glb", "glTF", "cannot be read as GLB"),
        ("a.gltf", '{"nodes": []}', "it has no animation"),
        ("a.gltf", "[]", "cannot be read as GLTF"),
        (
            "a.gltf",
            '{"nodes": [{}], "buffers": [{"uri": "../a.bin"}], "animations": [{"samplers": [], "channels": []}]}',
            "a buffer is in another folder",
        ),
    ],
)
def test_what_is_none_of_them_is_named(tmp_path: Path, name: str, text: str, told: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match=re.escape(told)) as caught:
        read_captured(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)


def test_a_captured_motion_is_one_kind_for_all(walk: Walk, tmp_path: Path) -> None:
    kinds = {read_captured(write(tmp_path, walk)).kind for write in FILES.values()}
    assert kinds == {"Motive CSV", "Qualisys TSV", "MVNX", "STO"}
    assert isinstance(read_captured(mvnx(tmp_path / "b.mvnx", walk)), CapturedMotion)
