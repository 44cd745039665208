"""One ``<joint>`` of a URDF document, as it is written there."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bodycam_ros.geometry import Array, rigid

TURNING = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """One joint.

    Attributes:
        name: of the joint.
        parent, child: links.
        parent_T_joint: (4, 4) pose of the joint, and at angle zero of the child link [m].
        axis: (3,) unit axis in the joint's axes; None for a fixed joint.
        limits: (low, high) [rad] of a revolute joint; None for others.
    """

    name: str
    parent: str
    child: str
    parent_T_joint: Array
    axis: Array | None
    limits: tuple[float, float] | None

    @classmethod
    def read(cls, element: ET.Element) -> "UrdfJoint":
        """The joint of an element.

        Raises:
            ValueError: it lacks something, or is of a type that no body has.
        """
        name, kind = element.attrib.get("name", ""), element.attrib.get("type", "")
        if not name:
            raise ValueError("a joint has no name")
        if kind not in (*TURNING, "fixed"):
            raise ValueError(
                f"joint {name} is {kind or 'of no type'}; a body has {', '.join(TURNING)} and fixed joints"
            )
        parent, child = (_link(element, role) for role in ("parent", "child"))
        if not parent or not child:
            raise ValueError(f"joint {name} lacks its parent or child link")
        try:
            origin = _origin(element.find("origin"))
            axis = _axis(element.find("axis")) if kind in TURNING else None
            limits = _limits(element.find("limit")) if kind == "revolute" else None
        except ValueError as error:
            raise ValueError(f"joint {name}: {error}") from error
        return cls(name, parent, child, origin, axis, limits)


def _link(element: ET.Element, role: str) -> str:
    found = element.find(role)
    return "" if found is None else found.attrib.get("link", "")


def _origin(element: ET.Element | None) -> Array:
    roll_pitch_yaw = _numbers(element, "rpy", "0 0 0", 3)
    # URDF turns about fixed axes: x, then y, then z.
    R = np.asarray(Rotation.from_euler("xyz", roll_pitch_yaw).as_matrix(), dtype=np.float64)
    return rigid(R, _numbers(element, "xyz", "0 0 0", 3))


def _axis(element: ET.Element | None) -> Array:
    axis = _numbers(element, "xyz", "1 0 0", 3)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ValueError("its axis has no direction")
    return axis / length


def _limits(element: ET.Element | None) -> tuple[float, float]:
    low, high = (float(_numbers(element, bound, "0", 1)[0]) for bound in ("lower", "upper"))
    return low, high


def _numbers(element: ET.Element | None, attribute: str, default: str, count: int) -> Array:
    text = default if element is None else element.attrib.get(attribute, default)
    numbers = np.array([_number(word) for word in text.split()])
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        wanted = "three numbers" if count == 3 else "a number"
        raise ValueError(f'{attribute}="{text}" is not {wanted}')
    return numbers


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan
