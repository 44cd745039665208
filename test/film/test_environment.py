"""Rides in places that were not there: what touches what."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from helpers.athletes import AIRBORNE_S, Athlete, cyclist, lifter, snowboarder

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.environment.environment import Environment
from bodycam_ros.environment.machines import WHEEL_M, machine_parts
from bodycam_ros.environment.placement import Route, rolled
from bodycam_ros.errors import ViewError
from bodycam_ros.film.frames import EvenFrames
from bodycam_ros.film.ground import ground_colours
from bodycam_ros.film.shots import OutsideShots
from bodycam_ros.film.write_film import FilmedMotion
from bodycam_ros.geometry import transform_points

TOUCHES_M = 5e-3
SPEED = 6.0


def filmed(athlete: Athlete) -> tuple[Any, FilmedMotion]:
    """The athlete as solved without error, and at each of the states filmed."""
    solved: Any = SimpleNamespace(
        body=coupled_body(athlete.body, athlete.equipment),
        stamps_ns=np.round(athlete.times * 1e9).astype(np.int64),
        world_T_segment=np.concatenate([athlete.poses, athlete.equipment_poses], axis=1),
        placed=np.ones(len(athlete.times), bool),
        equipment=None,
    )
    return solved, FilmedMotion(solved, EvenFrames(solved, 30.0))


def test_feet_stay_on_pedals_and_wheels_on_the_road_while_it_rolls() -> None:
    athlete = cyclist(1.0)
    solved, motion = filmed(athlete)
    place = motion.move_into(Environment.parse("road", SPEED))
    assert place.ground_m is not None
    index = solved.body.segment_index
    parts = machine_parts(solved.body, {})
    pedals = {part.segment: part for part in parts if part.segment.startswith("pedal")}
    wheels = [part for part in parts if part.hub is not None]
    for row, seconds in enumerate(motion.seconds.tolist()):
        poses = motion.world_T_segment[row]
        for side in ("left", "right"):
            (contact,) = (each for each in athlete.equipment.attachments if each.name == f"on_pedal_{side}")
            sole = transform_points(poses[index[f"foot_{side}"]], contact.on_body)
            pedal = poses[index[f"pedal_{side}"]]
            top = pedals[f"pedal_{side}"].placed(pedal, 0.0) @ pedal[:3, 2]
            assert np.abs(sole @ pedal[:3, 2] - top.max()).max() < TOUCHES_M
        travelled = (
            motion.world_T_segment[row, index["frame"], :3, 3] - motion.world_T_segment[0, index["frame"], :3, 3]
        )
        np.testing.assert_allclose(travelled @ motion.heading, SPEED * seconds, atol=1e-6)
        for wheel in wheels:
            vertices = wheel.placed(poses[index["frame"]], SPEED * seconds)
            assert vertices[:, 2].min() > place.ground_m - TOUCHES_M
        assert abs(motion.boxes[row, 0, 2] - place.ground_m) < TOUCHES_M
    # What touches the road does not slip on it: the rim goes back as fast as the frame goes forward.
    frame, step_m = motion.world_T_segment[0, index["frame"]], 1e-4
    tyre = wheels[0]
    before, after = tyre.placed(frame, 0.0), tyre.placed(frame, step_m)
    lowest = before[:, 2].argmin()
    slip = (after - before)[lowest] @ frame[:3, 0] + step_m
    assert abs(slip) < 0.01 * step_m
    assert np.ptp(before[:, 2]) == pytest.approx(2.0 * WHEEL_M, abs=1e-3)


def test_a_board_is_on_the_slope_but_for_its_jump_and_boots_stay_in_bindings() -> None:
    athlete = snowboarder()
    solved, motion = filmed(athlete)
    place = motion.move_into(Environment.parse("slope:30", 4.0))
    assert place.ground_m is not None
    (board,) = (part for part in machine_parts(solved.body, {}) if part.segment == "board")
    index = solved.body.segment_index
    lowest = np.array([board.placed(poses[index["board"]], 0.0)[:, 2].min() for poses in motion.world_T_segment])
    above = lowest - place.ground_m
    flying = (motion.seconds > AIRBORNE_S[0]) & (motion.seconds < AIRBORNE_S[1])
    assert np.abs(above[~flying]).max() < TOUCHES_M
    assert above[flying].max() == pytest.approx(0.196, abs=0.03), "it jumps for 0.4 s"
    for each in athlete.equipment.attachments:
        boot, held = (motion.world_T_segment[:, index[name]] for name in (each.body_segment, each.equipment_segment))
        for one, other in zip(boot, held, strict=True):
            assert each.distances(one, other).max() < TOUCHES_M


def test_a_slope_goes_down_where_the_motion_goes() -> None:
    heading = np.array([0.6, 0.8, 0.0])
    slope = Environment.parse("slope:30", 0.0)
    up = slope.up(heading)
    assert np.linalg.norm(up) == pytest.approx(1.0)
    assert heading @ up == pytest.approx(-0.5), "one metre ahead is half a metre down"
    assert Environment.parse("road", 0.0).up(heading).tolist() == [0.0, 0.0, 1.0]
    boxes = np.tile(np.array([[-0.3, -0.3, 0.0], [0.3, 0.3, 1.7]]), (5, 1, 1))
    shots = OutsideShots("follow", np.linspace(0.0, 1.0, 5), heading, boxes, (320, 180), up)
    right = shots.pose(0)[:3, 0]
    assert right @ up == pytest.approx(0.0, abs=1e-12), "the picture is upright against gravity"


def test_lines_of_the_road_lie_along_it() -> None:
    road = Environment.parse("road", 0.0)
    along, across = np.meshgrid(np.arange(-5.0, 5.0, 0.01), np.arange(-5.0, 7.0, 0.01), indexing="ij")
    heading = np.array([0.0, 1.0, 0.0])
    route = Route(road, np.zeros(3), heading)
    colours = ground_colours(route, (-across).astype(np.float32), along.astype(np.float32))
    bright = (colours.min(axis=2) > 200.0).mean(axis=0)
    edges = across[0][bright > 0.95]
    assert set(np.round(edges, 1)) <= {-1.7, -1.6, -1.5, 4.3, 4.4, 4.5}
    dashed = bright[np.abs(across[0] - 1.4).argmin()]
    assert 0.3 < dashed < 0.7


@pytest.mark.parametrize("text", ["beach", "slope", "slope:-3", "slope:80", "slope:x"])
def test_other_places_are_refused(text: str) -> None:
    with pytest.raises(ViewError, match=r"road, or slope:30"):
        Environment.parse(text, 1.0)


def test_the_plates_of_a_barbell_are_outside_of_the_hands() -> None:
    athlete = lifter(0.1)
    parts = machine_parts(coupled_body(athlete.body, athlete.equipment), {})
    assert {part.segment for part in parts} == {"bar"}
    vertices = np.concatenate([part.vertices for part in parts])
    np.testing.assert_allclose(vertices.mean(axis=0), 0.0, atol=1e-9)
    plates = vertices[np.hypot(vertices[:, 0], vertices[:, 2]) > 0.2]
    hands = [abs(each.on_equipment[0, 1]) for each in athlete.equipment.attachments]
    assert np.abs(plates[:, 1]).min() > max(hands) + 0.1
    assert set(np.sign(plates[:, 1])) == {-1.0, 1.0}


def test_a_board_is_a_closed_mesh_whose_ends_rise_and_whose_sole_is_flat_under_the_feet() -> None:
    athlete = snowboarder(0.1)
    (board,) = (part for part in machine_parts(coupled_body(athlete.body, athlete.equipment), {}))
    mesh = trimesh.Trimesh(board.vertices, board.triangles, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0
    x, _, z = board.vertices.T
    assert np.ptp(z[np.abs(x) < 0.5]) < 0.02 and z[np.abs(x) > 0.75].min() > 0.05
    assert mesh.bounds[1, 1] == pytest.approx(-mesh.bounds[0, 1])


def test_a_bicycle_that_rides_itself_has_wheels_that_turn_by_its_way() -> None:
    athlete = cyclist(1.0)
    body = coupled_body(athlete.body, athlete.equipment)
    poses = np.concatenate([athlete.poses, athlete.equipment_poses], axis=1)
    travelled = SPEED * athlete.times
    np.testing.assert_array_equal(rolled(body, poses, travelled), travelled, "on a roller")
    ahead = poses[0, body.segment_index["frame"], :3, 0]
    poses[..., :3, 3] += (3.0 * athlete.times)[:, None, None] * ahead
    np.testing.assert_allclose(rolled(body, poses, travelled), travelled + 3.0 * athlete.times, atol=1e-9)
