#!/usr/bin/env python3
"""Denoises frames of a few light paths with Intel's Open Image Denoise, compares them with the references of
`epigraph quality`, and writes figures.csv beside this file.

    pip install pyoidn numpy OpenEXR
    cargo build --release
    epigraph quality ... --scene SCENE --camera CAMERA --size 256x256 --keep KEEP/SCENE-CAMERA
    tests/oidn/denoise.py KEEP [SCENE-CAMERA ...]

README.md says what is compared with what.
"""

import argparse
import csv
import json
import math
import subprocess
import tempfile
import time
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pyoidn

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SIZE = 256
BUDGETS = [0.05, 0.1, 0.25, 0.5, 1, 4]
# Light paths for each pixel that is denoised.
PATHS = [1, 2, 4, 16]
# Smaller images have few pixels on small things, however clean they are.
SMALLEST = 57
# Rays along each side of a pixel for the auxiliary images.
RAYS = 4
# Compared frames of a moving and of a still camera.
MOVING, STILL = [29], [39]
THREADS = 2
# Times are the best of so many runs.
RUNS = 5
SEED = 7
# The code of the background's normal.
NO_NORMAL = 0x80008000


def read(path):
    """The channels of an EXR file, without alpha."""
    pixels = next(iter(OpenEXR.File(str(path)).channels().values())).pixels
    return pixels[..., :3] if pixels.ndim == 3 else pixels[..., None]


def unpack(bits):
    """Normals from the code of `shaders/shared/octahedral.wgsl`."""
    x, y = (part.astype(np.int16) / np.float32(32767) for part in (bits & 0xFFFF, bits >> 16))
    z = 1 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0)
    normal = np.concatenate([x + np.where(x < 0, fold, -fold), y + np.where(y < 0, fold, -fold), z], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.where(bits == NO_NORMAL, 0, normal)


def displayed(linear):
    """8-bit sRGB values."""
    linear = np.clip(linear, 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * srgb).astype(np.uint8)


def write(path, picture):
    def chunk(kind, data):
        body = kind + data
        return len(data).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")

    height, width, _ = picture.shape
    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)


class Denoiser:
    """OIDN's filter for ray-traced pictures: HDR colours, with albedo and normals that have no noise."""

    def __init__(self):
        self.device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
        self.device.set_int("numThreads", THREADS)
        self.device.commit()

    def run(self, color, albedo, normal):
        """The denoised picture, and the milliseconds of the filter."""
        images = {"color": color, "albedo": albedo, "normal": normal, "output": np.zeros_like(color)}
        images = {name: np.ascontiguousarray(image, np.float32) for name, image in images.items()}
        best = math.inf
        with pyoidn.Filter(self.device, pyoidn.OIDN_FILTER_TYPE_RT) as filter:
            for name, image in images.items():
                filter.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
            filter.set_bool("hdr", True)
            filter.set_bool("cleanAux", True)
            filter.set_quality(pyoidn.OIDN_QUALITY_HIGH)
            filter.commit()
            for _ in range(RUNS):
                start = time.perf_counter()
                filter.execute()
                best = min(best, time.perf_counter() - start)
        error = self.device.get_error()
        if error is not None:
            raise RuntimeError(error)
        return images["output"], 1000 * best


def shares(small, large):
    """For each pixel of a small row the shares of it that pixels of a large one cover."""
    edges = np.linspace(0, large, small + 1)
    pixel = np.arange(large)
    overlap = np.minimum(edges[1:, None], pixel + 1) - np.maximum(edges[:-1, None], pixel)
    return np.maximum(overlap, 0) * small / large


def shrink(image, side):
    """The mean of an image over each pixel of a smaller one."""
    weights = shares(side, image.shape[0])
    return np.einsum("iy,jx,yxc->ijc", weights, weights, image, optimize=True)


def bilinear(image, side):
    at = (np.arange(side) + 0.5) * image.shape[0] / side - 0.5
    first = np.clip(np.floor(at).astype(int), 0, image.shape[0] - 1)
    last = np.minimum(first + 1, image.shape[0] - 1)
    part = np.clip(at - first, 0, 1)
    rows = image[first] * (1 - part)[:, None, None] + image[last] * part[:, None, None]
    return rows[:, first] * (1 - part)[None, :, None] + rows[:, last] * part[None, :, None]


class Surfaces:
    """The G-buffer of a frame: the mean over each pixel of a grid of rays."""

    def __init__(self, depth, normal, albedo, emission):
        self.depth, self.normal, self.albedo, self.emission = depth, normal, albedo, emission

    def at(self, side):
        return Surfaces(*(shrink(image, side) for image in (self.depth, self.normal, self.albedo, self.emission)))

    def tint(self):
        """What OIDN gets as albedo. Lamps scatter no light, but have outlines."""
        return np.clip(self.albedo + self.emission, 0, 1)

    def scale(self):
        """What light is divided by before it is enlarged."""
        background = 1 - np.linalg.norm(self.normal, axis=-1, keepdims=True).clip(0, 1)
        return np.maximum(self.albedo + self.emission, 0.01) + background


def joint(image, few, many, sigma=0.7, nearness=0.03, facing=8, tint=0.1):
    """Joint bilateral upsampling to twice the pixels of the picture on each side, and their means."""
    small, side = image.shape[0], many.depth.shape[0]
    light = image / few.scale()
    at = (np.arange(side) + 0.5) * small / side
    total, weights = np.zeros((side, side, 3)), np.zeros((side, side, 1))
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            y, x = np.floor(at).astype(int) + dy, np.floor(at).astype(int) + dx
            inside = ((y >= 0) & (y < small))[:, None] & ((x >= 0) & (x < small))[None, :]
            apart = ((y + 0.5 - at) ** 2)[:, None] + ((x + 0.5 - at) ** 2)[None, :]
            y, x = np.clip(y, 0, small - 1)[:, None], np.clip(x, 0, small - 1)[None, :]
            step = (few.depth[y, x, 0] / many.depth[..., 0] - 1) / nearness
            looks = ((few.tint()[y, x] - many.tint()) ** 2).sum(-1) / tint**2
            turn = np.clip((few.normal[y, x] * many.normal).sum(-1), 0, 1)
            # The background has no normal.
            turn = np.where((many.normal == 0).all(-1), 1, turn)
            alike = np.exp(-0.5 * (np.minimum(step**2, 100) + looks)) * turn**facing
            weight = np.exp(-0.5 * apart / sigma**2) * np.maximum(alike, 1e-6) * inside
            total += weight[..., None] * light[y, x]
            weights += weight[..., None]
    return shrink(total / weights * many.scale(), SIZE)


class View:
    """A scene and a camera path, with the references that `quality` has kept."""

    def __init__(self, program, keep, name):
        self.program, self.name = program, name
        self.scene, self.camera = name.rsplit("-", 1)
        self.references = {}
        for facts in (keep / name / "references").glob("*.json"):
            about = json.loads(facts.read_text())
            if about["mode"] == "path" and about["size"] == [SIZE, SIZE]:
                known = self.references.get(about["frame"])
                if known is None or known[0] < about["spp"]:
                    self.references[about["frame"]] = (about["spp"], facts.with_suffix(".exr"))
        if not self.references:
            raise SystemExit(f"{keep / name} has no references of paths at {SIZE}x{SIZE} pixels")

    def reference(self, frame):
        # Where nothing moves there is one for all frames.
        alone = next(iter(self.references.values()))
        return self.references.get(frame, alone)[1]

    def epigraph(self, *words):
        command = [self.program, *map(str, words)]
        return subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout

    def place(self, side):
        return "--scene", self.scene, "--camera", self.camera, "--size", f"{side}x{side}"

    def surfaces(self, folder, frame):
        ports = ["depth", "normal", "albedo", "emission"]
        saves = [word for port in ports for word in ("--save", f"gbuffer.{port}={folder / port}.exr")]
        graph = "graphs/experiments/gbuffer.ron"
        out = "--out", folder / "lamp.png", "--backend", "cpu"
        self.epigraph("render", graph, *self.place(RAYS * SIZE), "--frames", frame + 1, *saves, *out)
        depth, normal, albedo, emission = (read(folder / f"{port}.exr") for port in ports)
        return Surfaces(depth, unpack(normal), albedo, emission)

    def traced(self, folder, frame, side, paths):
        out = folder / "traced.exr"
        mode = "--mode", "path", "--seed", SEED + frame
        self.epigraph("reference", *self.place(side), "--frame", frame, "--spp", paths, *mode, "--out", out)
        return read(out)

    def edges(self, folder, frame):
        out, edges = folder / "one.png", folder / "edges.png"
        self.epigraph("reference", *self.place(SIZE), "--frame", frame, "--spp", 1, "--edges", edges, "--out", out)
        return edges

    def compare(self, folder, frame, picture, edges):
        path = folder / "picture.png"
        write(path, picture)
        return json.loads(self.epigraph("compare", self.reference(frame), path, "--mask", edges, "--json", "-"))


def ways():
    """Each budget with the paths for each pixel and the side of the image that is denoised."""
    for budget in BUDGETS:
        for paths in PATHS:
            side = round(SIZE * math.sqrt(budget / paths))
            if SMALLEST <= side <= SIZE:
                yield budget, paths, side


def pictures(view, denoiser, folder, frame):
    """The pictures of a frame by all ways, as displayed, with the milliseconds of the filter."""
    fine = view.surfaces(folder, frame)
    many = fine.at(2 * SIZE)
    found = {}
    for budget, paths, side in ways():
        few = fine.at(side)
        clean, ms = denoiser.run(view.traced(folder, frame, side, paths), few.tint(), few.normal)
        if side == SIZE:
            found["full", budget, paths, side] = displayed(clean), ms
        else:
            found["bilinear", budget, paths, side] = displayed(bilinear(clean, SIZE)), ms
            found["joint", budget, paths, side] = displayed(joint(clean, few, many)), ms
    return found


def flicker(references, pair):
    """As `quality` has it: the change over the pixels whose reference changes by at most 1/255."""
    before, now = (displayed(read(path)).astype(int) for path in references)
    static = (np.abs(before - now) <= 1).all(-1)
    before, now = (picture[static] / 255 for picture in pair)
    return math.sqrt(((before - now) ** 2).mean()) if static.any() else math.nan


def measure(view, denoiser, show):
    rows = {}
    moves = view.camera != "still"
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for frame in MOVING if moves else STILL:
            before, now = (pictures(view, denoiser, folder, at) for at in (frame - 1, frame))
            edges = view.edges(folder, frame)
            references = view.reference(frame - 1), view.reference(frame)
            for way, (picture, ms) in now.items():
                error = view.compare(folder, frame, picture, edges)
                near = error["mask"]
                changes = flicker(references, (before[way][0], picture))
                figures = error["psnr"], error["flip"], near["psnr"], near["flip"], changes, ms
                rows.setdefault(way, []).append(figures)
                if show:
                    method, budget, paths, side = way
                    write(show / f"{view.name}-{frame}-{method}-{budget}-{paths}.png", picture)
    for (method, budget, paths, side), figures in rows.items():
        psnr, flip, edge_psnr, edge_flip, changes, ms = np.mean(figures, 0)
        places = f"{psnr:.2f}", f"{flip:.4f}", f"{edge_psnr:.2f}", f"{edge_flip:.4f}", f"{changes:.4f}", f"{ms:.0f}"
        traced = f"{paths * side**2 / SIZE**2:.4f}"
        yield [view.scene, view.camera, method, budget, traced, paths, side, *places]


HEADER = ["scene", "camera", "method", "budget", "paths a pixel", "paths a sample", "side"]
HEADER += ["psnr", "flip", "edge psnr", "edge flip", "flicker", "ms"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("keep", type=Path, help="folder with a folder of `quality --keep` for each view")
    parser.add_argument("views", nargs="*", metavar="SCENE-CAMERA", help="[default: all folders]")
    parser.add_argument("--epigraph", type=Path, default=ROOT / "target/release/epigraph")
    parser.add_argument("--out", type=Path, default=HERE / "figures.csv")
    parser.add_argument("--show", type=Path, help="folder for the pictures")
    args = parser.parse_args()
    names = args.views or sorted(path.parent.name for path in args.keep.glob("*/references"))
    denoiser = Denoiser()
    if args.show:
        args.show.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        for row in measure(View(args.epigraph.resolve(), args.keep.resolve(), name), denoiser, args.show):
            rows.append(row)
            print(*row, sep=", ", flush=True)
    with open(args.out, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEADER] + rows)


if __name__ == "__main__":
    main()
