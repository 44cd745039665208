"""The parameters of the node that describes the body as REP-155 does."""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.nodes.common_parameters import ManagedParameters
from bodycam_ros.settings import setting

DESCRIPTION: Final = "human_description_"
"""Before the id: the parameter in which the REP wants the URDF, which the node makes itself of the body it hears."""


@dataclass(frozen=True)
class HumansParameters(ManagedParameters):
    """Of the node ``humans``."""

    body_id: str = setting(
        "",
        reason="REP-155's identifier of the body, in names of topics, joints and frames; made anew at every start if "
        "empty, for the REP does not want it to last",
    )
