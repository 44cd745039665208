"""Known faults of cameras, and what the verdict says of them."""

import numpy as np
import pytest
from helpers.known_motion import BODY, DURATION_S, Alter, KnownMotion, exchanged, moved, segment_poses, turned
from helpers.naming import names, numbers

from bodycam_ros.geometry import Array, exp_se3, rigid
from bodycam_ros.results.verdict import Finding, Level, Verdict

LEFT_LEG = ("waist_front", "thigh_left", "shin_left", "foot_left")


def only(verdict: Verdict, level: Level) -> Finding:
    """The one finding that there must be."""
    assert (verdict.level, len(verdict.findings)) == (level, 1), [finding.text for finding in verdict.findings]
    return verdict.findings[0]


@pytest.mark.parametrize("cameras", [tuple(BODY.mounts), LEFT_LEG, ("waist_front", "head", "shin_left"), ("head",)])
def test_a_good_recording_is_good(cameras: tuple[str, ...]) -> None:
    verdict = KnownMotion(cameras).verdict()
    assert (verdict.level, verdict.findings) == (Level.GOOD, ())


@pytest.mark.parametrize(
    "pairs",
    [
        [("forearm_left", "forearm_right")],
        [("waist_left", "waist_right")],
        [("head", "torso_front")],
        [("shin_left", "foot_left")],
        [("upper_arm_left", "upper_arm_right"), ("forearm_left", "forearm_right")],
    ],
)
def test_exchanged_names_are_named(pairs: list[tuple[str, str]]) -> None:
    verdict = KnownMotion(names=exchanged(*pairs)).verdict()
    assert verdict.level > Level.GOOD
    partners = exchanged(*pairs)
    assert {finding.subject for finding in verdict.findings} == set(partners)
    for finding in verdict.findings:
        assert finding.cause == "names"
        assert [camera for camera in BODY.mounts if names(finding.why, camera)] == [partners[finding.subject]]


def test_exchanged_names_among_four_cameras() -> None:
    verdict = KnownMotion(LEFT_LEG, exchanged(("shin_left", "foot_left"))).verdict()
    assert verdict.level == Level.WRONG
    assert {finding.subject for finding in verdict.findings} == {"shin_left", "foot_left"}
    assert {finding.cause for finding in verdict.findings} == {"names"}


def test_a_camera_that_records_from_where_a_missing_one_should() -> None:
    cameras = tuple(camera for camera in BODY.mounts if camera != "head")
    verdict = KnownMotion(cameras, names={"shin_left": "head"}).verdict()
    head = next(finding for finding in verdict.findings if finding.subject == "head")
    assert head.cause == "place" and names(head.why, "shin_left")


def test_a_camera_that_sits_elsewhere_than_the_body_says() -> None:
    finding = only(KnownMotion(altered={"forearm_left": moved((0.0, 0.15, 0.1))}).verdict(), Level.WRONG)
    assert (finding.subject, finding.cause) == ("forearm_left", "mount")
    assert numbers(finding.why) == [pytest.approx(180.0, abs=5.0)]  # mm


def test_a_slipped_strap_is_named_with_its_time() -> None:
    finding = only(KnownMotion(altered={"shin_left": moved((0.0, 0.08, 0.04), after_s=2.5)}).verdict(), Level.DOUBTFUL)
    assert (finding.subject, finding.cause) == ("shin_left", "strap")
    slipped_s, moved_mm = numbers(finding.why)
    assert slipped_s == pytest.approx(2.5, abs=0.1) and moved_mm == pytest.approx(89.4, abs=5.0)
    _, first_s, last_s = numbers(finding.what)
    assert (first_s, last_s) == (pytest.approx(2.5, abs=0.1), pytest.approx(DURATION_S, abs=0.2))


def test_a_slipped_camera_that_the_body_follows_is_named_and_not_its_neighbour() -> None:
    """The shin is solved with its camera's turn, which displaces the foot: the foot's camera is farther off."""
    mount, shin, foot = BODY.mounts["shin_left"], BODY.segment_index["shin_left"], BODY.segment_index["foot_left"]
    slip = turned(15.0, after_s=2.0)

    def follow(time: float, poses: Array) -> Array:
        camera = poses[shin] @ mount.segment_T_camera
        turn = (slip(time, camera) @ np.linalg.inv(camera))[:3, :3]
        followed = poses.copy()
        followed[shin, :3, :3] = turn @ poses[shin, :3, :3]
        followed[foot, :3, 3] = poses[shin, :3, 3] + turn @ (poses[foot, :3, 3] - poses[shin, :3, 3])
        return followed

    finding = only(KnownMotion(altered={"shin_left": slip}, solved=follow).verdict(), Level.DOUBTFUL)
    assert (finding.subject, finding.cause) == ("shin_left", "strap")
    assert numbers(finding.why)[0] == pytest.approx(2.0, abs=0.1)
    slipped_foot = only(KnownMotion(altered={"foot_left": turned(25.0, after_s=2.0)}).verdict(), Level.WRONG)
    assert slipped_foot.subject == "foot_left"


@pytest.mark.parametrize("degrees", [180, 90, -90])
@pytest.mark.parametrize("camera", ["forearm_left", "thigh_right"])
def test_images_that_are_turned_are_named_as_such(camera: str, degrees: int) -> None:
    finding = only(KnownMotion(altered={camera: turned(float(degrees))}).verdict(), Level.WRONG)
    assert (finding.subject, finding.cause) == (camera, "turned")
    assert numbers(finding.why) == [abs(degrees)]


@pytest.mark.parametrize("error_s", [0.02, -0.02])
@pytest.mark.parametrize("camera", ["foot_left", "forearm_right"])
def test_a_clock_that_is_off_by_some_milliseconds(camera: str, error_s: float) -> None:
    finding = only(KnownMotion(clocks_s={camera: error_s}).verdict(), Level.DOUBTFUL)
    assert (finding.subject, finding.cause) == (camera, "clock")
    assert numbers(finding.why) == [pytest.approx(1e3 * error_s, abs=5.0)]  # ms


def test_a_clock_that_is_far_off() -> None:
    finding = only(KnownMotion(clocks_s={"head": 3600.0}).verdict(), Level.WRONG)
    assert (finding.subject, finding.check, finding.cause) == ("head", "clock", "clock")
    assert numbers(finding.why) == [3600.0] and names(finding.why, "after")


def test_wrong_registrations_all_over_the_place() -> None:
    random = np.random.default_rng(5)

    def jump(time: float, pose: Array) -> Array:
        return pose @ exp_se3(random.normal(size=6) * 0.4)

    finding = only(KnownMotion(altered={"shin_left": jump}).verdict(), Level.WRONG)
    assert (finding.subject, finding.cause) == ("shin_left", "images")


def test_a_camera_that_the_solver_left_out_makes_a_result_doubtful_and_one_that_it_followed_wrong() -> None:
    fault = {"waist_right": moved((0.4, 0.0, 0.0))}
    finding = only(KnownMotion(altered=fault).verdict(), Level.DOUBTFUL)
    assert finding.subject == "waist_right"
    pulled = KnownMotion(altered=fault, solved=lambda _, poses: rigid(np.eye(3), np.array([0.2, 0.0, 0.0])) @ poses)
    assert only(pulled.verdict(), Level.WRONG).subject == "waist_right"


def test_a_solver_that_went_astray_is_wrong_though_all_cameras_agree() -> None:
    astray = KnownMotion(
        LEFT_LEG, solved=lambda _, poses: rigid(np.eye(3), np.array([0.0, 0.3, 0.0])) @ poses
    ).verdict()
    assert astray.level == Level.WRONG
    assert {finding.subject for finding in astray.findings} == set(LEFT_LEG)


def test_a_camera_that_is_never_registered() -> None:
    finding = only(KnownMotion(altered={"head": lambda time, pose: None}).verdict(), Level.DOUBTFUL)
    assert (finding.subject, finding.check, numbers(finding.what)) == ("head", "registered", [0, 120])


def test_no_camera_is_registered() -> None:
    nothing = dict.fromkeys(LEFT_LEG, lambda time, pose: pose if time == 0.0 else None)
    verdict = KnownMotion(LEFT_LEG, altered=nothing).verdict()
    assert verdict.level == Level.WRONG
    assert {(finding.check, finding.cause) for finding in verdict.findings} == {("registered", "map")}
    assert {finding.subject for finding in verdict.findings} == set(LEFT_LEG)


def test_a_camera_that_ends_early() -> None:
    finding = only(
        KnownMotion(altered={"head": lambda time, pose: pose if time < 2.0 else None}).verdict(), Level.DOUBTFUL
    )
    assert (finding.subject, finding.check) == ("head", "end")
    assert numbers(finding.what) == [pytest.approx(2.0, abs=0.05), pytest.approx(DURATION_S, abs=0.05)]


def test_a_camera_that_is_blind_for_long_leaves_its_segment_to_guesswork() -> None:
    def blind(time: float, pose: Array) -> Array | None:
        return None if 1.0 <= time < 2.5 else pose

    finding = only(KnownMotion(altered={"head": blind}).verdict(), Level.DOUBTFUL)
    assert (finding.subject, finding.check, numbers(finding.what)) == ("head", "blind", [1.0, 2.5])
    assert names(finding.remedy, "head")  # its segment
    assert KnownMotion(altered={"waist_left": blind}).verdict().level == Level.GOOD, "its neighbours see the pelvis"
    briefly = KnownMotion(altered={"head": lambda time, pose: None if 1.0 <= time < 1.7 else pose})
    assert briefly.verdict().level == Level.GOOD


@pytest.mark.parametrize("scale", [10.0, 0.5, 1.3])
def test_a_map_of_another_scale(scale: float) -> None:
    def scaled(time: float, pose: Array) -> Array:
        return rigid(pose[:3, :3], scale * pose[:3, 3])

    verdict = KnownMotion(altered=dict.fromkeys(BODY.mounts, scaled)).verdict()
    assert verdict.level == Level.WRONG
    assert {finding.subject for finding in verdict.findings} == set(BODY.mounts)
    assert {finding.cause for finding in verdict.findings} == {"scale"}
    for finding in verdict.findings:
        assert numbers(finding.why) == [pytest.approx(scale, rel=0.01)]


def test_the_body_of_another_day_is_one_finding() -> None:
    random = np.random.default_rng(5)
    shifts = {camera: random.normal(size=3) for camera in BODY.mounts}
    anew = {camera: moved(tuple(0.03 * shift / np.linalg.norm(shift))) for camera, shift in shifts.items()}
    finding = only(KnownMotion(altered=anew).verdict(), Level.WRONG)
    assert finding.what.startswith(f"this is not the body of this recording: {len(anew)} of {len(anew)} cameras")
    assert "range of motion" in finding.remedy


def test_the_body_of_a_taller_person_is_one_finding() -> None:
    """Cameras sit where the recorded person's smaller body has them; those of the trunk are the least off."""

    def smaller(camera: str) -> Alter:
        segment = BODY.segment_index[BODY.mounts[camera].segment]

        def alter(time: float, pose: Array) -> Array:
            pelvis, own = segment_poses(time)[0], segment_poses(time)[segment]
            shrunk = pelvis[:3, 3] + (own[:3, 3] - pelvis[:3, 3]) / 1.12 + (pose[:3, 3] - own[:3, 3]) / 1.12
            return rigid(pose[:3, :3], shrunk)

        return alter

    finding = only(KnownMotion(altered={camera: smaller(camera) for camera in BODY.mounts}).verdict(), Level.WRONG)
    assert finding.what.startswith("this is not the body of this recording")


def test_two_wrong_mounts_are_not_another_body() -> None:
    altered = {"forearm_left": moved((0.0, 0.1, 0.1)), "head": moved((0.1, 0.0, 0.1))}
    verdict = KnownMotion(altered=altered).verdict()
    assert {finding.subject for finding in verdict.findings} == {"forearm_left", "head"}


def test_a_short_spell_of_wrong_registrations_is_no_finding() -> None:
    """The solver bridges it; half of the shortest stay is the limit."""

    def spell(time: float, pose: Array) -> Array:
        return pose @ rigid(np.eye(3), np.array([0.5, 0.0, 0.0])) if 2.0 <= time < 2.35 else pose

    assert KnownMotion(altered={"shin_left": spell}).verdict().level == Level.GOOD
