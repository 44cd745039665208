"""bodycam export --character: a rigged humanoid of others, moved, and read back by pygltflib."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.exported_files import Exported
from helpers.known_walk import Walk, write_solved
from helpers.read_glb import OURS_R_SCENE, ReadGlb
from helpers.rigged_character import ANKLE_M, Build, bone_names, write_character
from numpy.typing import NDArray

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.cli.main import main
from bodycam_ros.formats.character_bones import named_bones, vrm_bones
from bodycam_ros.geometry import transform_points
from bodycam_ros.results.stances import find_stances

Array = NDArray[np.float64]

BUILDS = [
    Build("mixamo", unit_m=0.01, posed=True),
    Build("unreal", arms_deg=45.0, leg_m=0.7, hips_m=0.25),
    Build("blender", arms_deg=50.0, leg_m=1.1, shin_share=0.56, z_up=True),
    Build("cmu", leg_m=0.85, shin_share=0.46, hips_m=0.16, posed=True),
    Build("biped", unit_m=0.0254, z_up=True, posed=True),
    Build("vrm", leg_m=0.5, hips_m=0.14),
]


@pytest.fixture(scope="module")
def exported(sample_out: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return Exported.of(sample_out, tmp_path_factory.mktemp("character"))


def follow(exported: Exported, build: Build, *flags: str) -> ReadGlb:
    character = write_character(build, exported.folder / f"{build.family}.hero.glb")
    return ReadGlb(exported.file("glb", "--character", str(character), "--force", *flags, name=f"{build.family}.out"))


def angle_deg(first: Array, second: Array) -> Array:
    cosine = np.sum(first * second, axis=-1) / np.linalg.norm(first, axis=-1) / np.linalg.norm(second, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


@pytest.mark.parametrize("build", BUILDS, ids=lambda build: build.family)
def test_limbs_point_where_the_body_s_do(exported: Exported, build: Build) -> None:
    read, names = follow(exported, build), bone_names(build.family)
    np.testing.assert_allclose(read.seconds, exported.seconds, atol=1e-6)
    for side in ("left", "right"):
        for bone, following, segment, end in (
            ("arm", "forearm", "upper_arm", "forearm"), ("thigh", "shin", "thigh", "shin"),
            ("shin", "foot", "shin", "foot"),
        ):  # fmt: skip
            theirs = read.places(names[f"{following} {side}"]) - read.places(names[f"{bone} {side}"])
            ours = exported.places(f"{end}_{side}") - exported.places(f"{segment}_{side}")
            # Legs of other proportions and hips of another width stand where the feet are.
            assert angle_deg(theirs, ours).max() < (0.1 if bone == "arm" else 10.0)
        forearm = read.places(names[f"hand {side}"]) - read.places(names[f"forearm {side}"])
        down = -exported.solved.world_T_link[f"forearm_{side}"][:, :3, 2]
        assert angle_deg(forearm, down).max() < 0.1
    across = read.places(names["thigh left"]) - read.places(names["thigh right"])
    assert angle_deg(across, exported.places("thigh_left") - exported.places("thigh_right")).max() < 2.0
    shoulders = read.places(names["arm left"]) - read.places(names["arm right"])
    ours = exported.solved.world_T_link["torso"][:, :3, 1]
    assert angle_deg(shoulders, ours).max() < 0.1


@pytest.mark.parametrize("build", BUILDS, ids=lambda build: build.family)
def test_feet_stand_and_hips_are_as_high_as_the_legs_carry_them(exported: Exported, build: Build) -> None:
    read, names = follow(exported, build), bone_names(build.family)
    shin, thigh = (
        np.linalg.norm(exported.places(f"{below}_left") - exported.places(f"{above}_left"), axis=1)[0]
        for above, below in (("shin", "foot"), ("thigh", "shin"))
    )
    scale = build.leg_m / (shin + thigh)
    for side in ("left", "right"):
        foot = exported.solved.world_T_link[f"foot_{side}"]
        soles = transform_points(foot, sole_points(float(shin)))
        stances = find_stances({"foot": soles}, exported.solved.stamps_ns, 1e8)["foot"]
        assert stances
        ankle, rest = read.world(read.rows[names[f"foot {side}"]]), read.world(read.rows[names[f"foot {side}"]], False)
        turned = ankle[:, :3, :3] @ np.linalg.inv(rest[:, :3, :3])
        for point, first, last in stances:
            own = soles[first:last, point, :2]
            slid = np.linalg.norm(own - own.mean(axis=0), axis=1)
            # Below the ankle, and before it, on the sole of the character: in the rest pose it faces along z.
            for ahead in (0.0, 0.12):
                offset = turned @ np.array([0.0, -ANKLE_M, ahead])
                theirs = (ankle[:, :3, 3] + offset)[first:last] @ OURS_R_SCENE.T
                beside = np.linalg.norm(theirs[:, :2] - theirs[:, :2].mean(axis=0), axis=1) - scale * slid
                assert beside.max() < 5e-3
        # As a sole of the body is on the floor, one of the character is.
        below = (ankle[:, :3, 3] + turned @ np.array([0.0, -ANKLE_M, 0.0])) @ OURS_R_SCENE.T
        ours = foot[:, :3, 3] + foot[:, :3, :3] @ np.array([0.0, 0.0, sole_points(float(shin))[0, 2]])
        np.testing.assert_allclose(below[:, 2], scale * ours[:, 2], rtol=0.0, atol=5e-3)
    hips = 0.5 * (read.places(names["thigh left"]) + read.places(names["thigh right"]))
    ours = 0.5 * (exported.places("thigh_left") + exported.places("thigh_right"))
    expected = scale * (ours[:, 2] + sole_points(float(shin))[0, 2]) + ANKLE_M
    np.testing.assert_allclose(hips[:, 2], expected, rtol=0.0, atol=0.03 * build.leg_m)


@pytest.mark.parametrize("build", BUILDS, ids=lambda build: build.family)
def test_the_skin_rests_as_it_was_made_and_moves_with_the_bones(exported: Exported, build: Build) -> None:
    read = follow(exported, build)
    rest = read.skin(moved=False)[0]
    assert rest[:, 1].min() == pytest.approx(0.0, abs=1e-5)
    arms = rest[:, 0].max() - rest[:, 0].min()
    assert arms == pytest.approx(0.3 + 2.0 * 0.55 * np.sin(np.radians(build.arms_deg)), abs=1e-4)
    toes = rest[-2:]
    assert (toes[:, 2] > 0.1).all() and toes[0, 0] > 0.0 > toes[1, 0]  # it faces along z, its left along x
    moved = read.skin(moved=True)
    # The soles under the left ankle and toe; between these bones nothing turns.
    np.testing.assert_allclose(np.ptp(np.linalg.norm(moved[:, -2] - moved[:, -4], axis=1)), 0.0, rtol=0.0, atol=1e-5)
    assert read.file.asset.generator == "bodycam_ros" and read.file.asset.copyright == "CC0"


def test_bones_of_unknown_names_are_named_in_a_table(exported: Exported, capsys: pytest.CaptureFixture[str]) -> None:
    build = Build("nameless")
    character = write_character(build, exported.folder / "nameless.glb")
    command = ["export", str(exported.out), "--to", "glb", "-o", str(exported.folder / "table.glb"), "--force"]
    command += ["--character", str(character)]
    assert main(command) == 1
    told = " ".join(capsys.readouterr().err.split())
    assert "no bone is known to be thigh_left, shin_left" in told and "--bones" in told and "Lb4" in told
    names = bone_names("nameless")
    kinds = {"upper_arm": "arm", "forearm": "forearm", "thigh": "thigh", "shin": "shin", "foot": "foot", "toe": "toe"}
    table = {f"{kind}_{side}": names[f"{part} {side}"] for kind, part in kinds.items() for side in ("left", "right")}
    file = exported.folder / "bones.yaml"
    file.write_text(yaml.safe_dump(table | {"head": names["head"], "hand_left": "Lb3", "hand_right": "Rb3"}))
    assert main([*command, "--bones", str(file)]) == 0
    by_names = follow(exported, Build("mixamo"))
    by_table = ReadGlb(exported.folder / "table.glb")
    mixamo = bone_names("mixamo")
    for bone, name in names.items():
        np.testing.assert_allclose(by_table.places(name), by_names.places(mixamo[bone]), rtol=0.0, atol=1e-5)
    file.write_text("thigh_left: Lb9\n")
    assert main([*command, "--bones", str(file)]) == 1
    assert "thigh_left: the character has no bone 'Lb9'" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("name", "segment"),
    [
        ("mixamorig:LeftUpLeg", "thigh_left"), ("mixamorig1_RightForeArm", "forearm_right"),
        ("LeftToeBase", "toe_left"),
        ("calf_r", "shin_right"), ("upperarm_twist_01_l", None), ("clavicle_l", None), ("ball_l", "toe_left"),
        ("DEF-upper_arm.R", "upper_arm_right"), ("spine.006", "head"), ("foot_ik.L", None), ("lfemur", "thigh_left"),
        ("lhipjoint", None), ("rradius", "forearm_right"), ("Bip001 L Thigh", "thigh_left"), ("Bip01 Head", "head"),
        ("ValveBiped.Bip01_L_Calf", "shin_left"), ("J_Bip_R_LowerLeg", "shin_right"), ("LeftHandThumb1", None),
    ],
)  # fmt: skip
def test_bones_are_known_by_names_of_many_programs(name: str, segment: str | None) -> None:
    assert named_bones([{"name": name}], [0]) == ({} if segment is None else {segment: 0})


def test_the_list_of_a_vrm_of_version_0_is_read() -> None:
    listed = [{"bone": "leftUpperLeg", "node": 4}, {"bone": "head", "node": 2}, {"bone": "leftEye", "node": 7}]
    assert vrm_bones({"extensions": {"VRM": {"humanoid": {"humanBones": listed}}}}) == {"thigh_left": 4, "head": 2}


def test_a_body_of_one_leg_moves_what_it_has(walk: Walk, tmp_path: Path) -> None:
    exported = Exported.of(write_solved(walk, tmp_path / "out"), tmp_path)
    read, names = follow(exported, Build("mixamo")), bone_names("mixamo")
    thigh = read.places(names["shin left"]) - read.places(names["thigh left"])
    assert angle_deg(thigh, exported.places("shin_left") - exported.places("thigh_left")).max() < 10.0
    moved = {read.file.nodes[node].name for node, path in read.keys if path == "rotation"}
    assert names["thigh left"] in moved and names["thigh right"] not in moved


def own_ancestor(content: bytes) -> bytes:
    """The hips hang on themselves in place of the armature."""
    loose = content.replace(b'"Armature", "children": [0]', b'"Armature", "children": [ ]')
    return loose.replace(b'"children": [1, ', b'"children": [0, ')


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda content: b"PK" + content, "is no binary glTF"),
        (lambda content: content[:-200], "ends"),
        (lambda content: content.replace(b'"skins"', b'"skims"'), "has no skin"),
        (lambda content: own_ancestor(content), "its own ancestor"),
        (lambda content: content.replace(b'"rotation": [0.', b'"rotation": [NaN, 0.'), "NaN in place of a number"),
        (lambda content: content.replace(b'"rotation": [0.', b'"rotation": [9e'), "other than 4 numbers"),
        (lambda content: content.replace(b'"asset": {', b'"assets": {'), "part is missing"),
        (lambda content: content.replace(b'"inverseBindMatrices": 3', b'"inverseBindMatrices": 9'), "part is missing"),
    ],
)  # fmt: skip
def test_what_is_no_character_is_named(
    exported: Exported, tmp_path: Path, damage: object, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert callable(damage)
    character = write_character(Build("mixamo"), tmp_path / "hero.glb")
    character.write_bytes(damage(character.read_bytes()))
    output = tmp_path / "out.glb"
    assert main(["export", str(exported.out), "--to", "glb", "-o", str(output), "--character", str(character)]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert told in said and "hero.glb" in said
    assert not output.exists()


def test_the_character_is_never_written_over(exported: Exported, tmp_path: Path) -> None:
    character = write_character(Build("mixamo"), tmp_path / "hero.glb")
    before = character.read_bytes()
    command = ["export", str(exported.out), "--to", "glb", "--force", "--character", str(character)]
    assert main([*command, "-o", str(character)]) == 1
    assert character.read_bytes() == before
    assert main([*command, "-o", str(tmp_path / "a.glb"), "--pose", "T"]) == 1
    assert main(["export", str(exported.out), "--to", "bvh", "-o", str(tmp_path / "a.bvh"), *command[-2:]]) == 1
