"""The policy for `ros2 security` has the structure of sros2's policy.xsd, and a profile for every node."""

from pathlib import Path
from xml.etree import ElementTree

from bodycam_ros.graph.node_parameters import OF_NODES

POLICY = ElementTree.parse(Path(__file__).parents[2] / "config/security_policy.xml").getroot()
RULES = {"topics": {"publish", "subscribe"}, "services": {"reply", "request"}, "actions": {"call", "execute"}}


def test_the_structure_is_that_of_a_policy() -> None:
    assert (POLICY.tag, POLICY.attrib) == ("policy", {"version": "0.2.0"})
    assert [child.tag for child in POLICY] == ["enclaves"]
    for enclave in POLICY[0]:
        assert enclave.tag == "enclave" and set(enclave.attrib) == {"path"}
        assert [child.tag for child in enclave] == ["profiles"]
        for profile in enclave[0]:
            assert profile.tag == "profile" and set(profile.attrib) == {"ns", "node"}
            for rule in profile:
                assert len(rule.attrib) == 1 and set(rule.attrib) <= RULES[rule.tag]
                assert set(rule.attrib.values()) == {"ALLOW"}
                assert {name.tag for name in rule} == {rule.tag.removesuffix("s")} and all(name.text for name in rule)


def test_every_node_has_a_profile() -> None:
    profiles = POLICY.findall("enclaves/enclave[@path='/bodycam']/profiles/profile")
    assert {profile.attrib["node"].rstrip("_*") for profile in profiles} == set(OF_NODES)
