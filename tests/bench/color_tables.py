#!/usr/bin/env python3
"""Sizes and errors of coloured surfaces, codec by codec: color_tables.py --bin BUILD/bin -o FOLDER NAME=INPUT[@CAMERAS] ...

Tables 2, 4, 6, 7 and 8 of Dolonius et al. 2019 for every surface INPUT, voxelised at --resolution:
  2  textures: bc1, bc7, astc
  4  blocks, fws and vws by optimal parsing and by the paper's greedy merging, and palettes
  6  the same of all nodes
  7  bits a voxel of Table 4
  8  images: jpeg, jp2, png
Percent is of 24 bits a colour; GRMSE is the error a channel of all colours; RMSE and MS-SSIM are those of pictures without
shading beside pictures of the uncompressed colours, on average over the cameras: a --path of vox-render, orbit:4 where none is given.
FOLDER gets color-tables.csv and the tables as color-tables.md. A run that was stopped goes on where it was.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys

THRESHOLDS = ["6.38", "9.56", "12.8", "25.5"]
GREEDY = ("--effort", "1")
SETTINGS = (
    [("2", "bc1", "", ("--codec", "bc1")), ("2", "bc7", "", ("--codec", "bc7"))]
    + [("2", "astc", block, ("--codec", "astc", "--quality", quality))
       for block, quality in (("4x4", 100), ("5x5", 85), ("6x6", 70), ("8x8", 31), ("12x12", 0))]
    + [("4", f"{codec}{' greedy' if more else ''}", f"e={e}", ("--codec", codec, "-e", e, *more))
       for codec in ("fws", "vws") for more in ((), GREEDY) for e in THRESHOLDS]
    + [("4", "vws hilbert", f"e={e}", ("--codec", "vws", "-e", e, "--curve", "hilbert")) for e in THRESHOLDS]
    + [("4", "vws lab", f"e={e}", ("--codec", "vws", "-e", e, "--space", "lab")) for e in ("2.3", "5")]
    + [("4", "palette", f"{n} colours", ("--codec", "palette", "--palette", n)) for n in (65536, 16384, 4096, 2048, 256)]
    + [("6", codec, f"e={e}", ("--codec", codec, "-e", e, "--colors", "all")) for codec in ("fws", "vws") for e in ("6.38", "9.56")]
    + [("6", "palette", "2048 colours", ("--codec", "palette", "--palette", 2048, "--colors", "all"))]
    + [("8", "jpeg", str(q), ("--codec", "jpeg", "--quality", q)) for q in (95, 85, 75, 50)]
    + [("8", "jp2", str(q), ("--codec", "jp2", "--quality", q)) for q in (80, 60, 40, 20)]
    + [("8", "png", "lossless", ("--codec", "png"))]
    + [("8", "png", "256 colours", ("--codec", "png", "--palette", 256))]
    + [("8", "png", f"quality {q}", ("--codec", "png", "--quality", q)) for q in (70, 30, 10)]
)
COLUMNS = ["scene", "table", "codec", "setting", "percent", "bits_per_voxel", "grmse", "rmse", "ms_ssim", "color_seconds"]
TITLES = {"2": "Textures", "4": "Blocks and palettes", "6": "Colours of all nodes", "8": "Images"}


def run(*words, may_fail=False):
    done = subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode == 0:
        return done.stdout
    message = f"{' '.join(map(str, words))}: exit code {done.returncode}: {done.stderr.decode(errors='replace').strip()}"
    if not may_fail:
        sys.exit(message)
    print(message, file=sys.stderr)  # a codec that this build lacks is left out
    return None


class Scene:
    def __init__(self, options, text):
        self.options, (self.name, source) = options, text.split("=", 1)
        self.source, _, self.cameras = source.partition("@")
        self.reference = options.output / f"{self.name}.dagc"

    def prepare(self):
        if self.reference.exists():
            return
        words = [] if ":" in self.source or self.source.endswith((".vox", ".dagc")) else ["--resolution", self.options.resolution]
        run(self.options.bin / "dagcolor-pack", self.source, "-o", self.reference, "--codec", "raw", *words)

    def measure(self, words):
        """A row's figures; None where there is no such codec."""
        out = self.options.output / "coded.dagc"
        packed = run(self.options.bin / "dagcolor-pack", self.reference, "-o", out, "-f", "--json", *words, may_fail=True)
        if packed is None:
            return None
        packed, report = json.loads(packed), self.options.output / "report.json"
        run(self.options.bin / "vox-render", out, "--reference", self.reference, "--no-images", "--report", report, "-f",
            "--path", self.cameras or "orbit:4", "--size", self.options.size, "--shade", "none")
        drawn = json.loads(report.read_text())
        return [packed["color_percent"], packed["color_bits_per_voxel"], packed["grmse"], drawn["rmse_avg"], drawn["ms_ssim_avg"],
                packed["color_seconds"]]


def read_rows(path):
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {tuple(row[:4]): row[4:] for row in csv.reader(file) if row != COLUMNS}


def write_rows(path, rows):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows([*key, *figures] for key, figures in rows.items())


def tables(rows):
    scenes = list(dict.fromkeys(scene for scene, *_ in rows))
    lines = []
    for table, title in TITLES.items():
        lines += [f"## Table {table}: {title}", "", "Percent / GRMSE / RMSE / MS-SSIM", "",
                  "| codec | setting | " + " | ".join(scenes) + " |", "| --- " * (2 + len(scenes)) + "|"]
        for codec, setting in dict.fromkeys(key[2:] for key in rows if key[1] == table):
            cells = []
            for scene in scenes:
                row = rows.get((scene, table, codec, setting))
                cells.append("{0:.2f} / {2:.2f} / {3:.2f} / {4:.4f}".format(*map(float, row)) if row else "")
            lines.append(f"| {codec} | {setting} | " + " | ".join(cells) + " |")
        lines.append("")
    lines += ["## Table 7: bits a voxel", "", "| codec | setting | " + " | ".join(scenes) + " |", "| --- " * (2 + len(scenes)) + "|"]
    for codec, setting in dict.fromkeys(key[2:] for key in rows if key[1] == "4"):
        cells = [f"{float(rows[scene, '4', codec, setting][1]):.3f}" if (scene, "4", codec, setting) in rows else "" for scene in scenes]
        lines.append(f"| {codec} | {setting} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--resolution", type=int, default=1024)
    parser.add_argument("--size", default="1024x768")
    parser.add_argument("scenes", nargs="*")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "color-tables.csv"
    rows = read_rows(path)
    for scene in [Scene(options, text) for text in options.scenes]:
        scene.prepare()
        for table, codec, setting, words in SETTINGS:
            if (scene.name, table, codec, setting) in rows:
                continue
            figures = scene.measure(words)
            if figures is None:
                continue
            rows[scene.name, table, codec, setting] = [f"{figure:.6g}" for figure in figures]
            print(scene.name, codec, setting, *(f"{figure:.4g}" for figure in figures), file=sys.stderr, flush=True)
            write_rows(path, rows)
    text = tables(rows)
    (options.output / "color-tables.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
