"""USD: a moving skinned skeleton (UsdSkel), for Omniverse, Houdini, Maya, Unreal and Apple's viewers.

It is a text file, for every reader of ``.usd`` and ``.usda``. Metres, z up, unless options change it, which the file
tells its readers; a frame is a time code. In a gap there are no samples, and readers interpolate.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.skin import MOST_BONES
from bodycam_ros.errors import BodyError
from bodycam_ros.files.distinct_names import distinct_names
from bodycam_ros.formats.figure import Figure
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.formats.skinned_figure import SkinnedFigure
from bodycam_ros.formats.staged_motion import staged_motion
from bodycam_ros.formats.usd_objects import SKIN, bound_material, usd_materials, usd_objects
from bodycam_ros.formats.usd_values import identifier, matrices, samples, tokens, written, written_rows
from bodycam_ros.geometry import quaternion_xyzw, rigid

MARK = "#usda 1.0"

_UP = "z"
_SKIN_COLOUR = (0.85, 0.68, 0.56)


def write_usd(motion: SampledMotion, options: MotionOptions) -> str:
    """The motion as a USD document.

    Raises:
        BodyError: two bones would have the same name.
    """
    staged = staged_motion(motion, options)
    motion = staged.motion
    skinned = SkinnedFigure.from_motion(motion, options, _UP)
    figure = skinned.figure
    if len(set(_paths(figure))) < len(figure.names):
        raise BodyError(f"{motion.name}: two bones would have the same name, which in USD has letters and digits alone")
    last = len(motion.stamps_ns) - 1
    parts = [_skeleton(figure), _animation(figure, np.flatnonzero(motion.known))]
    if len(skinned.vertices):
        parts.append(_mesh(skinned))
    parts += usd_objects(staged, options, _UP)
    parts.append(usd_materials(staged, _SKIN_COLOUR, identifier(motion.body.name)))
    name = identifier(motion.body.name)
    return f"""{MARK}
(
    defaultPrim = "{name}"
    doc = "written by bodycam_ros"
    endTimeCode = {last}
    framesPerSecond = {motion.rate:.9g}
    metersPerUnit = {1.0 / (options.scale or 1.0):.9g}
    startTimeCode = 0
    timeCodesPerSecond = {motion.rate:.9g}
    upAxis = "{(options.up or _UP).upper()}"
)

def SkelRoot "{name}"
{{
{"".join(parts)}}}
"""


def _skeleton(figure: Figure) -> str:
    bind = rigid(np.eye(3), figure.rest[:, :3, 3])
    rest = rigid(np.eye(3), figure.offsets)
    return f"""    def Skeleton "skeleton" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform matrix4d[] bindTransforms = [{matrices(bind)}]
        uniform token[] jointNames = [{tokens(figure.names)}]
        uniform token[] joints = [{tokens(_paths(figure))}]
        uniform matrix4d[] restTransforms = [{matrices(rest)}]
        rel skel:animationSource = <../motion>
    }}

"""


def _animation(figure: Figure, frames: NDArray[np.intp]) -> str:
    quaternions = quaternion_xyzw(figure.local_rotations[frames])[..., [3, 0, 1, 2]]
    positions = np.tile(figure.offsets, (len(frames), 1, 1))
    positions[:, 0] = figure.positions[frames, 0]
    ones = ", ".join(["(1, 1, 1)"] * len(figure.names))
    return f"""    def SkelAnimation "motion"
    {{
        uniform token[] joints = [{tokens(_paths(figure))}]
        quatf[] rotations.timeSamples = {{
{samples(frames, quaternions)}        }}
        half3[] scales = [{ones}]
        float3[] translations.timeSamples = {{
{samples(frames, positions)}        }}
    }}

"""


def _mesh(skin: SkinnedFigure) -> str:
    counts = ", ".join(["3"] * len(skin.triangles))
    corners = ", ".join(map(str, skin.triangles.ravel().tolist()))
    bones = ", ".join(map(str, skin.joints.ravel().tolist()))
    weights = ", ".join(f"{weight:.6g}" for weight in skin.weights.ravel().tolist())
    low, high = (written(end.tolist()) for end in (skin.vertices.min(axis=0), skin.vertices.max(axis=0)))
    return f"""    def Mesh "skin" (
        prepend apiSchemas = ["SkelBindingAPI", "MaterialBindingAPI"]
    )
    {{
        float3[] extent = [{low}, {high}]
        int[] faceVertexCounts = [{counts}]
        int[] faceVertexIndices = [{corners}]
        normal3f[] normals = [{written_rows(skin.normals)}] (
            interpolation = "vertex"
        )
        point3f[] points = [{written_rows(skin.vertices)}]
        color3f[] primvars:displayColor = [{written(_SKIN_COLOUR)}]
        matrix4d primvars:skel:geomBindTransform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )
        int[] primvars:skel:jointIndices = [{bones}] (
            elementSize = {MOST_BONES}
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [{weights}] (
            elementSize = {MOST_BONES}
            interpolation = "vertex"
        )
        {bound_material(SKIN, 1)}
        rel skel:skeleton = <../skeleton>
        uniform token subdivisionScheme = "none"
    }}
"""


def _paths(figure: Figure) -> list[str]:
    """Each bone after its parents, as USD names joints."""
    paths: list[str] = []
    identifiers = distinct_names(figure.names, identifier)
    for name, parent in zip(figure.names, figure.parents, strict=True):
        own = identifiers[name]
        paths.append(own if parent < 0 else f"{paths[parent]}/{own}")
    return paths
