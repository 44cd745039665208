"""The place: landmarks of the map, and the floor."""

from viser import SceneApi, SceneNodeHandle

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.colours import GRID, GRID_FINE, rgb

WORLD = "/world"
"""Name of the map's frame in the scene."""

_POINT_M = 0.012
_CELL_M, _SECTION_M = 0.5, 1.0
_FADES_M = 18.0


def add_map(scene: SceneApi, reference_map: ReferenceMap) -> SceneNodeHandle:
    """Add the landmarks in their colours, and where the map knows what is up, a grid on the floor.

    Returns the landmarks, to be shown or hidden.
    """
    if reference_map.gravity_aligned:
        scene.add_grid(
            f"{WORLD}/floor",
            infinite_grid=True,
            cell_size=_CELL_M,
            section_size=_SECTION_M,
            cell_color=rgb(GRID_FINE),
            section_color=rgb(GRID),
            fade_distance=_FADES_M,
        )
    return scene.add_point_cloud(
        f"{WORLD}/landmarks",
        reference_map.points_world,
        reference_map.colours,
        point_size=_POINT_M,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
