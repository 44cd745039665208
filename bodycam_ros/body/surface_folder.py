"""Surfaces from a folder of meshes, one a segment: ``thigh_left.obj`` or ``thigh_left.ply``, in metres."""

import io
import logging
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.surface import Surface
from bodycam_ros.errors import BodyError
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.geometry import Array

logger = logging.getLogger(__name__)

SUFFIXES = (".obj", ".ply")
MOST_FACES = 200_000
KEPT_FACES = 2000
"""Faces of a segment: neighbouring contour points are then a centimetre apart."""

_MOST_BYTES = 100_000_000
_LIBRARIES = {"networkx": "networkx", "fast_simplification": "fast-simplification"}
"""Modules with which trimesh turns faces outward and decimates meshes, and their distributions."""

_SEAM_DIGITS = 5  # vertices that agree to so many decimals of a metre are one: files round to micrometres
_LEAST_AREA_M2 = 1e-12  # a face of less has no normal
_LARGEST_M, _SMALLEST_M = 3.0, 0.01
_FARTHEST_M = 0.5  # from a segment's origin, which is at its joint, to its nearest vertex


def read_surfaces(folder: Path, body: BodyModel) -> dict[str, Surface]:
    """Segment -> its surface, of the segments that the folder has a mesh of.

    A mesh of many faces is decimated. One that is named after no segment of the body is left out, with a warning; so
    are the hands of a scan, if the body has none.

    Raises:
        BodyError: there is no such folder, it has no mesh of any segment, or one that is no mesh of a segment in
            metres and its frame; the message names the file. Or a library for meshes is not installed.
    """
    files = _mesh_files(folder)
    segments = [segment for segment in body.segments if segment in files]
    if not segments:
        wanted = f"{body.segments[0]}.obj or {body.segments[0]}.ply"
        raise BodyError(
            f"{folder}: has no mesh of any segment of body {body.name}; expected one a segment, named as it is, "
            f"such as {wanted}, and found {', '.join(sorted(files)[:5]) or 'no OBJ and no PLY file'}"
        )
    if others := sorted(set(files) - set(segments)):
        logger.warning("%s: leaves out %s, which body %s does not have", folder, ", ".join(others), body.name)
    if missing := [name for module, name in _LIBRARIES.items() if find_spec(module) is None]:
        raise BodyError(
            f"{folder}: reading meshes needs {' and '.join(missing)}; install {'it' if len(missing) == 1 else 'them'}: "
            f"pip install {' '.join(missing)}"
        )
    surfaces = {}
    for segment in segments:
        path = files[segment]
        content = read_bytes(path, f"mesh of at most {MOST_FACES} faces", BodyError, _MOST_BYTES)
        try:
            surfaces[segment] = _read_surface(content, path.suffix[1:].lower())
        except BodyError as error:
            raise BodyError(f"{path}: {error}") from error
    return surfaces


def _mesh_files(folder: Path) -> dict[str, Path]:
    """Name without suffix -> file."""
    try:
        paths = sorted(folder.iterdir())
    except OSError as error:
        raise BodyError(f"{folder}: expected a folder with an OBJ or PLY file a segment: {error.strerror}") from error
    files: dict[str, Path] = {}
    for path in paths:
        if path.suffix.lower() in SUFFIXES and not path.name.startswith("."):
            if path.stem in files:
                raise BodyError(f"{folder}: has {files[path.stem].name} and {path.name}; keep one of them")
            files[path.stem] = path
    return files


def _read_surface(content: bytes, kind: str) -> Surface:
    """A mesh without seams, wound outward, whatever the file has."""
    import trimesh  # a second to load, needed for scans only

    try:
        # Without the folder it finds neither materials nor textures, and opens no other file.
        mesh = trimesh.load(io.BytesIO(content), file_type=kind, force="mesh", process=False)
    except IndexError as error:
        raise BodyError("has faces with vertices that it does not have") from error
    except Exception as error:  # trimesh checks the forms of files by nothing but what goes wrong
        raise BodyError(f"is damaged, or no {kind.upper()} file: {str(error)[:200]}") from error
    vertices = np.asarray(getattr(mesh, "vertices", np.empty((0, 3))), np.float64)
    faces = np.asarray(getattr(mesh, "faces", np.empty((0, 3))), np.int64)
    if not faces.size:
        raise BodyError(f"has {len(vertices)} points and no faces; expected a mesh, not a cloud of points")
    if len(faces) > MOST_FACES:
        raise BodyError(
            f"has {len(faces)} faces, more than {MOST_FACES}; decimate it, a contour needs some {KEPT_FACES}"
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise BodyError(f"has faces with vertices that it does not have; there are {len(vertices)}")
    if not np.isfinite(vertices).all():
        raise BodyError("has vertices that are not finite numbers")
    _check_size(vertices[np.unique(faces)])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices(digits_vertex=_SEAM_DIGITS)
    mesh.update_faces(mesh.unique_faces() & (mesh.area_faces > _LEAST_AREA_M2))
    if not len(mesh.faces):
        raise BodyError("has no face with an area")
    trimesh.repair.fix_normals(mesh, multibody=True)  # type: ignore[no-untyped-call]
    if len(mesh.faces) > KEPT_FACES:
        mesh = mesh.simplify_quadric_decimation(face_count=KEPT_FACES)
        mesh.update_faces(mesh.area_faces > _LEAST_AREA_M2)
    mesh.remove_unreferenced_vertices()
    return Surface(np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int32))


def _check_size(vertices: Array) -> None:
    size = float(np.ptp(vertices, axis=0).max())
    if not _SMALLEST_M <= size <= _LARGEST_M:
        raise BodyError(
            f"is {size:.4g} m large, as no segment is; meshes are in metres: scale it (by 0.001 from millimetres, by "
            "0.01 from centimetres)"
        )
    away = float(np.linalg.norm(np.maximum(np.maximum(vertices.min(axis=0), -vertices.max(axis=0)), 0.0)))
    if away > _FARTHEST_M:
        raise BodyError(
            f"begins {away:.2f} m from its segment's origin; expected it in the segment's frame: origin at the joint "
            "to the parent, x forward, y left, z up in the N-pose"
        )


def surfaces_of(body: BodyModel, body_path: Path, folder: Path | None = None) -> dict[str, Surface]:
    """Segment -> its surface: from the folder if there is one, else from the body's own, else capsules.

    Static cameras do not observe segments that a folder has no mesh of.

    Args:
        body: alone, or coupled to its equipment, which has a surface where the folder has meshes of it.
        body_path: the file that the body is from; the folder that it names lies beside it.
        folder: of meshes, as the user asks for.

    Raises:
        BodyError: the folder cannot be used; the message names what is wrong with it.
    """
    if folder is None and body.surface is not None:
        folder = body_path.parent / body.surface
    if folder is None:
        return capsule_surfaces(body)
    surfaces = read_surfaces(folder, body)
    if lacking := [segment for segment in body.segments if segment not in {*surfaces, *body.equipment_segments}]:
        logger.warning("%s: has no mesh of %s; static cameras do not observe them", folder, ", ".join(lacking))
    return surfaces
