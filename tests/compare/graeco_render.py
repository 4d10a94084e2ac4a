#!/usr/bin/env python3
"""Render a .glb with graeco, speaking the protocol of a comparison of renderers.

    python graeco_render.py scene.glb OUT_PREFIX --jobs spp:seed+seed,spp:seed,... --res WxH --mode direct|b4

Prints one line "RESULT {json}" for every picture, a float EXR named OUT_PREFIX_s<spp>_seed<seed>.exr:

    wall_s    building, sampling and writing, on the wall's clock; loading is left out, as an import would be
    cpu_s     processor seconds of the same, all threads
    sync_s    building acceleration structures and light choice
    render_s  sampling

The instant and the lens are taken from custom properties of the camera's node, or of the camera: shutter_open and
shutter_close in seconds, fps, frame, aperture_radius and focus_distance in metres. Options beat the file. What neither
says: a pinhole, 24 frames a second, frame 0, half a frame of exposure that opens at the frame's instant.
The program is $GRAECO, else target/release/graeco of this source tree, else graeco on the PATH.
"""

import argparse
import fractions
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile

KEYS = ("aperture_radius", "focus_distance", "shutter_open", "shutter_close", "fps", "frame")


def arguments():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("glb")
    a.add_argument("out", metavar="OUT_PREFIX")
    a.add_argument("--jobs", required=True, help="spp:seed+seed,spp:seed,...")
    a.add_argument("--res", default="320x180", metavar="WxH")
    a.add_argument("--caustics", choices=["dropped", "blurred", "exact"], default="dropped",
                   help="light from lamps by way of mirrors and glass onto other surfaces; Cycles without caustics: dropped")
    a.add_argument("--mode", choices=["direct", "b4"], default="direct",
                   help="direct: direct light, mirrors and glass; b4: four bounces")
    a.add_argument("--sampler", default="auto", help="a design: see graeco render --help")
    a.add_argument("--spread", choices=["needed", "even"], default="needed",
                   help="above 16 spp: more runs for pixels that need them, spp on average (--mean-runs), or spp for each")
    a.add_argument("--frame", type=float, help="may be fractional")
    a.add_argument("--fps", type=float)
    a.add_argument("--shutter", type=float, help="exposure in frames")
    a.add_argument("--aperture-radius", type=float)
    a.add_argument("--focus-distance", type=float)
    a.add_argument("--no-blur", action="store_true")
    a.add_argument("--no-dof", action="store_true")
    a.add_argument("--threads", type=int, default=0)
    return a.parse_args()


def program():
    here = os.path.dirname(os.path.realpath(__file__))
    built = os.path.join(here, "..", "..", "target", "release", "graeco")
    found = os.environ.get("GRAECO") or (built if os.path.exists(built) else shutil.which("graeco"))
    if not found:
        sys.exit("graeco is not built (cargo build --release), and GRAECO is not set")
    return found


def document(path):
    """The JSON of a .glb or .gltf."""
    with open(path, "rb") as f:
        data = f.read()
    if data[:4] != b"glTF":
        return json.loads(data)
    length, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON":
        sys.exit("%s: the first chunk of a .glb must be JSON" % path)
    return json.loads(data[20:20 + length])


def camera_extras(path):
    """Custom properties of the first camera's node; of the camera where the node has none."""
    gltf = document(path)
    node = next((n for n in gltf.get("nodes", []) if "camera" in n), None)
    if node is None:
        return {}
    for extras in (node.get("extras"), gltf["cameras"][node["camera"]].get("extras")):
        said = {k: float(extras[k]) for k in KEYS if k in extras} if isinstance(extras, dict) else {}
        if said:
            return said
    return {}


def exposure(o, extras):
    """The flags for graeco that open the shutter when asked, for as long as asked."""
    fps = o.fps or extras.get("fps", 24.0)
    if o.shutter is not None or "shutter_open" not in extras:
        frame = o.frame if o.frame is not None else extras.get("frame", 0.0)
        length = 0.5 if o.shutter is None else o.shutter
    else:
        frame = o.frame if o.frame is not None else extras["shutter_open"] * fps
        length = (extras["shutter_close"] - extras["shutter_open"]) * fps
    rate, number = fractions.Fraction(fps).limit_denominator(1001), round(frame)
    if abs(frame - number) > 1e-6:
        # An instant between frames is frame 1 of a rate of its own.
        own = fractions.Fraction(fps / frame).limit_denominator(50000)
        length, rate, number = length * float(own) / fps, own, 1
    return ["--frames", str(number), "--fps", "%d/%d" % (rate.numerator, rate.denominator),
            "--shutter", repr(0.0 if o.no_blur else length), "--shutter-phase", "start"]


def lens(o, extras):
    radius = o.aperture_radius if o.aperture_radius is not None else extras.get("aperture_radius", 0.0)
    focus = o.focus_distance if o.focus_distance is not None else extras.get("focus_distance", 1.0)
    return ["--aperture-radius", repr(0.0 if o.no_dof else radius), "--focus-distance", repr(focus)]


def jobs(text):
    for job in text.split(","):
        runs, seeds = job.split(":")
        for seed in seeds.split("+"):
            yield int(runs), int(seed)


def sampling(o, runs):
    """The flags for so many runs a pixel, or so many on average."""
    if o.spread == "needed" and runs > 16 and o.sampler in ("auto", "growing", "nested", "sobol", "random"):
        return ["--mean-runs", str(runs), "--most-runs", str(min(max(4096, 32 * runs), 1 << 20))]
    return ["--runs", str(runs)]


def main():
    o = arguments()
    extras = camera_extras(o.glb)
    common = [program(), "render", o.glb, "--size", o.res, "--bounces", "0" if o.mode == "direct" else "4",
              "--design", o.sampler, "--background", "none", "--filter", "box", "--depth", "float", "--quiet",
              "--caustics", o.caustics]
    common += exposure(o, extras) + lens(o, extras) + (["--threads", str(o.threads)] if o.threads else [])
    os.makedirs(os.path.dirname(os.path.abspath(o.out)), exist_ok=True)
    for runs, seed in jobs(o.jobs):
        path = os.path.abspath("%s_s%d_seed%d.exr" % (o.out, runs, seed))
        with tempfile.TemporaryDirectory() as folder:
            stats = os.path.join(folder, "stats.jsonl")
            subprocess.run(common + sampling(o, runs) + ["--seed", str(seed), "--stats", stats, "-o", path], check=True)
            with open(stats) as f:
                s = json.loads(f.readlines()[-1])
        result = dict(renderer="graeco", scene=os.path.splitext(os.path.basename(o.glb))[0], mode=o.mode,
                      sampler=o.sampler, spread=o.spread, spp=runs, seed=seed, res=o.res, import_s=round(s["load_s"], 4),
                      wall_s=round(s["build_s"] + s["render_s"] + s["write_s"], 4), cpu_s=round(s["cpu_s"], 4),
                      sync_s=round(s["build_s"], 4), render_s=round(s["render_s"], 4), out=path,
                      peak_mb=s["peak_memory"] // 2 ** 20)
        print("RESULT " + json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
