#!/usr/bin/env python3
"""First results: what a small job takes from start to end with warm caches, beside a bare program that opens the device.

bench_start.py BUILD_FOLDER REPETITIONS prints one JSON object: medians in seconds, and the parts of a 3840x2160 combine.
"""
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

SCENE = Path("tests/data/cycles/volume")
WIDTH, HEIGHT = 3840, 2160


def seconds(command):
    start = time.perf_counter()
    out = subprocess.run(command, check=True, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL).stdout
    return time.perf_counter() - start, out


def combine(build, folder):
    """Two batches of the images in the folder."""
    files = {name: [str(folder / f"{name}_00{k}.exr") for k in range(2)] for name in "mt"}
    return [str(build / "clratio"), "combine", "--m", *files["m"], "--t", *files["t"], "--tau", str(folder / "t_ref.exr"),
            "-o", str(build / "bench_out.exr"), "--json"]


def medians_in_turn(commands, repetitions):
    """The commands take turns, so that what else the machine does falls on all of them."""
    times = {name: [] for name in commands}
    for command in commands.values():
        seconds(command)
    for _ in range(repetitions):
        for name, command in commands.items():
            times[name].append(seconds(command)[0])
    return {name: statistics.median(t) for name, t in times.items()}


def tiled(build):
    folder = build / "bench_images"
    folder.mkdir(exist_ok=True)
    for name in ("m_000", "m_001", "t_000", "t_001", "t_ref"):
        image = folder / f"{name}.exr"
        if not image.exists():
            seconds([str(build / "tile_image"), str(SCENE / image.name), str(image), str(WIDTH), str(HEIGHT)])
    return folder


def large_combine(build, repetitions):
    """Medians of the command's own clock readings and of its whole time. `decode` is summed over the reading threads."""
    command = combine(build, tiled(build))
    seconds(command)
    runs = []
    for _ in range(repetitions):
        total, out = seconds(command)
        runs.append({**json.loads(out)["seconds"], "total": total})
    return {part: statistics.median(run[part] for run in runs) for part in runs[0]}


def main():
    build, repetitions = Path(sys.argv[1]).resolve(), int(sys.argv[2])
    small = medians_in_turn({"bare": [str(build / "bare_list")], "devices": [str(build / "clratio"), "devices"],
                             "combine": combine(build, SCENE)}, repetitions)
    print(json.dumps({**small, "large_combine": large_combine(build, max(1, repetitions // 4))}))


if __name__ == "__main__":
    main()
