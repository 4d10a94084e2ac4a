#!/usr/bin/env python3
"""Seconds that renderers take to a given error, on the project's animations.

    python seconds.py measure SCRIPT RESULTS.jsonl [--scenes pool,fan] [--modes direct,b4] [--runs 16,64,256] [--seeds 2]
    python seconds.py table OURS.jsonl THEIRS.jsonl

SCRIPT is a renderer's NAME_render.py (see README.md). `measure` appends one line for each number of runs: processor
seconds over cores, and relMSE, the mean over pixels and channels of squared error / (value^2 + 0.01). The squared error
is half the mean squared difference of two pictures of the same number of runs and seeds of their own, which is exactly
the variance of either; the value is the mean of all pictures. So each renderer is held against itself and no reference
has to be rendered. `table` reads the runs to 1e-3 and to 1e-4 off the straight line through the measured points in both
logarithms, and marks with ~ what lies beyond them: there the seconds are those of the nearest point, in proportion to
the runs. (Seconds wander where errors do not: a line through two of them would be extrapolated with their noise.)

Needs numpy and OpenEXR. Frame and exposure are chosen below; the lens is read from the file.
"""

import argparse
import itertools
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

from graeco_render import document

HERE = os.path.dirname(os.path.realpath(__file__))
FILES = os.path.join(HERE, "..", "..", "animations")
# Frame, and exposure in frames.
SHOTS = {"blur_row": (12, 0.5), "fan": (16, 0.5), "field": (12, 0.25), "forest": (8, 0.5), "mirror": (10, 0.5),
         "newton": (14, 0.5), "pool": (10, 1.0), "walker": (9, 0.5)}
TARGETS = (1e-3, 1e-4)


def lens(path):
    """Aperture radius and focus distance in metres of the file's first camera, an f-stop counting on a frame 24 mm high."""
    camera = document(path)["cameras"][0]
    extras = camera.get("extras", {})
    radius = extras.get("aperture_radius", 0.0)
    if "f_stop" in extras:
        radius = 0.012 / math.tan(camera["perspective"]["yfov"] / 2) / (2 * extras["f_stop"])
    return radius, extras.get("focus_distance", 1.0)


def picture(path):
    with OpenEXR.File(path) as file:
        channels = file.channels()
        for name in ("RGB", "RGBA"):
            if name in channels:
                return np.asarray(channels[name].pixels, np.float64)[..., :3]
        return np.stack([np.asarray(channels[c].pixels, np.float64) for c in "RGB"], -1)


def rendered(o, scene, mode, folder):
    """Pictures and processor seconds by number of runs."""
    path = os.path.join(FILES, scene + ".glb")
    frame, shutter = SHOTS[scene]
    radius, focus = lens(path)
    seeds = "+".join(str(1 + s) for s in range(o.seeds))
    command = [o.python, o.script, path, os.path.join(folder, "picture"), "--res", o.res, "--mode", mode,
               "--jobs", ",".join("%s:%s" % (r, seeds) for r in o.runs.split(",")), "--frame", str(frame),
               "--shutter", repr(shutter), "--fps", "24", "--aperture-radius", repr(radius),
               "--focus-distance", repr(focus)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    results = [json.loads(line[line.index("RESULT ") + 7:]) for line in done.stdout.splitlines() if "RESULT {" in line]
    by_runs = {}
    for r in results:
        by_runs.setdefault(r["spp"], []).append((picture(r["out"]), r["cpu_s"]))
    return by_runs


def measure(o):
    for scene, mode in itertools.product(o.scenes.split(",") if o.scenes else sorted(SHOTS), o.modes.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            by_runs = rendered(o, scene, mode, folder)
        weights = sum(runs * len(all_) for runs, all_ in by_runs.items())
        value = sum(runs * sum(p for p, _ in all_) for runs, all_ in by_runs.items()) / weights
        for runs, all_ in sorted(by_runs.items()):
            squares = [(a - b) ** 2 / 2 for (a, _), (b, _) in itertools.combinations(all_, 2)]
            row = dict(scene=scene, mode=mode, runs=runs, relmse=float(np.mean(squares / (value ** 2 + 0.01))),
                       seconds=statistics.median(s for _, s in all_) / os.cpu_count())
            with open(o.results, "a") as file:
                file.write(json.dumps(row) + "\n")
            print(json.dumps(row), flush=True)


def lines(path):
    """By scene and mode: seconds to each target, whether they are extrapolated, and the slope of relMSE over runs."""
    points = {}
    with open(path) as file:
        for row in map(json.loads, file):
            points.setdefault((row["scene"], row["mode"]), {})[row["runs"]] = (row["seconds"], row["relmse"])
    found = {}
    for key, by_runs in points.items():
        runs = sorted(by_runs)
        seconds, errors = np.log([by_runs[r] for r in runs]).T
        slope, _ = np.polyfit(np.log(runs), errors, 1)
        found[key] = ([reach(np.log(runs), seconds, errors, math.log(t)) for t in TARGETS], slope)
    return found


def reach(runs, seconds, errors, target):
    """Seconds to `target`, and whether it is beyond all points; all in logarithms."""
    at = next((i for i in range(len(errors) - 1) if errors[i + 1] <= target), len(errors) - 2)
    share = (errors[at] - target) / (errors[at] - errors[at + 1])
    if 0 <= share <= 1:
        return math.exp(seconds[at] + share * (seconds[at + 1] - seconds[at])), False
    nearest = at + 1 if share > 1 else at
    beyond = (share - (nearest - at)) * (runs[at + 1] - runs[at])
    return math.exp(seconds[nearest] + beyond), True


def table(o):
    ours, theirs = lines(o.ours), lines(o.theirs)
    print("| animation | mode | ours to 1e-3 | theirs | ratio | ours to 1e-4 | theirs | ratio | slopes |")
    print("|---|---|---|---|---|---|---|---|---|")
    ratios = {}
    for key in sorted(set(ours) & set(theirs), key=lambda k: (k[1] != "direct", k)):
        cells = []
        for i, _ in enumerate(TARGETS):
            pair = ours[key][0][i], theirs[key][0][i]
            cells += ["%s%.2f" % ("~" * beyond, s) for s, beyond in pair] + ["%.1f" % (pair[1][0] / pair[0][0])]
            ratios.setdefault((key[1], i), []).append(pair[1][0] / pair[0][0])
        print("| %s | %s | %s | %.2f, %.2f |" % (*key, " | ".join(cells), ours[key][1], theirs[key][1]))
    for (mode, i), values in ratios.items():
        print("median, %s, to %g: %.1f" % (mode, TARGETS[i], statistics.median(values)))


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = a.add_subparsers(required=True)
    m = commands.add_parser("measure")
    m.add_argument("script")
    m.add_argument("results")
    m.add_argument("--scenes", default="")
    m.add_argument("--modes", default="direct,b4")
    m.add_argument("--runs", default="16,64,256")
    m.add_argument("--seeds", type=int, default=2)
    m.add_argument("--res", default="240x135")
    m.add_argument("--python", default=sys.executable)
    m.set_defaults(do=measure)
    t = commands.add_parser("table")
    t.add_argument("ours")
    t.add_argument("theirs")
    t.set_defaults(do=table)
    o = a.parse_args()
    o.do(o)


if __name__ == "__main__":
    main()
