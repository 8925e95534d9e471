#!/usr/bin/env python3
"""Times frames of two versions of the program in turn, and what OpenCV and OIDN take for the same pictures, writes
figures.csv beside this file, and prints a table in Markdown.

    pip install opencv-python-headless pyoidn numpy OpenEXR
    tests/versus/versus.py BEFORE/epigraph AFTER/epigraph

README.md says what is compared with what.
"""

import argparse
import csv
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCENES = ["cornell", "chains", "room"]
SIZES = [512, 2048]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="the program of the version before")
    parser.add_argument("after", type=Path, help="the program of this version")
    parser.add_argument("--graph", default="epi")
    parser.add_argument("--scene", action="append", help="may be repeated; default: " + ", ".join(SCENES))
    parser.add_argument("--size", action="append", type=int, help="pixels a side; may be repeated; default: 512 and 2048")
    parser.add_argument("--rounds", type=int, default=5, help="runs of each version for each picture")
    parser.add_argument("--frames", type=int, default=20, help="frames that a run measures")
    parser.add_argument("--cores", default="0,1", help="the cores that all programs are pinned to")
    args = parser.parse_args()

    cores = {int(core) for core in args.cores.split(",")}
    os.sched_setaffinity(0, cores)  # The programs started from here inherit it.
    rows = []
    for scene in args.scene or SCENES:
        for size in args.size or SIZES:
            row = {"graph": args.graph, "scene": scene, "size": size} | versions(args, scene, size, len(cores))
            row |= peers(args.after, scene, size, len(cores))
            print(json.dumps(row), flush=True)
            rows.append(row)
    with open(HERE / "figures.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(table(rows), end="")


def versions(args, scene, size, threads):
    """Median milliseconds of a frame without tracing: the medians of the rounds, and the median of their ratios."""
    times = []
    for number in range(args.rounds):
        # Either goes first in every other round, so that a drift of the clock does no harm.
        order = [args.before, args.after] if number % 2 == 0 else [args.after, args.before]
        round = {program: frame(program, args, scene, size, threads) for program in order}
        times.append((round[args.before], round[args.after]))
    before, after = zip(*times)
    ratios = [before / after for before, after in times]
    return {
        "before_ms": f"{statistics.median(before):.2f}",
        "after_ms": f"{statistics.median(after):.2f}",
        "ratio": f"{statistics.median(ratios):.2f}",
        "least_ratio": f"{min(ratios):.2f}",
        "most_ratio": f"{max(ratios):.2f}",
    }


def frame(program, args, scene, size, threads):
    command = [program, "bench", "--backend", "cpu", "--graph", args.graph, "--scene", scene, "--size", f"{size}x{size}"]
    command += ["--sweep", "none", "--frames", args.frames, "--threads", threads, "--json", "-"]
    ran = subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    (row,) = json.loads(ran.stdout)["rows"]
    return row["frame_ms"]


def peers(program, scene, size, threads):
    """Milliseconds that two filters take for the picture of one full frame."""
    import cv2
    import numpy as np
    import OpenEXR
    import pyoidn

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.exr"
        command = [program, "reference", "--scene", scene, "--size", f"{size}x{size}", "--spp", "1", "--mode", "direct"]
        subprocess.run([*command, "--out", file], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with OpenEXR.File(str(file)) as exr:
            channels = exr.channels()
            color = channels["RGB"].pixels if "RGB" in channels else np.dstack([channels[c].pixels for c in "RGB"])
    color = np.ascontiguousarray(color, dtype=np.float32)

    cv2.setNumThreads(threads)
    bilateral = best(lambda: cv2.bilateralFilter(color, 5, 0.1, 1.5))

    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.set_int("numThreads", threads)
    device.commit()
    filtered = np.empty_like(color)
    with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as filter:
        filter.set_image("color", color, pyoidn.OIDN_FORMAT_FLOAT3)
        filter.set_image("output", filtered, pyoidn.OIDN_FORMAT_FLOAT3)
        filter.set_bool("hdr", True)
        filter.commit()
        oidn = best(filter.execute)
    error = device.get_error()
    if error is not None:
        raise RuntimeError(error)
    return {"bilateral_ms": f"{bilateral:.2f}", "oidn_ms": f"{oidn:.1f}"}


def best(work):
    """Milliseconds of the fastest of nine calls."""
    times = []
    for _ in range(9):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times) * 1000


def table(rows):
    lines = ["| scene | size | before, ms | now, ms | ratio | OpenCV bilateral 5x5, ms | OIDN, ms |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        ratio = f"{row['ratio']} ({row['least_ratio']} to {row['most_ratio']})"
        size = f"{row['size']}x{row['size']}"
        cells = [row["scene"], size, row["before_ms"], row["after_ms"], ratio, row["bilateral_ms"], row["oidn_ms"]]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
