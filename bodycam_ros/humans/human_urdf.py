"""A human as URDF, as REP-155 wants it: every link and joint ends in the body's id, and lengths are the person's."""

import re
import xml.etree.ElementTree as ET

import numpy as np

from bodycam_ros.body.urdf import WITHIN_A_TURN, xml_numbers
from bodycam_ros.errors import SettingsError
from bodycam_ros.geometry import Array
from bodycam_ros.humans.kinematic_model import BODY
from bodycam_ros.humans.projection import HumanSkeleton

_ID = re.compile(r"[A-Za-z][A-Za-z0-9]*", re.ASCII)
"""In ROS 2 a part of a topic's name begins with a letter; the REP, which is older, has ids that begin with a digit."""

_NO_LIMIT = "1000"  # of effort [N m] and velocity [rad/s], which URDF wants


def human_urdf(skeleton: HumanSkeleton, body_id: str) -> str:
    """A URDF document whose moving joints are ``skeleton.joint_names``, each with ``_<id>`` after it.

    Raises:
        SettingsError: the id cannot be a part of names of topics and frames.
    """
    check_id(body_id)
    robot = ET.Element("robot", name=f"human_{body_id}")
    ET.SubElement(robot, "link", name=f"{BODY}_{body_id}")
    for chain in skeleton.chains:
        base = chain.base
        for joint, axis, link in zip(chain.joints, chain.axes, chain.links, strict=True):
            element = _joint(robot, joint, "revolute", base, link, skeleton.origins[joint], body_id)
            ET.SubElement(element, "axis", xyz=xml_numbers(np.array(axis)))
            low, high = (xml_numbers(np.array([limit])) for limit in WITHIN_A_TURN)
            ET.SubElement(element, "limit", lower=low, upper=high, effort=_NO_LIMIT, velocity=_NO_LIMIT)
            base = link
        if chain.end is not None:
            _joint(robot, chain.end, "fixed", base, chain.end, skeleton.origins[chain.end], body_id)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def check_id(body_id: str) -> None:
    """Refuse what cannot be a part of names of topics and frames; raises SettingsError."""
    if not _ID.fullmatch(body_id):
        raise SettingsError(
            f"a body's id is letters and digits and begins with a letter, such as b3bd5, not '{body_id}'"
        )


def _joint(robot: ET.Element, name: str, kind: str, parent: str, child: str, origin: Array, body_id: str) -> ET.Element:
    ET.SubElement(robot, "link", name=f"{child}_{body_id}")
    element = ET.SubElement(robot, "joint", name=f"{name}_{body_id}", type=kind)
    ET.SubElement(element, "parent", link=f"{parent}_{body_id}")
    ET.SubElement(element, "child", link=f"{child}_{body_id}")
    ET.SubElement(element, "origin", xyz=xml_numbers(origin), rpy="0 0 0")
    return element
