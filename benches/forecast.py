#!/usr/bin/env python3
"""How near `graeco plan` comes to the seconds that a frame really takes.

    cargo build --profile quick
    python benches/forecast.py target/quick/graeco animations/*.glb --frame 12 -- --size 480x270 --runs 64

Asks for the plan of one frame of each scene, renders that frame, and prints the forecast over the real time (building
included, reading and writing files not). What follows `--` goes to both.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile


def planned(program, scene, frame, options):
    """Seconds that the plan expects of `frame`."""
    command = [program, "plan", scene, "--frame", str(frame), "--json", *options]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["estimate"]["frame_s"]


def real(program, scene, frame, options, folder):
    """Seconds that building and rendering `frame` took."""
    stats = os.path.join(folder, "stats.jsonl")
    picture = os.path.join(folder, "frame.exr")
    command = [program, "render", scene, "--frames", str(frame), *options, "--stats", stats, "-o", picture]
    subprocess.run(command, check=True, capture_output=True)
    with open(stats, encoding="utf-8") as lines:
        last = json.loads(lines.readlines()[-1])
    return last["build_s"] + last["render_s"]


def main():
    own, options = sys.argv[1:], []
    if "--" in own:
        own, options = own[: own.index("--")], own[own.index("--") + 1 :]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--frame", type=int, default=12)
    arguments = parser.parse_args(own)
    ratios = []
    print("| scene | forecast s | real s | ratio |\n|-|-|-|-|")
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes:
            forecast = planned(arguments.program, scene, arguments.frame, options)
            took = real(arguments.program, scene, arguments.frame, options, folder)
            ratios.append(forecast / took)
            print(f"| {os.path.basename(scene)} | {forecast:.2f} | {took:.2f} | {ratios[-1]:.3f} |", flush=True)
    print(f"\nmedian {statistics.median(ratios):.3f}, {min(ratios):.3f} to {max(ratios):.3f}")


if __name__ == "__main__":
    main()
