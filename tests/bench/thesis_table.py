#!/usr/bin/env python3
"""Redoes Table 5.1 of the thesis (M. E. Faas, Sparse Voxel Mip-Maps, 2016) for the Menger sponges.

    thesis_table.py --bin BUILD/bin -o DIR [--size 1920x1080] [--path thesis94] [--only TEXT]

Every row is a volume, encoded with the table's parameters, and drawn along a camera path: once for the times of the rays
alone, once beside the uncompressed volume for PSNR and MS-SSIM. DIR keeps the encoded volumes and what each tool said;
what is there already is not done again, so that a run that was stopped goes on where it was. Writes DIR/table.csv and
DIR/table.md with the rows that are complete.
"""
import argparse
import csv
import json
import os
import pathlib
import subprocess
import sys

UNCOMPRESSED, SVO, SVMM, BLOCKS = "uncompressed", "SVO", "SVMM", "SVMM, block encoded"
# group, volume, options of svmm-encode, percent as published
ROWS = [
    (UNCOMPRESSED, "menger:5", None, 100),
    (SVO, "menger:5", "-w 2 -r 2 -q 99", 45),
    (SVMM, "menger:5", "-w 0 -r 32 -q 80", 47),
    (BLOCKS, "menger:5", "-w 4 -r 32 -q 80 -b bitmap", 8),
    (UNCOMPRESSED, "menger:6", None, 100),
    (SVO, "menger:6", "-w 2 -r 2 -q 99", 33),
    (SVMM, "menger:6", "-w 0 -r 32 -q 80", 34),
    (BLOCKS, "menger:6", "-w 4 -r 32 -q 80 -b bitmap", None),
    (BLOCKS, "menger:6", "-w 8 -r 32 -q 80 -b bitmap", 6),
    (BLOCKS, "menger:7", "-w 4 -r 128 -q 80 -b bitmap", 4),
]
# 39 GB uncompressed: nothing to compare with, and the point is that it fits.
TOO_LARGE = {"menger:7": ["--max-memory", "4G"]}


class Bench:
    def __init__(self, options):
        self.options = options
        self.folder = pathlib.Path(options.output)
        self.folder.mkdir(parents=True, exist_ok=True)

    def tool(self, name, words, report):
        """The JSON that a tool prints, from the file `report` if it has been run."""
        path = self.folder / report
        if not path.exists():
            command = [str(pathlib.Path(self.options.bin) / name), *words, "--json"]
            print("$ " + " ".join(command), file=sys.stderr)
            done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
            if done.returncode != 0:
                sys.exit(f"{name}: exit code {done.returncode}")
            result = json.loads(done.stdout)
            result["load"] = os.getloadavg()[0]
            temporary = path.with_suffix(".part")
            temporary.write_text(json.dumps(result, indent=1), encoding="utf-8")
            temporary.rename(path)
        return json.loads(path.read_text(encoding="utf-8"))

    def report(self, name, path, kind):
        return f"{name}.{self.options.size}.{path.replace(':', '-')}.{kind}.json"

    def row(self, group, volume, parameters, published):
        o = self.options
        name = f"{volume}{parameters or ''}".replace(":", "-").replace(" ", "")
        threads = ["--threads", str(o.threads)]
        view = ["--size", o.size, "--no-images", *threads]
        row = {"group": group, "volume": volume, "parameters": parameters or "", "published_percent": published}
        if parameters is None:
            source, traversal = volume, ["--traversal", "baseline"]
            level = int(volume.split(":")[1])
            row["percent"], row["bytes"] = 100.0, 4 * 27 ** level
        else:
            source, traversal = str(self.folder / f"{name}.{o.layout}.svmm"), []
            encoded = self.tool("svmm-encode", [volume, "-o", source, "--force", *parameters.split(), "--layout", o.layout,
                                                *threads], f"{name}.{o.layout}.encode.json")
            row["percent"], row["bytes"] = encoded["percent"], encoded["file_bytes"]
            name = f"{name}.{o.layout}"
        limit = TOO_LARGE.get(volume, [])
        timed = self.tool("vox-render", [source, *view, "--path", o.path, *traversal, *limit],
                          self.report(name, o.path, "time"))
        for key in ("ms_min", "ms_avg", "ms_max", "mrays_per_s", "threads", "peak_rss_bytes", "load"):
            row[key] = timed[key]
        if parameters is not None and volume not in TOO_LARGE:
            path = o.compare_path or o.path
            compared = self.tool("vox-render", [source, *view, "--path", path, "--reference", volume],
                                 self.report(name, path, "compare"))
            row["psnr_db"], row["ms_ssim"] = compared["psnr_db_avg"], compared["ms_ssim_avg"]
        return row


COLUMNS = ["group", "volume", "parameters", "published_percent", "percent", "bytes", "ms_min", "ms_avg", "ms_max",
           "mrays_per_s", "psnr_db", "ms_ssim", "peak_rss_bytes", "threads", "load"]


def shown(key, value):
    if value is None or value == "":
        return ""
    if key == "percent" or key.startswith("ms_m") or key.startswith("ms_a") or key in ("mrays_per_s", "load"):
        return f"{value:.2f}"
    if key == "psnr_db":
        return value if isinstance(value, str) else f"{value:.2f}"
    if key == "ms_ssim":
        return f"{value:.5f}"
    return str(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bin", required=True, help="folder of the programs")
    parser.add_argument("-o", "--output", required=True, help="folder for volumes, reports and the table")
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--path", default="thesis94")
    parser.add_argument("--compare-path", help="camera path for PSNR and MS-SSIM, such as orbit:8 (that of --path)")
    parser.add_argument("--layout", default="thesis", choices=["thesis", "plain"])
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--only", default="", help="rows whose volume, group or parameters contain this text")
    options = parser.parse_args()

    chosen = [row for row in ROWS if any(options.only in str(field) for field in row[:3])]
    if not chosen:
        parser.error(f'--only "{options.only}": no such row')
    bench = Bench(options)
    rows = [bench.row(*row) for row in chosen]

    with open(bench.folder / "table.csv", "w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    lines = [f"{options.path}, {options.size}, layout {options.layout}, {rows[0]['threads']} threads", "",
             "| " + " | ".join(COLUMNS) + " |", "| " + " | ".join(["---"] * len(COLUMNS)) + " |"]
    lines += ["| " + " | ".join(shown(key, row.get(key)) for key in COLUMNS) + " |" for row in rows]
    table = "\n".join(lines) + "\n"
    (bench.folder / "table.md").write_text(table, encoding="utf-8")
    print(table, end="")


if __name__ == "__main__":
    main()
