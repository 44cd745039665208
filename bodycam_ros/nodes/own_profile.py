"""A process that does not hear itself through the middleware, because its nodes hear each other directly.

Otherwise a message that both a node in here and one outside reads would reach the first twice. Fast DDS can leave out
the endpoints of the own participant; rclpy cannot ask it to, but Fast DDS reads a file of profiles.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from rclpy.node import Node
from std_msgs.msg import Empty

_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_SCHEMA = "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"
_PROPERTY = "fastdds.ignore_local_endpoints"
_PROBE = "~/is_heard_within"


@contextmanager
def deaf_to_itself() -> Iterator[None]:
    """The profiles that are in use anyway, and this property, for the participant that is made in the meantime.

    Where the file in use cannot be read it stays in use, and Fast DDS says what it thinks of it.
    """
    before = os.environ.get(_VARIABLE)
    try:
        profiles = ElementTree.parse(before).getroot() if before else Element("profiles")
    except (OSError, ElementTree.ParseError):
        yield
        return
    _add_property(profiles)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "profiles.xml"
        ElementTree.ElementTree(profiles).write(path, encoding="UTF-8", xml_declaration=True)
        os.environ[_VARIABLE] = str(path)
        try:
            yield
        finally:
            os.environ.pop(_VARIABLE) if before is None else os.environ.update({_VARIABLE: before})


def is_deaf_to_itself(node: Node) -> bool:
    """Whether what a node publishes does not reach its own process through the middleware."""
    publisher = node.create_publisher(Empty, _PROBE, 1)
    subscription = node.create_subscription(Empty, _PROBE, lambda message: None, 1)
    # Those of one participant find each other as soon as the second is there.
    is_deaf = publisher.get_subscription_count() == 0
    node.destroy_subscription(subscription)
    node.destroy_publisher(publisher)
    return is_deaf


def _add_property(root: Element) -> None:
    # Fast DDS knows names without prefixes alone.
    for each in root.iter():
        each.tag = each.tag.rpartition("}")[2]
    root.set("xmlns", _SCHEMA)
    profiles = _child(root, "profiles") if root.tag == "dds" else root
    participants = profiles.findall("participant")
    default = next((each for each in participants if each.get("is_default_profile") == "true"), None)
    if default is None:
        default = SubElement(profiles, "participant", {"profile_name": "bodycam_graph", "is_default_profile": "true"})
    of_ours = SubElement(_child(_child(_child(default, "rtps"), "propertiesPolicy"), "properties"), "property")
    SubElement(of_ours, "name").text = _PROPERTY
    SubElement(of_ours, "value").text = "true"


def _child(parent: Element, name: str) -> Element:
    found = parent.find(name)
    return SubElement(parent, name) if found is None else found
