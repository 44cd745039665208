"""Exported characters in three.js in a real browser: bones, weights, times, and where the skin is, as we have it.

three.js and its loader of glTF are those in trimesh's wheel: nothing is fetched.
"""

import base64
import io
import zipfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from helpers.exported_files import JOINT_M, Exported
from helpers.read_glb import ReadGlb
from helpers.rigged_character import Build, write_character
from helpers.view_in_browser import FLAGS
from PIL import Image

from bodycam_ros.body.skin import skinned_body
from bodycam_ros.formats.figure import rest_pose
from bodycam_ros.formats.sampled_motion import UP_AXES
from bodycam_ros.results.solved_body import read_solved_body

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.long

SIZE = (480, 640)
EVERY = 50
"""Only the places of every so-manieth vertex are read."""

READ = """
async ([content, every, seconds]) => {
    const bytes = Uint8Array.from(atob(content), letter => letter.charCodeAt(0));
    const gltf = await new Promise((done, failed) => new THREE.GLTFLoader().parse(bytes.buffer, "", done, failed));
    const scene = new THREE.Scene(), mixer = new THREE.AnimationMixer(gltf.scene), clip = gltf.animations[0];
    scene.add(gltf.scene);
    mixer.clipAction(clip).play();
    let mesh = null;
    gltf.scene.traverse(each => { mesh = each.isSkinnedMesh ? each : mesh; });
    const pose = at => { mixer.setTime(at); scene.updateMatrixWorld(true); };
    mesh.frustumCulled = false;  // this three.js takes the place of the rest pose
    const vertices = [], bones = [];
    const names = mesh.skeleton.bones.map(bone => bone.userData.name);  // its own names lack dots and colons
    for (const at of seconds) {
        pose(at);
        const places = [];
        for (let row = 0; row < mesh.geometry.attributes.position.count; row += every) {
            const place = new THREE.Vector3().fromBufferAttribute(mesh.geometry.attributes.position, row);
            places.push(mesh.localToWorld(mesh.boneTransform(row, place)).toArray());
        }
        vertices.push(places);
        bones.push(mesh.skeleton.bones.map(bone => bone.getWorldPosition(new THREE.Vector3()).toArray()));
    }
    const weights = mesh.geometry.attributes.skinWeight;
    const sums = Array.from({length: weights.count}, (_, row) =>
        weights.getX(row) + weights.getY(row) + weights.getZ(row) + weights.getW(row));
    pose(seconds[seconds.length >> 1]);
    const renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
    renderer.setSize(innerWidth, innerHeight);
    document.body.appendChild(renderer.domElement);
    scene.background = new THREE.Color(0xffffff);
    scene.add(new THREE.HemisphereLight(0xffffff, 0x444444, 1.2));
    const at = mesh.skeleton.bones[0].getWorldPosition(new THREE.Vector3());
    const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 50);
    camera.position.set(at.x + 2.2, at.y + 0.4, at.z + 2.2);
    camera.lookAt(at);
    renderer.render(scene, camera);
    const times = Array.from(clip.tracks[0].times);
    return {names, vertices, bones, times, weights: [Math.min(...sums), Math.max(...sums)]};
}
"""


@pytest.fixture(scope="module")
def exported(sample_out: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return Exported.of(sample_out, tmp_path_factory.mktemp("three"))


@pytest.fixture(scope="module")
def page(chromium: str) -> "Iterator[Page]":
    from playwright.sync_api import sync_playwright  # absent on machines without a browser: fixture ``chromium``

    archive = files("trimesh").joinpath("resources/templates/viewer.zip").read_bytes()
    with zipfile.ZipFile(io.BytesIO(archive)) as inside:
        template = inside.read(inside.namelist()[0]).decode()
    libraries = template[template.index("<script>") : template.index("var camera,controls,scene")] + "</script>"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.set_default_timeout(180e3)
        page.set_content(f"<!DOCTYPE html><html><head>{libraries}</head><body style='margin: 0'></body></html>")
        yield page
        browser.close()


def read(page: "Page", file: Path, seconds: list[float], picture: Path | None = None, every: int = EVERY) -> Any:
    said = page.evaluate(READ, [base64.b64encode(file.read_bytes()).decode(), every, seconds])
    shown = page.screenshot()
    page.evaluate("document.querySelector('canvas').remove()")
    if picture is not None:
        picture.write_bytes(shown)
    pixels = np.asarray(Image.open(io.BytesIO(shown)).convert("RGB"))
    assert 0.005 < (pixels.min(axis=2) < 240).mean() < 0.5  # somebody is to be seen
    return said


def test_three_js_has_the_skin_where_we_have_it(page: "Page", exported: Exported) -> None:
    solved, frames = read_solved_body(exported.out), [0, 20, 40, 59]
    seconds = exported.seconds
    file = exported.file("glb", "--pose", "T")
    said = read(page, file, seconds[frames].tolist(), file.with_suffix(".png"))
    np.testing.assert_allclose(said["times"], seconds, rtol=0.0, atol=1e-6)
    assert len(said["names"]) == len(solved.body.segments) + len(solved.body.tree_joints)
    assert said["weights"] == pytest.approx([1.0, 1.0], abs=1e-5)
    skin = skinned_body(solved.body).rebound(rest_pose(solved.body, "T"))
    for row, frame in enumerate(frames):
        ours = skin.posed(solved.world_T_segment[frame])[::EVERY] @ UP_AXES["y"].T
        np.testing.assert_allclose(said["vertices"][row], ours, rtol=0.0, atol=JOINT_M)
        for segment in solved.body.segments:
            place = said["bones"][row][said["names"].index(segment)]
            ours_at = UP_AXES["y"] @ exported.places(segment)[frame]
            np.testing.assert_allclose(place, ours_at, rtol=0.0, atol=JOINT_M)


@pytest.mark.parametrize(
    "build", [Build("mixamo", unit_m=0.01, posed=True), Build("blender", arms_deg=45.0, z_up=True)]
)
def test_three_js_moves_a_character_as_we_do(page: "Page", exported: Exported, build: Build) -> None:
    character = write_character(build, exported.folder / f"{build.family}.hero.glb")
    file = exported.file("glb", "--character", str(character), name=build.family)
    frames = [0, 30, 59]
    said = read(page, file, exported.seconds[frames].tolist(), every=1)
    ours = ReadGlb(file)
    np.testing.assert_allclose(said["times"], exported.seconds, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(said["vertices"], ours.skin(moved=True)[frames], rtol=0.0, atol=JOINT_M)
    for name in said["names"]:
        places = [bones[said["names"].index(name)] for bones in said["bones"]]
        np.testing.assert_allclose(places, ours.world(ours.rows[name])[frames, :3, 3], rtol=0.0, atol=JOINT_M)
