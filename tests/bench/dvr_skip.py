#!/usr/bin/env python3
"""What skipping saves: dvr_skip.py --bin BUILD/bin INPUT.vqv:TF...

Draws every VQ file, with its transfer function (a file or a preset), from some sides with --skip on and off. Prints
Markdown: bricks of the volume that may show something by their ranges, different bricks decoded for a picture, samples,
milliseconds, and the greatest difference between both pictures, as floats (by voxdiff).
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile


def tool(options, name, *words):
    command = [str(options.bin / name), *map(str, words), "--json"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}")
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volumes", nargs="+", metavar="INPUT.vqv:TF")
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("--cameras", nargs="+", default=["orbit:30,20,1.8", "orbit:120,20,1.8", "orbit:250,-30,1.5"])
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--step", default="0.5")
    parser.add_argument("--threads", default="1")
    options = parser.parse_args()
    print(f"{options.size}, step {options.step}, {options.threads} threads; load {os.getloadavg()[0]:.1f}\n")
    print("| volume | transfer function | camera | skip | bricks | may show | decoded | decoded, % | samples | ms | differ |")
    print("| --- | --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory(prefix="voxkit-skip-") as folder:
        for pair in options.volumes:
            volume, transfer = pair.rsplit(":", 1)
            for camera in options.cameras:
                pictures, rows = [], []
                for skip in ("on", "off"):
                    pictures.append(pathlib.Path(folder) / f"{skip}.exr")
                    done = tool(options, "vox-render", volume, "--mode", "dvr", "--tf", transfer, "--camera", camera,
                                "--size", options.size, "--step", options.step, "--threads", options.threads, "--skip",
                                skip, "-o", pictures[-1], "--force")
                    frame = done["frames"][0]
                    rows.append([pathlib.Path(volume).name, pathlib.Path(transfer).stem, camera, skip, done["bricks"],
                                 done["bricks_visible"], frame["bricks_decoded"],
                                 f"{100 * frame['bricks_decoded'] / done['bricks']:.1f}", frame["samples"],
                                 f"{frame['ms']:.0f}"])
                diff = tool(options, "voxdiff", *pictures)["max_abs_error"]
                for row in rows:
                    print("| " + " | ".join(map(str, [*row, diff])) + " |", flush=True)


if __name__ == "__main__":
    main()
