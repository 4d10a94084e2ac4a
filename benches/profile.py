#!/usr/bin/env python3
"""Shares of processor time by what a renderer's code does.

    cargo build --profile quick
    python benches/profile.py target/quick/graeco render animations/pool.glb --frames 10 --size 240x135 \
        --bounces 4 --runs 32 --threads 1 -o pool.exr

Runs the command under `perf record` (Debian: linux-perf) and attributes each sample to the innermost function of ours,
inlined ones included. Needs debug information, which the profile `quick` has.
"""

import collections
import os
import subprocess
import sys
import tempfile

# Part of a function's path, and what it does.
ROOMS = [
    ("texture", "textures"),
    ("bsdf", "scattering functions"),
    ("sheen", "scattering functions"),
    ("warp", "scattering functions"),
    ("lights", "choosing and sampling light"),
    ("environment", "choosing and sampling light"),
    ("accel", "traversal"),
    ("surface", "hit points"),
    ("design", "design points"),
    ("film", "film"),
]


def room(symbols):
    """What the innermost of `symbols` that is ours does."""
    ours = (symbol for symbol in symbols if "graeco" in symbol)
    return next((does for symbol in ours for part, does in ROOMS if "::" + part in symbol), "the rest")


def main():
    command = sys.argv[1:]
    if not command:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        data = os.path.join(folder, "perf.data")
        record = ["perf", "record", "-q", "-e", "cpu-clock", "-F", "299", "--call-graph", "dwarf,4096", "-o", data]
        subprocess.run(record + ["--"] + command, check=True)
        script = ["perf", "script", "-i", data, "-F", "comm,ip,sym"]
        stacks = subprocess.run(script, check=True, capture_output=True, text=True).stdout.split("\n\n")
    counts = collections.Counter()
    for stack in stacks:
        # The first line names the process; the others hold an address and a symbol each.
        symbols = [line.split(None, 1)[1] for line in stack.strip().split("\n")[1:] if len(line.split(None, 1)) > 1]
        if symbols:
            counts[room(symbols)] += 1
    total = sum(counts.values())
    for does, count in counts.most_common():
        print(f"{100 * count / total:5.1f} %  {does}")
    print(f"{total} samples")


if __name__ == "__main__":
    main()
