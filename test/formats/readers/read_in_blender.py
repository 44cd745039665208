"""Run by Blender's Python: imports a BVH, a glTF or a USD, and says where the heads of its bones and its skin are.

Usage: read_in_blender.py FILE OUT.json [PICTURE.png]
"""

import json
import sys
from pathlib import Path

import bpy

EVERY = 50
"""The places of every so-manieth vertex are told."""


def heads(armature, first, count):
    """Bone -> frame -> (x, y, z), in Blender's world, whose z is up."""
    found = {bone.name: [] for bone in armature.pose.bones}
    for frame in range(first, first + count):
        bpy.context.scene.frame_set(frame)
        for bone in armature.pose.bones:
            found[bone.name].append(list(armature.matrix_world @ bone.head))
    return found


def skin(first, count):
    """Frame -> every so-manieth vertex of the only skin, in Blender's world."""
    mesh = next(thing for thing in bpy.context.scene.objects if thing.type == "MESH" and thing.vertex_groups)
    found = []
    for frame in range(first, first + count):
        bpy.context.scene.frame_set(frame)
        posed = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
        vertices = posed.data.vertices
        found.append([list(posed.matrix_world @ vertices[row].co) for row in range(0, len(vertices), EVERY)])
    weights = [sum(group.weight for group in vertex.groups) for vertex in mesh.data.vertices]
    most = max(len(vertex.groups) for vertex in mesh.data.vertices)
    return {"skin": found, "weights": [min(weights), max(weights)], "bones_of_a_vertex": most}


def draw(armature, path):
    scene = bpy.context.scene
    at = armature.matrix_world @ armature.pose.bones[0].head
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.location = (at.x + 2.5, at.y - 2.5, 1.6)
    camera.rotation_euler = (at - camera.location).to_track_quat("-Z", "Y").to_euler()
    light = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    scene.collection.objects.link(light)
    light.rotation_euler = (0.5, 0.3, 0.0)
    light.data.energy = 3.0
    scene.camera = camera
    scene.world = scene.world or bpy.data.worlds.new("world")
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.render.resolution_x = scene.render.resolution_y = 480
    scene.render.filepath = str(path)
    bpy.ops.mesh.primitive_plane_add(size=30.0, location=(at.x, at.y, 0.0))
    bpy.ops.render.render(write_still=True)


def main(file, output, picture=None):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if file.suffix == ".bvh":
        bpy.ops.import_anim.bvh(filepath=str(file), update_scene_fps=True, update_scene_duration=True)
    elif file.suffix == ".usd":
        bpy.ops.wm.usd_import(filepath=str(file))
    else:
        # Blender puts keys at times times its own rate; whole frames are compared.
        bpy.context.scene.render.fps = 30
        bpy.ops.import_scene.gltf(filepath=str(file))
    armature = next(thing for thing in bpy.context.scene.objects if thing.type == "ARMATURE")
    action = armature.animation_data.action
    first, last = (round(end) for end in action.frame_range)
    scene = bpy.context.scene
    meshes = [thing for thing in scene.objects if thing.type == "MESH"]
    said = {
        "heads": heads(armature, first, last - first + 1),
        "first_frame": first,
        "fps": scene.render.fps / scene.render.fps_base,
        "rest": {bone.name: list(armature.matrix_world @ bone.head_local) for bone in armature.data.bones},
        "vertices": sum(len(mesh.data.vertices) for mesh in meshes),
    }
    if file.suffix != ".bvh":
        said |= skin(first, last - first + 1)
    output.write_text(json.dumps(said))
    if picture is not None:
        scene.frame_set((first + last) // 2)
        draw(armature, picture)


main(*map(Path, sys.argv[1:]))
