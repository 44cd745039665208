"""REP-155's kinematic model of a human: which joints there are, about which axes, and which segment each chain ends in.

Names, order and axes are those of ``human_description``, which the REP recommends. In its zero pose a human stands with
the arms down and every frame has x forward, y left, z up, as in our N-pose. Wrists and ankles do not move there.
"""

from dataclasses import dataclass
from typing import Final

from bodycam_ros.calibration.anatomy import LEFT, RIGHT

BODY: Final = "body"
"""The root link, midway between the hips."""

TORSO: Final = "torso"
"""The link that neck and arms hang on, midway between the shoulders; the waist turns it about a point further down."""

_SIDES = {LEFT: ("l", 1.0), RIGHT: ("r", -1.0)}


@dataclass(frozen=True)
class Chain:
    """The joints that turn one link, on which a segment of ours is laid.

    Attributes:
        segment: of the default body; where a body lacks it there is no chain.
        base: the link that the first joint hangs on.
        joints: names, from the base on.
        axes: (x, y, z) unit axis of each.
        links: that each joint turns; the last is the segment's.
        end: the fixed joint and link at the segment's far end, of the same name.
        end_segment: the segment that begins there.
        bends: of a hinge, the sign of its angle when it bends: +1, -1.
    """

    segment: str
    base: str
    joints: tuple[str, ...]
    axes: tuple[tuple[float, float, float], ...]
    links: tuple[str, ...]
    end: str | None = None
    end_segment: str | None = None
    bends: float = 0.0

    @property
    def link(self) -> str:
        """The last one."""
        return self.links[-1]


def _sided(side: str) -> tuple[Chain, ...]:
    letter, s = _SIDES[side]
    shoulder, hip = f"{letter}_shoulder", f"{letter}_hip"
    return (
        Chain(
            f"upper_arm{side}",
            TORSO,
            (f"{letter}_y_shoulder", f"{letter}_p_shoulder", f"{letter}_r_shoulder"),
            ((0.0, 0.0, -s), (s, 0.0, 0.0), (0.0, 0.0, s)),
            (f"{letter}_y_shoulder", f"{letter}_p_shoulder", shoulder),
        ),
        Chain(
            f"forearm{side}",
            shoulder,
            (f"{letter}_elbow",),
            ((0.0, -1.0, 0.0),),
            (f"{letter}_elbow",),
            f"{letter}_wrist",
            f"hand{side}",
            bends=1.0,
        ),
        Chain(
            f"thigh{side}",
            BODY,
            (f"{letter}_y_hip", f"{letter}_p_hip", f"{letter}_r_hip"),
            ((0.0, 0.0, -1.0), (s, 0.0, 0.0), (0.0, -1.0, 0.0)),
            (f"{letter}_y_hip", f"{letter}_p_hip", hip),
        ),
        Chain(
            f"shin{side}",
            hip,
            (f"{letter}_knee",),
            ((0.0, -1.0, 0.0),),
            (f"{letter}_knee",),
            f"{letter}_ankle",
            f"foot{side}",
            bends=-1.0,
        ),
    )


CHAINS: Final = (
    Chain("torso", BODY, ("waist",), ((0.0, 1.0, 0.0),), ("waist",), TORSO),
    Chain(
        "head",
        TORSO,
        ("r_head", "y_head", "p_head"),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
        ("r_head", "y_head", "p_head"),
        "head",
    ),
    *_sided(LEFT),
    *_sided(RIGHT),
)
"""All, each after the one that it hangs on."""
