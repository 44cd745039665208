"""A process of several nodes does not hear itself through the middleware, whatever profiles are in use."""

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")

from bodycam_ros.nodes.own_profile import deaf_to_itself, is_deaf_to_itself

VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
SHARED_MEMORY = Path(__file__).parents[2] / "config/fastdds-shm.xml"
PROPERTY = "rtps/propertiesPolicy/properties/property"
SCHEMA = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"


def _in_use() -> ElementTree.Element:
    """What Fast DDS would read now, without the namespace, which must be the default one: it knows no prefixes."""
    text = Path(os.environ[VARIABLE]).read_text()
    assert "ns0:" not in text
    root = ElementTree.fromstring(text)
    for each in root.iter():
        assert each.tag.startswith(SCHEMA)
        each.tag = each.tag.removeprefix(SCHEMA)
    return root


def _properties(participant: ElementTree.Element) -> dict[str, str]:
    return {each.findtext("name", ""): each.findtext("value", "") for each in participant.findall(PROPERTY)}


def test_without_a_file_there_is_one_for_the_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with deaf_to_itself():
        (participant,) = _in_use().findall("participant")
        path = Path(os.environ[VARIABLE])
    assert participant.get("is_default_profile") == "true"
    assert _properties(participant) == {"fastdds.ignore_local_endpoints": "true"}
    assert VARIABLE not in os.environ and not path.exists()


def test_the_profiles_in_use_stay_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(SHARED_MEMORY))
    with deaf_to_itself():
        root = _in_use()
    (participant,) = root.findall("participant")
    assert participant.get("profile_name") == "bodycam"
    assert _properties(participant) == {"fastdds.ignore_local_endpoints": "true"}
    assert [each.text for each in participant.iter("transport_id")] == ["shared_memory", "network"]
    assert root.findtext("transport_descriptors/transport_descriptor/segment_size") == "16777216"
    assert os.environ[VARIABLE] == str(SHARED_MEMORY)


def test_properties_that_are_there_already_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "own.xml"
    file.write_text(
        '<dds><profiles><participant profile_name="other"/><participant profile_name="a" is_default_profile="true">'
        "<rtps><propertiesPolicy><properties><property><name>x</name><value>y</value></property></properties>"
        "</propertiesPolicy></rtps></participant></profiles></dds>"
    )
    monkeypatch.setenv(VARIABLE, str(file))
    with deaf_to_itself():
        other, default = _in_use().findall("profiles/participant")
    assert not _properties(other)
    assert _properties(default) == {"x": "y", "fastdds.ignore_local_endpoints": "true"}


@pytest.mark.parametrize("text", [None, "no profiles"])
def test_a_file_that_cannot_be_read_is_left_to_fast_dds(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str | None
) -> None:
    file = tmp_path / "own.xml"
    if text is not None:
        file.write_text(text)
    monkeypatch.setenv(VARIABLE, str(file))
    with deaf_to_itself():
        assert os.environ[VARIABLE] == str(file)


def test_a_process_that_hears_itself_is_noticed(graph: Any) -> None:
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("talks_to_itself", context=context)
    assert not is_deaf_to_itself(node)
    node.destroy_node()
    rclpy.shutdown(context=context)
