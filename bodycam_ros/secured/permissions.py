"""The documents by which DDS decides: what a whole domain demands, and what one process may do there.

Formats: OMG DDS Security 1.1, 9.4.1.2 and 9.4.1.3, as far as ROS 2 uses them; and the policy file of ROS 2's own tools,
which says the same in names of ROS, so that ``ros2 security create_permission`` can go on from it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from datetime import datetime

from bodycam_ros.secured.access import Access

_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
_SCHEMAS = "http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_{}.xsd"
_POLICY_VERSION = "0.2.0"
_TIME = "%Y-%m-%dT%H:%M:%S"

_DEMANDED = {
    "allow_unauthenticated_participants": "false",
    "enable_join_access_control": "true",
    "discovery_protection_kind": "ENCRYPT",
    "liveliness_protection_kind": "ENCRYPT",
    "rtps_protection_kind": "ENCRYPT",
}
_DEMANDED_OF_TOPICS = {
    "topic_expression": "*",
    "enable_discovery_protection": "true",
    "enable_liveliness_protection": "true",
    "enable_read_access_control": "true",
    "enable_write_access_control": "true",
    "metadata_protection_kind": "ENCRYPT",
    "data_protection_kind": "ENCRYPT",
}


def governance(domain: int) -> bytes:
    """What the domain demands of everybody: a key that was signed, permissions, and that all is encrypted."""
    root = _document("governance")
    rule = ET.SubElement(ET.SubElement(root, "domain_access_rules"), "domain_rule")
    _add_domain(rule, domain)
    for name, value in _DEMANDED.items():
        ET.SubElement(rule, name).text = value
    topics = ET.SubElement(ET.SubElement(rule, "topic_access_rules"), "topic_rule")
    for name, value in _DEMANDED_OF_TOPICS.items():
        ET.SubElement(topics, name).text = value
    return _text(root)


def permissions(enclave: str, access: Access, domain: int, begins: datetime, ends: datetime) -> bytes:
    """What the holder of an enclave's key may write and read; all else is denied.

    Args:
        enclave: its name, as the key's certificate has it: "/tracker_head".
        access: with absolute names.
        domain: number of the DDS domain.
        begins, ends: when they hold, UTC.
    """
    root = _document("permissions")
    grant = ET.SubElement(ET.SubElement(root, "permissions"), "grant", name=enclave)
    ET.SubElement(grant, "subject_name").text = f"CN={enclave}"
    validity = ET.SubElement(grant, "validity")
    ET.SubElement(validity, "not_before").text = begins.strftime(_TIME)
    ET.SubElement(validity, "not_after").text = ends.strftime(_TIME)
    rule = ET.SubElement(grant, "allow_rule")
    _add_domain(rule, domain)
    for deed, topics in (("publish", access.written()), ("subscribe", access.read())):
        listed = ET.SubElement(ET.SubElement(rule, deed), "topics")
        for topic in topics:
            ET.SubElement(listed, "topic").text = topic
    ET.SubElement(grant, "default").text = "DENY"
    return _text(root)


def policy(enclaves: Mapping[str, Access]) -> bytes:
    """The same of all enclaves, as a policy file of ROS 2's tools; ``enclaves``: with absolute names."""
    root = ET.Element("policy", version=_POLICY_VERSION)
    listed = ET.SubElement(root, "enclaves")
    for enclave, access in enclaves.items():
        namespace, _, node = enclave.rpartition("/")
        profiles = ET.SubElement(ET.SubElement(listed, "enclave", path=enclave), "profiles")
        profile = ET.SubElement(profiles, "profile", ns=namespace or "/", node=node)
        _allow(profile, "topic", "publish", access.publishes)
        _allow(profile, "topic", "subscribe", access.subscribes)
        _allow(profile, "service", "reply", access.serves)
        _allow(profile, "service", "request", access.calls)
    return _text(root)


def _allow(profile: ET.Element, kind: str, deed: str, names: Iterable[str]) -> None:
    if names:
        listed = ET.SubElement(profile, f"{kind}s", {deed: "ALLOW"})
        for name in sorted(names):
            ET.SubElement(listed, kind).text = name


def _document(schema: str) -> ET.Element:
    ET.register_namespace("xsi", _INSTANCE)
    return ET.Element("dds", {f"{{{_INSTANCE}}}noNamespaceSchemaLocation": _SCHEMAS.format(schema)})


def _add_domain(rule: ET.Element, domain: int) -> None:
    ET.SubElement(ET.SubElement(rule, "domains"), "id").text = str(domain)


def _text(root: ET.Element) -> bytes:
    ET.indent(root)
    text: bytes = ET.tostring(root, "utf-8", xml_declaration=True)
    return text + b"\n"
