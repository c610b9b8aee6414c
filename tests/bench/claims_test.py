#!/usr/bin/env python3
"""Every figure that the README gives of its own is a row of results.csv: claims_test.py README.md results.csv

Figures in the examples are not meant: these are run by a test of their own. A claim is a pattern of the README's words, with a
group for each figure, and the row and column where each comes from; a figure must be that of the row, rounded as it is in the README.
Comparisons in words are claims, too, as conditions on rows.
"""
import csv
import pathlib
import re
import sys

PICTURES = "readme"
MILLION = 1e6


def row_of(rows, *key):
    row = rows.get(key)
    if row is None:
        sys.exit(f"results.csv has no row {key}")
    return row


# Words, and where each of their figures comes from: section, data, what, setting; column; unit.
FIGURES = [
    (r"a CT scan, lossless in ([\d.]+) %", [((PICTURES, "bonsai.nii.gz", "vq-encode", ""), "percent", 1)]),
    (r"a volume of colours in ([\d.]+) %", [((PICTURES, "menger:5", "svmm-encode", "--quality 80 --base bitmap --blockwidth 4"), "percent", 1)]),
    (r"a mesh as ([\d.]+) million voxels, their colours in ([\d.]+) %",
     [((PICTURES, "LeePerrySmith.obj", "dagcolor-pack", "--resolution 2048"), "voxels", MILLION),
      ((PICTURES, "LeePerrySmith.obj", "dagcolor-pack", "--resolution 2048"), "percent", 1)]),
    (r"no voxel off by more than (\d+) of 255: ([\d.]+) %",
     [((PICTURES, "ch2better.nii.gz", "vq-encode", "--max-error 2 --verify"), column, 1) for column in ("max_error", "percent")]),
    (r"Fog of an OpenVDB file: ([\d.]+) %", [((PICTURES, "smoke.vdb", "svmm-encode", "--layout plain --quality 99.7"), "percent", 1)]),
    (r"A mesh with textures as ([\d.]+) million voxels, colours ([\d.]+) %",
     [((PICTURES, "scene.gltf", "dagcolor-pack", "--resolution 2048"), "voxels", MILLION),
      ((PICTURES, "scene.gltf", "dagcolor-pack", "--resolution 2048"), "percent", 1)]),
    (r"A MagicaVoxel model, ([\d.]+) million voxels, colours ([\d.]+) %",
     [((PICTURES, "scene_store8.vox", "dagcolor-pack", ""), "voxels", MILLION),
      ((PICTURES, "scene_store8.vox", "dagcolor-pack", ""), "percent", 1)]),
    (r"`terrain:4096`: ([\d.]+) million voxels, colours ([\d.]+) %",
     [((PICTURES, "terrain:4096", "dagcolor-pack", ""), "voxels", MILLION),
      ((PICTURES, "terrain:4096", "dagcolor-pack", ""), "percent", 1)]),
    (r"an eighth of its resolution, in ([\d.]+) % together",
     [((PICTURES, "engine.nii.gz", "svmm-encode", "--quality 96 --blockwidth 2 --rootwidth 16"), "percent", 1)]),
    (r"`svmm-encode --layout plain --quality 94` \(([\d.]+) %, ([\d.]+) dB\); `vq-encode --max-error 4` \(([\d.]+) %, ([\d.]+) dB\); "
     r"`vq-encode --reduce 64` \(([\d.]+) %, ([\d.]+) dB\)",
     [((PICTURES, "bonsai.nii.gz", what, setting), column, 1) for what, setting in (
         ("svmm-encode", "--layout plain --quality 94 --verify"), ("vq-encode", "--max-error 4 --verify"), ("vq-encode", "--reduce 64 --verify"))
      for column in ("percent", "psnr_db")]),
    (r"`vws`, the default \(([\d.]+) %, ([\d.]+)\); `bc1` \(([\d.]+) %, ([\d.]+)\)\. Below: `vws` with a threshold of 25\.5 \(([\d.]+) %, ([\d.]+)\); "
     r"`jpeg`, quality 75 \(([\d.]+) %, ([\d.]+)\); `jp2`, quality 40 \(([\d.]+) %, ([\d.]+)\)",
     [((PICTURES, "terrain:1024", "dagcolor-pack", f"--codec {setting}"), column, 1) for setting in (
         "vws", "bc1", "vws --threshold 25.5", "jpeg --quality 75", "jp2 --quality 40") for column in ("percent", "grmse")]),
    (r"at (\d+), (\d+) and (\d+) %, at (\d+), (\d+) and (\d+) %, and at (\d+), (\d+) and\s+(\d+) %",
     [((PICTURES, data, what, setting), "percent", 1) for data, what, settings in (
         ("menger:5", "svmm-encode", ("-q 100", "-q 90", "-q 80 -b bitmap -w 4")),
         ("membrane:512,512,64:1", "svmm-encode", ("-q 100", "--max-error 2", "--max-error 8")),
         ("marschner-lobb:128", "vq-encode", ("--lossless", "--max-error 256", "--reduce 16"))) for setting in settings]),
]


def bits(rows, section, what, setting):
    return float(row_of(rows, section, "skull", what, setting)["bits_per_voxel"])


def smaller_for_scans(rows):
    """vq-encode's files of the scans beside those of sparse mip-maps, lossless and with the same bound."""
    def size(section, data, what, known):
        return min(int(row["bytes"]) for (s, d, w, setting), row in rows.items() if (s, d, w) == (section, data, what) and known in setting)
    return all(size("lossless", data, "vq-encode", "") < size("lossless", data, "svmm-encode", "-w 0") and
               size("bounded", data, "vq-encode", "--max-error") < size("bounded", data, "svmm-encode", "-w 0")
               for data in ("skull", "ch2better"))


def smaller(rows):
    """Bits a voxel of the CT, from the lossless sparse mip-map to the file of k-means."""
    svmm, vq = bits(rows, "lossless", "svmm-encode", "-q 100 -w 0"), bits(rows, "lossless", "vq-encode", "")
    return svmm > 2 * vq and vq > bits(rows, "bounded", "vq-encode", "--max-error 40") > bits(rows, "small", "vq-encode", "--reduce 16")


CONDITIONS = [
    (r"it makes scans much smaller than sparse mip-maps do; `--max-error` makes them smaller still, and k-means,", smaller),
    (r"makes scans much smaller than sparse mip-maps do", smaller_for_scans),
]


def main():
    readme, results = map(pathlib.Path, sys.argv[1:])
    text = re.sub(r"\s+", " ", readme.read_text(encoding="utf-8"))
    with results.open(newline="", encoding="utf-8") as file:
        rows = {(row["section"], row["data"], row["what"], row["setting"]): row for row in csv.DictReader(file)}
    wrong, figures = [], 0
    for pattern, places in FIGURES:
        found = re.search(re.sub(r"\\s\+", " ", pattern), text)
        if found is None:
            wrong.append(f"not in the README any more: {pattern}")
            continue
        for said, (key, column, unit) in zip(found.groups(), places, strict=True):
            decimals = len(said.partition(".")[2])
            measured = f"{float(row_of(rows, *key)[column]) / unit:.{decimals}f}"
            figures += 1
            if measured != said:
                wrong.append(f"{' '.join(key)}: {column} is {measured}, but the README says {said}")
    for pattern, holds in CONDITIONS:
        if not re.search(pattern, text):
            wrong.append(f"not in the README any more: {pattern}")
        elif not holds(rows):
            wrong.append(f"does not hold: {pattern}")
    print("\n".join(wrong) or f"{figures} figures and {len(CONDITIONS)} comparisons hold")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
