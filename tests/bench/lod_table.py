#!/usr/bin/env python3
"""What levels of detail are worth: lod_table.py --bin BUILD/bin [INPUT...]      (menger:5)

Every INPUT, a volume or a .svmm file, is drawn unshaded from a number of sides and ever farther away: with one ray a
pixel, without (off) and with (on) levels of detail, and with 64 rays a pixel and all detail, which is the reference.
Prints Markdown: how far both are from the reference (RMSE of 8-bit values over the whole picture, root of the mean
square over all sides), milliseconds of casting (of each side the fastest of some repetitions after a first round, then
the mean), and cells looked at.
"""
import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

ELEVATION, FIELD_OF_VIEW = 20, 45
RAYS_A_SIDE = 8  # of a pixel of the reference


class Bench:
    def __init__(self, options, folder):
        self.options = options
        self.folder = folder

    def tool(self, name, *words):
        command = [str(self.options.bin / name), *map(str, words), "--json"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}: exit code {done.returncode}")
        return json.loads(done.stdout)

    def encode(self, volume):
        if volume.endswith(".svmm"):
            return volume
        encoded = self.folder / "volume.svmm"
        self.tool("svmm-encode", volume, "-o", encoded, "-w", self.options.blockwidth, "-r", self.options.rootwidth,
                  "-q", self.options.quality, "--force")
        return encoded

    def path(self, distance, rounds):
        """A file of camera positions: all sides, `rounds` times."""
        sides = self.options.sides
        frames = [{"orbit": [30 + 360 * i / sides, ELEVATION, distance]} for i in range(sides)]
        file = self.folder / "path.json"
        file.write_text(json.dumps({"frames": frames * rounds}), encoding="utf-8")
        return file

    def render(self, volume, path, *words):
        return self.tool("vox-render", volume, "--path", path, "--size", self.options.size, "--fov", FIELD_OF_VIEW,
                         "--shade", "none", "--threads", self.options.threads, *words)

    def draw(self, name, volume, distance, *words):
        self.render(volume, self.path(distance, 1), "-o", self.folder / f"{name}-%d.png", "--force", *words)

    def rmse(self, name):
        squares = 0
        for i in range(self.options.sides):
            diff = self.tool("voxdiff", self.folder / f"reference-{i}.png", self.folder / f"{name}-{i}.png")
            squares += float(diff["rmse"]) ** 2 / self.options.sides
        return math.sqrt(squares)

    def cost(self, volume, distance, lod):
        """Mean milliseconds and cells of a frame."""
        sides = self.options.sides
        path = self.path(distance, self.options.repeats + 1)
        frames = self.render(volume, path, "--no-images", "--lod", lod)["frames"][sides:]
        ms = sum(min(frame["ms"] for frame in frames[i::sides]) for i in range(sides)) / sides
        return ms, sum(frame["cells_visited"] for frame in frames) / len(frames)

    def row(self, volume, longest, distance):
        height = int(self.options.size.split("x")[1])
        voxels = 2 * math.tan(math.radians(FIELD_OF_VIEW / 2)) * distance * longest / height
        self.draw("reference", volume, distance, "--lod", "off", "--aa", f"ssaa:{RAYS_A_SIDE}")
        cells = [f"{distance:g}", f"{voxels:.2g}"]
        rmse, cost = [], []
        for lod in ("off", "on"):
            self.draw(lod, volume, distance, "--lod", lod)
            rmse.append(self.rmse(lod))
            cost.append(self.cost(volume, distance, lod))
        (ms_off, cells_off), (ms_on, cells_on) = cost
        return [*cells, *(f"{value:.3f}" for value in rmse), f"{ms_off:.2f}", f"{ms_on:.2f}", f"{ms_off / ms_on:.1f}",
                f"{cells_off:.0f}", f"{cells_on:.0f}"]

    def table(self, volume):
        encoded = self.encode(volume)
        info = self.tool("vox-info", encoded)
        edges = ", ".join(f"{level['mip_factor']}" for level in info["levels"])
        print(f"{volume}: {' x '.join(map(str, info['dims']))} voxels; voxels of its levels are {edges} wide; pictures of "
              f"{self.options.size} from {self.options.sides} sides, {self.options.threads} threads, "
              f"load {os.getloadavg()[0]:.1f}\n")
        print("| distance | a pixel, voxels | RMSE off | RMSE on | ms off | ms on | times faster | cells off | cells on |")
        print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
        for distance in self.options.distances:
            print("| " + " | ".join(self.row(encoded, max(info["dims"]), distance)) + " |", flush=True)
        print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volumes", nargs="*", metavar="INPUT", default=["menger:5"])
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("--distances", type=lambda text: [float(word) for word in text.split(",")],
                        default=[1.8, 3, 6, 12, 24, 48, 96], help="times the longest side, with commas between them")
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--sides", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("-w", "--blockwidth", default="2", help="of svmm-encode: 2 has every level (2)")
    parser.add_argument("-r", "--rootwidth", default="2", help="of svmm-encode: the coarsest level (2)")
    parser.add_argument("-q", "--quality", default="90")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="voxkit-lod-") as folder:
        bench = Bench(options, pathlib.Path(folder))
        for volume in options.volumes:
            bench.table(volume)


if __name__ == "__main__":
    main()
