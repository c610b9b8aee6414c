#!/usr/bin/env python3
"""results.csv is that of this build: results_test.py BIN results.csv

Compresses some built-in volumes again, with our codecs, as scripts/bench does: the same sizes, or the file is out of date.
"""
import argparse
import csv
import json
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent / "suite"))
import compression  # noqa: E402
import data  # noqa: E402
import surfaces  # noqa: E402
from process import run  # noqa: E402

VOLUMES = ("marschner-lobb:128", "membrane:256,256,128:1")
SURFACE = "terrain:512"


def sizes_of_volumes(options):
    for name in VOLUMES:
        volume = data.Volume(options, name, name)
        for section, methods in (("lossless", compression.lossless_methods), ("small", compression.small_methods)):
            for method in methods(volume):
                if method.what.endswith("-encode"):
                    run(*method.encode)
                    yield (section, name, method.what, method.setting), method.file.stat().st_size


def sizes_of_colors(options):
    raw = surfaces.pack(options, SURFACE, SURFACE, options.output)
    for what, setting, words in surfaces.CODECS:
        if what in ("vws", "fws", "palette"):
            said = run(options.bin / "dagcolor-pack", raw, "-o", options.output / "coded.dagc", "-f", "--json", *words).output
            yield ("colors", SURFACE, what, setting), json.loads(said)["color_bytes"]


def main():
    options = argparse.Namespace(bin=pathlib.Path(sys.argv[1]))
    with open(sys.argv[2], newline="", encoding="utf-8") as file:
        rows = {(row["section"], row["data"], row["what"], row["setting"]): row for row in csv.DictReader(file)}
    wrong, number = [], 0
    with tempfile.TemporaryDirectory(prefix="voxkit-bench-") as folder:
        options.output = pathlib.Path(folder)
        for key, size in [*sizes_of_volumes(options), *sizes_of_colors(options)]:
            number += 1
            if key not in rows:
                wrong.append(f"{' '.join(key)}: no row")
            elif int(rows[key]["bytes"]) != size:
                wrong.append(f"{' '.join(key)}: {size} bytes, not {rows[key]['bytes']}")
    print("\n".join([*wrong, "scripts/bench writes the file again"]) if wrong else f"{number} sizes are as they were")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
