"""What each process of the graph may say and hear: its own, and no more."""

from pathlib import Path

import pytest
from secured.conftest import Keys, small_graph

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.access_table import access_of_graph
from bodycam_ros.secured.enclaves import enclaves_of


def test_names_are_resolved_as_ros_does() -> None:
    access = Access(frozenset({"/tf", "head/tracks", "~/left"}), serves=frozenset({"~/flush"}))
    assert access.resolved("/", "solver").publishes == {"/tf", "/head/tracks", "/solver/left"}
    assert access.resolved("/alice/", "solver").publishes == {"/tf", "/alice/head/tracks", "/alice/solver/left"}
    assert access.resolved("alice", "solver").serves == {"/alice/solver/flush"}


def test_services_are_two_topics_of_dds() -> None:
    one = Access(frozenset({"/a"}), frozenset({"/b"}), frozenset({"/n/serve"}), frozenset({"/m/ask"}))
    assert one.written() == ["ros_discovery_info", "rq/m/askRequest", "rr/n/serveReply", "rt/a"]
    assert one.read() == ["ros_discovery_info", "rq/n/serveRequest", "rr/m/askReply", "rt/b"]


def test_a_tracker_speaks_of_its_own_camera(keys: Keys) -> None:
    left = keys.enclaves["/tracker_left"]
    assert "/left/tracks" in left.publishes
    assert not [name for name in left.publishes | left.subscribes | left.serves if "right" in name]


def test_nodes_have_no_wildcards_and_ask_nobody(keys: Keys) -> None:
    for enclave, access in keys.enclaves.items():
        names = access.publishes | access.subscribes | access.serves | access.calls
        if enclave not in ("/observer", "/operator"):
            assert not [name for name in names if "*" in name], enclave
            assert not access.calls, enclave


def test_only_cameras_and_the_player_publish_images(keys: Keys) -> None:
    speaking = {e for e, access in keys.enclaves.items() if any("image_raw" in name for name in access.publishes)}
    assert speaking == {"/driver_left", "/driver_right", "/player", "/graph"}


def test_the_table_knows_every_way_to_send_images(keys: Keys) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.camera_topics import TRANSPORTS
    from bodycam_ros.nodes.played_topics import IMAGES, INFO, TIMING

    ways = {f"/left/{topic}" for topic, _ in TRANSPORTS.values()}
    assert ways == {f"/left{topic}" for topic in IMAGES}
    assert ways <= keys.enclaves["/tracker_left"].subscribes
    assert ways | {f"/left{INFO}", f"/left{TIMING}"} <= keys.enclaves["/player"].publishes


def test_only_who_solves_moves_the_body(keys: Keys) -> None:
    assert {e for e, a in keys.enclaves.items() if "/joint_states" in a.publishes} == {"/skeleton_solver", "/graph"}


def test_who_looks_on_says_nothing_of_the_graphs(keys: Keys) -> None:
    observer, operator = keys.enclaves["/observer"], keys.enclaves["/operator"]
    assert observer.publishes == operator.publishes == {"/rosout", "/parameter_events"}
    assert "/joint_states" in observer.subscribes and "/left/image_raw/compressed" in observer.subscribes
    assert not observer.calls
    assert {"/skeleton_solver/flush", "/registration_1/save_map"} <= operator.calls


def test_the_whole_graph_in_one_process_may_what_its_nodes_may(keys: Keys) -> None:
    for name in ("/tracker_left", "/registration_2", "/skeleton_solver", "/player"):
        assert keys.enclaves["/graph"] | keys.enclaves[name] == keys.enclaves["/graph"]


def test_two_people_do_not_hear_each_other(tmp_path: Path) -> None:
    alice, bob = (enclaves_of(small_graph(tmp_path), name) for name in ("alice", "/bob"))
    assert "/alice/tracker_left" in alice and "/bob/tracker_left" in bob
    assert "/alice/left/tracks" in alice["/alice/registration_1"].subscribes
    assert not any(name.startswith("/bob") for access in alice.values() for name in access.publishes)


def test_a_node_that_the_table_does_not_know() -> None:
    with pytest.raises(KeyError, match="juggler"):
        access_of_graph([NodeProcess("juggler", "juggler")])
