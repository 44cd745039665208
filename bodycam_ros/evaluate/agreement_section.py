"""The section of the report about another system: errors as the paper states them, per joint and plane, agreement."""

import numpy as np

from bodycam_ros.body.urdf import CAMERA_SUFFIX
from bodycam_ros.evaluate.agree import CM_PER_M, DIRECTIONS
from bodycam_ros.evaluate.agreement import NONE, SIMILARITY, Agreement, LimitsOfAgreement, Spread
from bodycam_ros.evaluate.anatomical_angles import PLANES, joint_name, meaning
from bodycam_ros.evaluate.page import Block, Heading, Picture, Table, Text, number

WAYS, JOINTS, BLAND_ALTMAN = "ways.png", "joints.png", "bland_altman.png"
"""Files of the section's pictures."""

_SPREAD = ("mean", "median", "sd", "min", "max")
_LIMITS = ("bias", "95 % from", "to", "rmse")
_UNITS = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inches"}


def agreement_section(agreement: Agreement, shows_cameras: bool) -> tuple[Block, ...]:
    """What is said of an agreement.

    Args:
        agreement: ours and theirs.
        shows_cameras: the picture of ways is of cameras, not of joints.
    """
    blocks: list[Block] = [
        Heading(f"Against {agreement.name} ({agreement.kind})"),
        *(Text(f"Doubtful: {doubt}") for doubt in agreement.doubts),
        *(Text(line) for line in agreement_lines(agreement)),
        Table(("error", *_SPREAD), _overall(agreement)),
        Picture(WAYS, _ways_caption(shows_cameras)),
        Picture(
            JOINTS,
            (
                "By how much joints have turned since the first instant, ours and theirs, and how"
                if agreement.angles
                else "How"
            )
            + " far joints are off (after A figure 7).",
        ),
        Heading("Positions, per joint and direction"),
        Text(
            "Distance [cm], and the mean difference, ours less theirs, forward, to the left and up of the body with "
            "its standard deviation."
            + (" * Where it is on its segment was fitted: constant errors do not show." if _fitted(agreement) else "")
        ),
        Table(("point", "on", *_SPREAD, *DIRECTIONS), _points(agreement)),
    ]
    if agreement.angles:
        blocks += [
            Heading("Joint angles, per joint and anatomical plane"),
            Text(_angles_note(agreement)),
            Table(("joint", "plane", *_SPREAD, *_LIMITS), _angles(agreement)),
            Picture(
                BLAND_ALTMAN,
                "Difference of the two systems over their mean [deg] at every instant, with the bias and the limits of "
                "agreement (Bland and Altman 1986).",
            ),
        ]
    return tuple(blocks)


def agreement_lines(agreement: Agreement) -> list[str]:
    """What was done to compare, in sentences."""
    clock, given = agreement.clock, np.isnan(agreement.clock.likeness)
    when = f"Their first frame is at {clock.start_s:.3f} s of this recording"
    if given:
        when += ", as its stamps say."
    else:
        rate = "goes as ours"
        if clock.rate != 1.0:
            rate = f"counts seconds of {clock.rate:.5f} s (+-{clock.rate_sigma:.5f})"
        when += f" (+-{1e3 * clock.start_sigma_s:.1f} ms), and their clock {rate}."
    scale = f"{agreement.scale:.4f} ({100.0 * (agreement.scale - 1.0):+.2f} %)"
    if agreement.align == NONE:
        where = f"Worlds are taken to be the same; a similarity would have a scale of {scale}."
    else:
        rigid = f"{CM_PER_M * agreement.rigid_error:.2f} cm"
        where = (
            f"Worlds are aligned by a similarity of scale {scale}; without it joints are {rigid} off on average."
            if agreement.align == SIMILARITY
            else f"Worlds are aligned rigidly; a similarity would have a scale of {scale}."
        )
    lines = [f"{when} {where} {len(agreement.stamps_ns)} instants are compared."]
    if agreement.unit_m is not None:
        unit = _UNITS.get(agreement.unit_m, f"{agreement.unit_m:.4f} m")
        lines.append(f"The file does not say its unit; by the size of the body it is {unit}.")
    if agreement.left_out:
        some = ", ".join(agreement.left_out[:12]) + (" ..." if len(agreement.left_out) > 12 else "")
        lines.append(f"Not compared, because their position is unknown (give it with --points): {some}.")
    return lines


def _overall(agreement: Agreement) -> list[tuple[str, ...]]:
    rows = [("joint position [cm]", CM_PER_M * agreement.position_errors)]
    if agreement.markers:
        rows.append(("marker, place fitted [cm]", CM_PER_M * np.array([marker.errors for marker in agreement.markers])))
    if agreement.cameras and agreement.cameras != agreement.joints:
        rows.append(("camera centre [cm]", CM_PER_M * np.array([camera.errors for camera in agreement.cameras])))
    if agreement.angles:
        rows.append(("joint angle [deg]", np.degrees(np.array([*agreement.angle_errors.values()]))))
    return [(name, *_spread(Spread.of(values))) for name, values in rows]


def _ways_caption(shows_cameras: bool) -> str:
    if shows_cameras:
        return (
            "Centres of cameras, ours and theirs: as each camera found itself by its own images, and as the body has "
            "them (after A figure 6)."
        )
    return "Ways of joints through the world, ours in colour over theirs in grey (after A figure 6)."


def _fitted(agreement: Agreement) -> bool:
    return any(point.is_fitted for point in agreement.points)


def _points(agreement: Agreement) -> list[tuple[str, ...]]:
    rows = []
    for point in (*agreement.joints, *(point for point in agreement.points if point not in agreement.joints)):
        along = CM_PER_M * point.errors_along
        differences = [Spread.of(values) for values in along.T]
        rows.append(
            (
                point.name.removesuffix(CAMERA_SUFFIX) + ("*" if point.is_fitted else ""),
                ("camera " if point.is_camera else "") + point.link.removesuffix(CAMERA_SUFFIX).replace("_", " "),
                *_spread(Spread.of(CM_PER_M * point.errors)),
                *(f"{number(of.mean, signed=True)} +-{number(of.sd)}" if of.sd == of.sd else "" for of in differences),
            )
        )
    return rows


def _angles_note(agreement: Agreement) -> str:
    note = "Error [deg], and how ours less theirs agree: bias, the limits that hold 95 % of the differences, and rmse. "
    if agreement.angles[0].from_points:
        return note + (
            "They have no rotations of bones, so angles are told by centres of joints, ours in the same way: knees and "
            "elbows in one plane, nothing about a bone's own axis."
        )
    return note + (
        "How the two lay axes into bones is a convention; two constant rotations per joint are fitted, so that a "
        "constant bias hardly shows. Planes are of swing and twist: swing in the sagittal and the frontal plane, "
        "twist in the transverse one."
    )


def _angles(agreement: Agreement) -> list[tuple[str, ...]]:
    rows = []
    for angle in agreement.angles:
        for column, (plane, what) in enumerate(zip(PLANES, meaning(angle.segment), strict=True)):
            ours, theirs = np.degrees(angle.ours[:, column]), np.degrees(angle.theirs[:, column])
            if not np.isfinite(theirs).any():
                continue
            limits = LimitsOfAgreement.of(ours, theirs)
            rows.append(
                (
                    joint_name(angle.segment),
                    f"{plane}, {what}",
                    *_spread(Spread.of(np.abs(ours - theirs))),
                    *(number(value, signed=True) for value in (limits.bias, limits.low, limits.high)),
                    number(limits.rmse),
                )
            )
    return rows


def _spread(spread: Spread) -> tuple[str, ...]:
    return tuple(number(getattr(spread, name)) for name in _SPREAD)
