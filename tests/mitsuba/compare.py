#!/usr/bin/env python3
"""Compares the path tracer with Mitsuba 3 on five scenes, and writes figures.csv beside this file.

    pip install mitsuba numpy
    cargo build --release
    tests/mitsuba/compare.py [SCENE ...]

Each scene is written as a GLB for Epigraph and as meshes for Mitsuba, by the same code. Both trace paths of up to 8
bounces. The table has the ratio of the mean radiances, and of all blocks of 16x16 pixels the largest difference, in
standard deviations of what their noise explains (from four pictures with different seeds each).
"""

import csv
import json
import math
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

HERE = Path(__file__).resolve().parent
EPIGRAPH = HERE.parents[1] / "target/release/epigraph"
SIZE, BLOCK, SEEDS, BOUNCES = 64, 16, 4, 8


def quad(corner, u, v, repeat=1.0):
    corner, u, v = (np.array(p, float) for p in (corner, u, v))
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    positions = [corner, corner + u, corner + u + v, corner + v]
    uvs = [[0, repeat], [repeat, repeat], [repeat, 0], [0, 0]]
    return {"positions": positions, "normals": [normal] * 4, "uvs": uvs, "triangles": [[0, 1, 2], [0, 2, 3]]}


def sphere(centre, radius, columns=96, rows=48):
    positions, normals, uvs, triangles = [], [], [], []
    for j in range(rows + 1):
        for i in range(columns + 1):
            a, b = 2 * math.pi * i / columns, math.pi * j / rows
            n = np.array([math.sin(b) * math.sin(a), math.cos(b), math.sin(b) * math.cos(a)])
            positions.append(np.array(centre) + radius * n)
            normals.append(n)
            uvs.append([i / columns, j / rows])
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            b, c, d = a + 1, a + columns + 1, a + columns + 2
            triangles += ([[a, c, d]] if j < rows - 1 else []) + ([[a, d, b]] if j > 0 else [])
    return {"positions": positions, "normals": normals, "uvs": uvs, "triangles": triangles}


def checker():
    """Rows of sRGB texels, 32x32."""
    rng = np.random.default_rng(1)
    tiles = rng.integers(30, 230, (4, 4, 3))
    return np.kron(tiles, np.ones((8, 8, 1), int)).astype(np.uint8)


def png(texels):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = texels.shape
    raw = b"".join(b"\0" + row.tobytes() for row in texels)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


DIFFUSE = {"extensions": {"KHR_materials_specular": {"specularFactor": 0}}}
GREY = {"color": [0.7, 0.7, 0.7]}
ROOM = [
    (quad([-2, 0, 2], [4, 0, 0], [0, 0, -4], 3), {"texture": True}),
    (quad([-2, 0, -2], [4, 0, 0], [0, 3, 0]), {"color": [0.6, 0.65, 0.7]}),
    (quad([-2, 0, 2], [0, 0, -4], [0, 3, 0]), {"color": [0.7, 0.3, 0.2]}),
]
LAMP = (quad([-0.5, 2.9, -0.5], [1, 0, 0], [0, 0, 1]), {"emission": [12, 11, 9]})


def small_lights():
    rng = np.random.default_rng(7)
    lights = []
    for _ in range(300):
        at = rng.uniform([-1.8, 1.6, -1.8], [1.8, 2.8, 1.8])
        side = rng.uniform(0.01, 0.03)
        lights.append((quad(at, [side, 0, 0], [0, 0, side]), {"emission": list(rng.uniform(20, 300, 3))}))
    return lights


SCENES = {
    "textures": (ROOM + [(sphere([0, 0.6, 0], 0.6), {"texture": True}), LAMP], 256),
    "metal": (
        ROOM
        + [
            (sphere([-0.7, 0.6, 0], 0.6), {"color": [1.0, 0.77, 0.34], "metal": 0.1}),
            (sphere([0.7, 0.6, 0.2], 0.6), {"color": [0.7, 0.7, 0.72], "metal": 0.0}),
            LAMP,
        ],
        512,
    ),
    "glass": (ROOM + [(sphere([0, 0.7, 0], 0.6), {"glass": 1.5}), LAMP], 1024),
    "environment": (
        ROOM[:1]
        + [
            (sphere([-0.7, 0.6, 0], 0.6), GREY),
            (sphere([0.7, 0.6, 0], 0.6), {"color": [0.9, 0.6, 0.5], "metal": 0.1}),
        ],
        512,
    ),
    "small lights": (ROOM + [(sphere([0, 0.6, 0], 0.6), GREY)] + small_lights(), 512),
}
EYE, TARGET, FOV = [0.4, 1.6, 4.6], [0, 0.9, 0], 40.0


def sky():
    """Longitudes and latitudes: a gradient, and a sun of some texels."""
    # Mitsuba puts the first and last rows on the poles, Epigraph half a row beside them: with many rows, it matters little.
    rows, columns = 512, 1024
    y, x = np.mgrid[0:rows, 0:columns]
    image = np.stack([0.3 + 0.3 * y / rows, 0.4 + 0.2 * x / columns, 0.8 - 0.4 * y / rows], -1)
    image[112:136, 640:664] += 60.0
    return image.astype(np.float32)


def write_glb(path, parts):
    views, accessors, binary = [], [], bytearray()

    def view(data):
        while len(binary) % 4:
            binary.append(0)
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary.extend(data)
        return len(views) - 1

    def accessor(values, kind):
        array = np.array(values, np.uint32 if kind == "SCALAR" else np.float32)
        entry = {"bufferView": view(array.tobytes()), "componentType": 5125 if kind == "SCALAR" else 5126}
        entry |= {"count": array.size if kind == "SCALAR" else len(array), "type": kind}
        if kind == "VEC3":
            entry |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        accessors.append(entry)
        return len(accessors) - 1

    meshes, materials = [], []
    for shape, look in parts:
        pbr = {"baseColorFactor": look.get("color", [1, 1, 1] if "texture" in look else [0, 0, 0]) + [1]}
        pbr |= {"metallicFactor": 1 if "metal" in look else 0, "roughnessFactor": look.get("metal", 1)}
        if "texture" in look:
            pbr["baseColorTexture"] = {"index": 0}
        material = {"pbrMetallicRoughness": pbr, "extensions": {}}
        if "glass" in look:
            pbr |= {"baseColorFactor": [1, 1, 1, 1], "roughnessFactor": 0}
            material["extensions"] = {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1},
                "KHR_materials_ior": {"ior": look["glass"]},
            }
        elif "metal" not in look:
            # Lambertian, as Mitsuba's.
            material |= DIFFUSE
        if "emission" in look:
            strength = max(look["emission"])
            material["emissiveFactor"] = [channel / strength for channel in look["emission"]]
            material["extensions"] = material["extensions"] | {
                "KHR_materials_emissive_strength": {"emissiveStrength": strength}
            }
        materials.append(material)
        attributes = {
            "POSITION": accessor(shape["positions"], "VEC3"),
            "NORMAL": accessor(shape["normals"], "VEC3"),
            "TEXCOORD_0": accessor(shape["uvs"], "VEC2"),
        }
        indices = accessor(np.array(shape["triangles"]).ravel(), "SCALAR")
        primitive = {"attributes": attributes, "indices": indices, "material": len(materials) - 1}
        meshes.append({"primitives": [primitive]})
    image = view(png(checker()))
    used = sorted({name for material in materials for name in material["extensions"]})
    root = {
        "asset": {"version": "2.0"},
        "extensionsUsed": used,
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"mesh": index} for index in range(len(meshes))],
        "meshes": meshes,
        "materials": materials,
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9729}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    total = 28 + len(text) + len(binary)
    header = struct.pack("<4sII", b"glTF", 2, total)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    Path(path).write_bytes(header + chunks)


def mitsuba_scene(parts, folder, environment):
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": BOUNCES + 2, "rr_depth": 100}}
    transform = mi.ScalarTransform4f().look_at(origin=EYE, target=TARGET, up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    scene["sensor"] = {"type": "perspective", "fov": FOV, "fov_axis": "y", "to_world": transform, "film": film}
    (folder / "checker.png").write_bytes(png(checker()))
    for index, (shape, look) in enumerate(parts):
        mesh = mi.Mesh("part", len(shape["positions"]), len(shape["triangles"]), has_vertex_normals=True, has_vertex_texcoords=True)
        params = mi.traverse(mesh)
        params["vertex_positions"] = np.array(shape["positions"], np.float32).ravel()
        params["vertex_normals"] = np.array(shape["normals"], np.float32).ravel()
        params["vertex_texcoords"] = np.array(shape["uvs"], np.float32).ravel()
        params["faces"] = np.array(shape["triangles"], np.uint32).ravel()
        params.update()
        path = folder / f"part{index}.ply"
        mesh.write_ply(str(path))
        if "texture" in look:
            bitmap = {"type": "bitmap", "filename": str(folder / "checker.png"), "wrap_mode": "repeat"}
            bsdf = {"type": "diffuse", "reflectance": bitmap}
        elif "glass" in look:
            bsdf = {"type": "dielectric", "int_ior": look["glass"], "ext_ior": 1.0}
        elif "metal" in look:
            color = {"type": "rgb", "value": look["color"]}
            bsdf = {"type": "principled", "base_color": color, "metallic": 1.0, "roughness": max(look["metal"], 0.01)}
        else:
            bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": look.get("color", [0, 0, 0])}}
        if "glass" not in look:
            bsdf = {"type": "twosided", "bsdf": bsdf}
        part = {"type": "ply", "filename": str(path), "bsdf": bsdf}
        if "emission" in look:
            part["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": look["emission"]}}
        scene[f"part{index}"] = part
    if environment:
        bitmap = mi.Bitmap(sky())
        bitmap.write(str(folder / "sky.exr"))
        # Mitsuba sees the middle of the image towards +z, Epigraph towards -z.
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        scene["sky"] = {"type": "envmap", "filename": str(folder / "sky.exr"), "to_world": turn}
    return mi.load_dict(scene)


def of_epigraph(folder, environment, paths, seed):
    out = folder / "epigraph.exr"
    command = [EPIGRAPH, "reference", "--scene", folder / "scene.ron", "--camera", "still", "--size", f"{SIZE}x{SIZE}"]
    command += ["--spp", str(paths), "--mode", "path", "--seed", str(seed), "--out", out]
    command += ["--sky", folder / "sky.exr"] if environment else []
    subprocess.run(command, check=True, capture_output=True)
    return np.array(mi.Bitmap(str(out)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))


def compare(name):
    parts, paths = SCENES[name]
    environment = name == "environment"
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_glb(folder / "scene.glb", parts)
        camera = f"(eye: ({EYE[0]}, {EYE[1]}, {EYE[2]}), target: ({TARGET[0]}, {TARGET[1]}, {TARGET[2]}), fov: {FOV})"
        objects = 'objects: [(shape: File("scene.glb"))]'
        (folder / "scene.ron").write_text(f"#![enable(implicit_some)]\nScene(version: 1, camera: {camera}, {objects})")
        scene = mitsuba_scene(parts, folder, environment)
        theirs = [np.array(mi.render(scene, spp=paths, seed=seed)) for seed in range(SEEDS)]
        ours = [of_epigraph(folder, environment, paths, seed) for seed in range(SEEDS)]

    def blocks(image):
        count = SIZE // BLOCK
        return image.mean(-1).reshape(count, BLOCK, count, BLOCK).mean((1, 3))

    ours, theirs = (np.array([blocks(image) for image in images]) for images in (ours, theirs))
    ratio = ours.mean() / theirs.mean()
    noise = np.sqrt((ours.var(0, ddof=1) + theirs.var(0, ddof=1)) / SEEDS)
    # Four pictures tell a block's noise badly: that of all blocks of the same brightness is a better measure.
    floor = np.median(noise / theirs.mean(0)) * theirs.mean(0)
    worst = np.abs(ours.mean(0) - theirs.mean(0)) / np.maximum(noise, floor)
    share = np.abs(ours.mean(0) / theirs.mean(0) - 1).max()
    return [name, paths * SEEDS, f"{theirs.mean():.5f}", f"{ours.mean():.5f}", f"{ratio:.5f}", f"{100 * share:.2f}", f"{worst.max():.1f}"]


def main():
    rows = []
    header = ["scene", "paths", "Mitsuba", "Epigraph", "ratio", "worst block %", "worst block deviations"]
    print(*header, sep=", ")
    for name in sys.argv[1:] or SCENES:
        rows.append(compare(name))
        print(*rows[-1], sep=", ", flush=True)
    if not sys.argv[1:]:
        with open(HERE / "figures.csv", "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([header] + rows)


if __name__ == "__main__":
    main()
