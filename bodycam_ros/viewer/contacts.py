"""Where a solved body touches what is around it: feet at rest on the floor, and attachments to equipment that hold."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_body import SolvedBody
from bodycam_ros.results.stances import feet_of, find_stances, sole_of


@dataclass(frozen=True, eq=False)
class Contact:
    """One foot, or one attachment, over T states.

    Attributes:
        name: the foot's segment, or the attachment.
        touches: (T, P) whether each of its points touches; an attachment has one point.
        points_world: (T, P, 3) [m]; None of an attachment, whose place is not in the bag.
    """

    name: str
    touches: NDArray[np.bool_]
    points_world: Array | None = None


def find_contacts(solved: SolvedBody) -> tuple[Contact, ...]:
    """Feet whose heel and ball are known, then attachments of the equipment."""
    stamps_ns = solved.stamps_ns
    contacts = []
    if len(stamps_ns) > 1:
        soles = {foot: sole_of(solved, foot, solved.world_T_link[foot]) for foot in feet_of(solved)}
        for foot, stances in find_stances(soles, stamps_ns, solved.longest_step_ns).items():
            touches = np.zeros(soles[foot].shape[:2], bool)
            for point, first, last in stances:
                touches[first:last, point] = True
            contacts.append(Contact(foot, touches, soles[foot]))
    if solved.equipment is not None:
        rows = np.searchsorted(solved.equipment.stamps_ns, stamps_ns).clip(0, len(solved.equipment.stamps_ns) - 1)
        known = solved.equipment.stamps_ns[rows] == stamps_ns
        held = solved.equipment.held[rows] & known[:, None]
        contacts += [Contact(name, held[:, [k]]) for k, name in enumerate(solved.equipment.attachments)]
    return tuple(contacts)


def touching_at(contacts: Sequence[Contact], index: int) -> Array:
    """(N, 3) points that touch at one state and whose places are known [m]."""
    places = [each.points_world[index][each.touches[index]] for each in contacts if each.points_world is not None]
    return np.concatenate([np.zeros((0, 3)), *places])
