#!/usr/bin/env python3
"""Five balls, in graeco and in Blender Cycles: is one file one picture?

    python five_balls.py make balls.glb             # writes the scene
    python five_balls.py cycles balls.glb OUT.exr   # renders it with the pip package bpy (5.0.1 needs Python 3.11)
    python five_balls.py beer balls.glb OUT.exr     # the same, with the absorption that the file means
    python five_balls.py ours balls.glb OUT.exr     # renders it with graeco
    python five_balls.py table OURS.exr THEIRS.exr  # mean luminance of each ball, and how they differ

Balls from left to right: diffuse, metal, rough metal, glass, clear coat; each over its own part of a grey floor, under
one rectangular lamp and an even sky of radiance SKY. Both renderers trace 12 bounces with caustics and clamp nothing.
"table" needs numpy and OpenEXR. The program is $GRAECO, else target/release/graeco of this source tree.
"""

import json
import math
import os
import struct
import subprocess
import sys

NAMES = ["diffuse", "metal", "rough metal", "glass", "clear coat"]
RADIUS, SPACING, DISTANCE, HEIGHT, YFOV = 1.0, 2.5, 14.0, 2.0, math.radians(13.0)
SIZE = (400, 96)
SKY = 0.4
MATERIALS = [
    {"pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.25, 0.1, 1], "metallicFactor": 0, "roughnessFactor": 1}},
    {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.7, 0.4, 1], "metallicFactor": 1, "roughnessFactor": 0.1}},
    {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.7, 0.4, 1], "metallicFactor": 1, "roughnessFactor": 0.6}},
    {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 0},
     "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
                    "KHR_materials_volume": {"thicknessFactor": 1, "attenuationColor": [0.6, 0.9, 0.8],
                                             "attenuationDistance": 2}, "KHR_materials_ior": {"ior": 1.5}}},
    {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.6, 1], "metallicFactor": 0, "roughnessFactor": 0.8},
     "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.05}}},
    {"pbrMetallicRoughness": {"baseColorFactor": [0.4, 0.4, 0.4, 1], "metallicFactor": 0, "roughnessFactor": 1}},
    {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1},
     "emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 6}}},
]


def centre(ball):
    return ((ball - 2) * SPACING, RADIUS, 0.0)


def sphere(rings=96, sectors=192):
    """Positions (which are normals too) and triangles of a unit sphere."""
    points, triangles = [], []
    for i in range(rings + 1):
        theta = math.pi * i / rings
        for j in range(sectors + 1):
            phi = 2 * math.pi * j / sectors
            points.append((math.sin(theta) * math.cos(phi), math.cos(theta), -math.sin(theta) * math.sin(phi)))
    row = sectors + 1
    for i in range(rings):
        for j in range(sectors):
            a, b = i * row + j, (i + 1) * row + j
            triangles += [(a, b, b + 1)] if i == 0 else [(a, b, a + 1)] if i == rings - 1 else [(a, b, b + 1), (a, b + 1, a + 1)]
    return points, points, triangles


def rectangle(half, normal):
    x, z = half
    corners = [(-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z)]
    triangles = [(0, 1, 2), (0, 2, 3)] if normal > 0 else [(0, 2, 1), (0, 3, 2)]
    return corners, [(0, normal, 0)] * 4, triangles


def make(path):
    blob, views, accessors, meshes = b"", [], [], []

    def accessor(data, kind, component, count, bounds=None):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob += data + b"\0" * (-len(data) % 4)
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": count, "type": kind, **(bounds or {})})
        return len(accessors) - 1

    def shape(points, normals, triangles):
        flat = lambda rows: [x for row in rows for x in row]
        bounds = {"min": [min(p[i] for p in points) for i in range(3)], "max": [max(p[i] for p in points) for i in range(3)]}
        return {
            "attributes": {
                "POSITION": accessor(struct.pack(f"<{3 * len(points)}f", *flat(points)), "VEC3", 5126, len(points), bounds),
                "NORMAL": accessor(struct.pack(f"<{3 * len(normals)}f", *flat(normals)), "VEC3", 5126, len(normals)),
            },
            "indices": accessor(struct.pack(f"<{3 * len(triangles)}I", *flat(triangles)), "SCALAR", 5125, 3 * len(triangles)),
        }

    ball, floor, lamp = shape(*sphere()), shape(*rectangle((30, 30), 1)), shape(*rectangle((3, 1.5), -1))
    nodes = []
    for i in range(5):
        meshes.append({"primitives": [{**ball, "material": i}]})
        nodes.append({"mesh": i, "name": NAMES[i], "translation": centre(i)})
    meshes += [{"primitives": [{**floor, "material": 5}]}, {"primitives": [{**lamp, "material": 6}]}]
    nodes += [{"mesh": 5, "name": "floor"}, {"mesh": 6, "name": "lamp", "translation": [-2, 6, 3]}]
    down = -math.atan2(HEIGHT - RADIUS, DISTANCE)
    nodes.append({"camera": 0, "translation": [0, HEIGHT, DISTANCE], "rotation": [math.sin(down / 2), 0, 0, math.cos(down / 2)]})
    gltf = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
        "meshes": meshes, "materials": MATERIALS, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": YFOV, "aspectRatio": SIZE[0] / SIZE[1], "znear": 0.1}}],
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior", "KHR_materials_clearcoat",
                           "KHR_materials_emissive_strength"],
    }
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as f:
        f.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(blob)))
        f.write(struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob)


def cycles(path, out, samples, beer=False):
    sys.argv = sys.argv[:1]
    import bpy
    import addon_utils  # there only once bpy is

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("io_scene_gltf2")
    addon_utils.enable("cycles")
    bpy.ops.import_scene.gltf(filepath=os.path.abspath(path))
    # Blender's absorption node takes σ = density (1 - colour); the extension means -ln(colour) / distance.
    for material in bpy.data.materials if beer else []:
        for node in material.node_tree.nodes if material.node_tree else []:
            if node.type == "VOLUME_ABSORPTION":
                colour = node.inputs["Color"].default_value
                sigma = [-math.log(max(c, 1e-6)) for c in list(colour)[:3]]
                node.inputs["Density"].default_value *= max(sigma)
                node.inputs["Color"].default_value = [1 - s / max(sigma) for s in sigma] + [1]
    scene = bpy.context.scene
    scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
    data = scene.camera.data
    data.sensor_fit, data.sensor_height = "VERTICAL", 24.0
    data.lens = 12.0 / math.tan(YFOV / 2)
    world = scene.world or bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes.get("Background") or world.node_tree.nodes.new("ShaderNodeBackground")
    background.inputs[0].default_value, background.inputs[1].default_value = (SKY, SKY, SKY, 1), 1.0
    output = world.node_tree.nodes.get("World Output") or world.node_tree.nodes.new("ShaderNodeOutputWorld")
    world.node_tree.links.new(background.outputs[0], output.inputs[0])
    scene.render.engine = "CYCLES"
    c = scene.cycles
    c.device, c.samples, c.seed = "CPU", samples, 1
    c.use_denoising = c.use_adaptive_sampling = False
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = 12
    c.sample_clamp_direct = c.sample_clamp_indirect = c.blur_glossy = 0.0
    c.caustics_reflective = c.caustics_refractive = True
    c.pixel_filter_type, c.filter_width = "BOX", 1.0
    r = scene.render
    r.resolution_x, r.resolution_y, r.resolution_percentage = *SIZE, 100
    r.use_motion_blur = False
    i = r.image_settings
    i.file_format, i.color_mode, i.color_depth = "OPEN_EXR", "RGB", "32"
    r.use_file_extension, r.filepath = False, os.path.abspath(out)
    bpy.ops.render.render(write_still=True)


def ours(path, out, samples):
    tree = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "target", "release", "graeco")
    program = os.environ.get("GRAECO", tree)
    size = f"{SIZE[0]}x{SIZE[1]}"
    subprocess.run([program, "render", path, "-o", out, "--size", size, "--runs", str(samples), "--depth", "float", "--frames",
                    "0", "--bounces", "12", "--sure-bounces", "12", "--caustics", "exact", "--background", f"{SKY},{SKY},{SKY}", "--quiet"],
                   check=True)


def read(path):
    import numpy as np
    import OpenEXR

    with OpenEXR.File(path, separate_channels=True) as f:
        channels = f.channels()
        pick = lambda c: next(v.pixels for k, v in channels.items() if k == c or k.endswith("." + c))
        return np.stack([pick(c) for c in "RGB"], axis=-1).astype(np.float64)


def table(a, b):
    import numpy as np

    pictures = [read(p) @ [0.2126, 0.7152, 0.0722] for p in (a, b)]
    down = math.atan2(HEIGHT - RADIUS, DISTANCE)
    ys, xs = np.mgrid[0:SIZE[1], 0:SIZE[0]] + 0.5
    scale = math.tan(YFOV / 2) / (SIZE[1] / 2)
    x, y = (xs - SIZE[0] / 2) * scale, (SIZE[1] / 2 - ys) * scale
    rays = np.stack([x, y * math.cos(down) - math.sin(down), -y * math.sin(down) - math.cos(down)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    print("| ball | graeco | Cycles | ratio |\n|---|---|---|---|")
    for i, name in enumerate(NAMES):
        to = np.array(centre(i)) - [0, HEIGHT, DISTANCE]
        along = rays @ to
        # A pixel's width inside the rim, so that no pixel holds background.
        inside = np.sqrt(np.maximum(to @ to - along**2, 0)) < RADIUS - 1.5 * scale * DISTANCE
        means = [p[inside].mean() for p in pictures]
        print(f"| {name} | {means[0]:.4f} | {means[1]:.4f} | {means[0] / means[1]:.4f} |")


if __name__ == "__main__":
    what, rest = (sys.argv[1:2] or [""])[0], sys.argv[2:]
    if what == "make" and len(rest) == 1:
        make(*rest)
    elif what in ("cycles", "beer", "ours") and len(rest) in (2, 3):
        samples = int(rest[2]) if len(rest) == 3 else 1024
        ours(rest[0], rest[1], samples) if what == "ours" else cycles(rest[0], rest[1], samples, beer=what == "beer")
    elif what == "table" and len(rest) == 2:
        table(*rest)
    else:
        sys.exit(__doc__)
