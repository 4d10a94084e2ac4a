#!/usr/bin/env python3
"""Builds the program by profile-guided optimisation, and says what that gains.

    rustup component add llvm-tools
    python3 benches/guided.py                # target/guided/graeco
    python3 benches/guided.py --compare 7    # and renders frames in turn with the plain `cargo build --release`

The compiler first builds a program that counts which way each branch goes. It renders the project's own scenes; the
compiler then places and inlines code by what it counted. The program computes the same, bit for bit.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
GUIDED = ROOT / "target" / "guided"
FRAMES = {"pool": 10, "walker": 9, "mirror": 10, "forest": 8, "fan": 16, "field": 12, "newton": 14, "blur_row": 12}
SCENES = ["cornell", "hard_lights", "lens", "still_life"]


def output(*command):
    """What a command prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def build(host, flag):
    """The release program, built with a flag of its own for the project and its packages but not for build scripts."""
    environment = os.environ | {"RUSTFLAGS": f"{os.environ.get('RUSTFLAGS', '')} {flag}".strip()}
    command = ["cargo", "build", "--locked", "--release", "--target", host, "--target-dir", str(GUIDED / "build")]
    subprocess.run(command, check=True, cwd=ROOT, env=environment)
    return GUIDED / "build" / host / "release" / "graeco"


def render(program, scene, frame, size, bounces, folder):
    """Seconds that sampling one frame took."""
    stats = os.path.join(folder, "stats.jsonl")
    picture = os.path.join(folder, f"{pathlib.Path(program).parent.name}.exr")
    options = ["--frames", str(frame), "--size", size, "--runs", "16", "--bounces", str(bounces)]
    subprocess.run(
        [program, "render", scene, *options, "--stats", stats, "-o", picture], check=True, capture_output=True
    )
    with open(stats, encoding="utf-8") as lines:
        return json.loads(lines.readlines()[-1])["render_s"]


def guided():
    """Builds, learns and builds again."""
    host = next(line[6:] for line in output("rustc", "-vV").splitlines() if line.startswith("host: "))
    merge = pathlib.Path(output("rustc", "--print", "sysroot").strip()) / "lib/rustlib" / host / "bin/llvm-profdata"
    if not merge.exists():
        raise SystemExit(f"{merge} is missing: rustup component add llvm-tools")
    with tempfile.TemporaryDirectory() as counts, tempfile.TemporaryDirectory() as pictures:
        program = build(host, f"-Cprofile-generate={counts}")
        for bounces in (0, 4):
            for name, frame in FRAMES.items():
                render(program, ROOT / f"animations/{name}.glb", frame, "120x68", bounces, pictures)
            for name in SCENES:
                render(program, ROOT / f"scenes/{name}.glb", 0, "120x68", bounces, pictures)
        profile = GUIDED / "graeco.profdata"
        subprocess.run([merge, "merge", "-o", profile, counts], check=True)
    program = GUIDED / "graeco"
    program.unlink(missing_ok=True)
    os.link(build(host, f"-Cprofile-use={profile}"), program)
    print(f"{program}: built")
    return program


def compare(program, repeats, scenes):
    """Seconds of `program` over those of the plain build, frames in turn."""
    subprocess.run(["cargo", "build", "--locked", "--release"], check=True, cwd=ROOT)
    plain = ROOT / "target/release/graeco"
    frames = [(str(ROOT / f"animations/{name}.glb"), frame) for name, frame in FRAMES.items()]
    frames += [(scene, 0) for scene in scenes]
    print("| scene | bounces | ratio of seconds | quartiles | plain, s |\n|-|-|-|-|-|")
    medians = []
    with tempfile.TemporaryDirectory() as folder:
        for scene, frame in frames:
            for bounces in (0, 4):
                # The first pair loads what the others find in the cache.
                pairs = [
                    [render(p, scene, frame, "240x135", bounces, folder) for p in (plain, program)]
                    for _ in range(repeats + 1)
                ][1:]
                ratios = [ours / base for base, ours in pairs]
                low, median, high = statistics.quantiles(ratios, n=4) if repeats > 1 else ratios * 3
                medians.append(median)
                base = statistics.median(pair[0] for pair in pairs)
                name = os.path.basename(scene)
                print(f"| {name} | {bounces} | {median:.3f} | {low:.3f} to {high:.3f} | {base:.2f} |", flush=True)
        same = pathlib.Path(folder, "release.exr").read_bytes() == pathlib.Path(folder, "guided.exr").read_bytes()
    print(f"\ngeometric mean {statistics.geometric_mean(medians):.3f}")
    print(f"the last pictures are {'the same' if same else 'NOT the same'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--compare", type=int, metavar="N", help="pairs of renders for each scene")
    parser.add_argument("--kept", action="store_true", help="compare target/guided/graeco as it is")
    parser.add_argument("scenes", nargs="*", help="further glTF files to compare on")
    arguments = parser.parse_args()
    program = GUIDED / "graeco" if arguments.kept else guided()
    if arguments.compare:
        compare(program, arguments.compare, arguments.scenes)


if __name__ == "__main__":
    main()
