"""The parameters of a static camera's node."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.nodes.common_parameters import ManagedParameters
from bodycam_ros.settings import setting

REGION_GROUPS: Final = ("region", "motion")
"""The groups of settings that it uses."""


@dataclass(frozen=True)
class RegionTrackerParameters(ManagedParameters):
    """Of the node ``region_tracker``."""

    camera: str = setting("", reason="the static camera; its images are on <camera>/image_raw/compressed, in colour")
    stations: str = setting("", reason="YAML of the static cameras: where they stand, and their lenses")
    body: str = setting("", reason="body YAML; the solver must have the same")
    surface: str = setting(
        "", reason="folder of the segments' meshes; if empty the one that 'body' names, or capsules along its bones"
    )
    start: str = setting(
        "", reason="YAML of where the body is in the first image; if empty it waits until worn cameras tell the solver"
    )
    equipment: str = setting("", reason="as the solver has it")
    map: str = setting(
        "", reason="folder of the reference map whose frame is the world; if empty the frame of 'stations' is"
    )
    transport: str = setting("compressed", reason="as of the tracker")
    image_queue: int = setting(
        150,
        unit="images",
        limits=(1, 10000),
        reason="how far it may fall behind before images are lost: 5 s, for at first limbs are looked for; those that "
        "the solver has not waited for are left out anyway",
    )
    most_ahead: int = setting(
        1,
        unit="frames",
        limits=(1, 10000),
        reason="how far it may run ahead of the solver: on a cyclist all cameras together leave 0.9 cm, with 1 each by "
        "itself leaves 1.0, with 2 it leaves 1.2, with 3 the feet are lost",
        live=True,
    )
    longest_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="when an image has waited for longer every second one is left out",
        live=True,
    )
    recovery: float = setting(
        5.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="how long none may have waited before all are looked at again",
        live=True,
    )
    start_wait: float = setting(
        0.5,
        unit="s",
        limits=(0.0, 600.0),
        reason="with 'start': how long the first image waits for a solver that knows where the body is by now, as it "
        "does where this node was started again",
        live=True,
    )
