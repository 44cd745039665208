"""Run by a Python that has usd-core: says where the joints of a skeleton are, the skin of it, and rigid objects.

Usage: read_in_usd.py FILE OUT.json
"""

import json
import sys
from pathlib import Path

from pxr import Gf, Usd, UsdGeom, UsdShade, UsdSkel

EVERY = 50
"""The places of every so-manieth vertex are told."""


def main(file, output):
    stage = Usd.Stage.Open(str(file))
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    skeleton = next(UsdSkel.Skeleton(prim) for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton))
    mesh = next(UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    query = cache.GetSkelQuery(skeleton)
    skinning = cache.GetSkinningQuery(mesh.GetPrim())
    names = [joint.split("/")[-1] for joint in query.GetJointOrder()]
    frames = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    heads = {name: [] for name in names}
    skins = []
    rest = mesh.GetPointsAttr().Get()
    for frame in frames:
        for name, pose in zip(names, query.ComputeJointSkelTransforms(frame), strict=True):
            heads[name].append(list(pose.ExtractTranslation()))
        points = type(rest)(rest)
        assert skinning.ComputeSkinnedPoints(query.ComputeSkinningTransforms(frame), points, frame)
        skins.append([list(Gf.Vec3d(*points[row])) for row in range(0, len(points), EVERY)])
    poses = UsdGeom.XformCache()
    objects = {}
    for frame in frames:
        poses.SetTime(frame)
        for prim in stage.Traverse():
            if prim.IsA(UsdGeom.Xform):
                matrix = poses.GetLocalToWorldTransform(prim)
                rows = [list(matrix.GetRow(row)) for row in range(4)]  # USD multiplies rows by matrices
                objects.setdefault(prim.GetName(), []).append(rows)
    ground = [
        list(point)
        for prim in stage.Traverse()
        if prim.IsA(UsdGeom.Mesh) and prim.GetParent().GetName() == "ground"
        for point in UsdGeom.Mesh(prim).GetPointsAttr().Get()
    ]
    bound = [
        str(UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPath())
        for prim in stage.Traverse()
        if prim.IsA(UsdGeom.Mesh)
    ]
    said = {
        "objects": objects,
        "ground": ground,
        "materials": bound,
        "heads": heads,
        "skins": skins,
        "fps": stage.GetTimeCodesPerSecond(),
        "up": str(UsdGeom.GetStageUpAxis(stage)),
        "metres": UsdGeom.GetStageMetersPerUnit(stage),
        "vertices": len(rest),
        "bones_of_a_vertex": skinning.GetNumInfluencesPerComponent(),
    }
    output.write_text(json.dumps(said))


main(*map(Path, sys.argv[1:]))
