"""Every codec and tool beside its peers: bench [--data DIR] [--only SECTION]... [INPUT...]

INPUTs, volumes and surfaces, are compressed instead of those that there are: built-in ones and packages' of Debian, and with --data
all of a folder as well. Prints one table as Markdown. FOLDER gets it as bench.md, all figures as bench.csv, and what every section's programs wrote. With
--results FILE sizes and errors, which do not depend on the machine, are put into that CSV file.
"""
import argparse
import datetime
import os
import pathlib
import platform
import sys
import time

import codebooks
import compression
import drawing
import everyday
import kernels
import peers
import readme
import scaling
import surfaces
from process import Failed, run
from table import FIXED, MEASURED, Markdown, merge_fixed, write_csv

OF_INPUTS = ["lossless", "bounded", "small", "colors", "surfaces"]
SECTIONS = {"lossless": compression.lossless, "bounded": compression.bounded, "small": compression.small, "colors": surfaces.colors,
            "surfaces": surfaces.files, "rays": drawing.rays, "dvr": drawing.volumes, "kmeans": codebooks.kmeans,
            "everyday": everyday.everyday, "kernels": kernels.kernels, "readme": readme.shown,
            "scaling": scaling.scaling}


def machine():
    """What it is measured on, in a line."""
    model = platform.machine()
    for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{model}, {len(os.sched_getaffinity(0))} CPUs, {memory:.0f} GiB"


def main():
    parser = argparse.ArgumentParser(prog="bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True, help="folder of the programs")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder of what comes out")
    parser.add_argument("--data", type=pathlib.Path, help="a folder with volumes and meshes, or with folders of them")
    parser.add_argument("--results", type=pathlib.Path, help="CSV file to put sizes and errors into")
    parser.add_argument("--rounds", type=int, default=3, help="of each command (3)")
    parser.add_argument("--only", action="append", choices=SECTIONS, help="a section; may be given more than once")
    parser.add_argument("inputs", nargs="*", metavar="INPUT")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error("--rounds: expected 1 or more")
    if options.data and not options.data.is_dir():
        parser.error(f"--data: {options.data}: expected a folder")
    options.source = pathlib.Path(__file__).resolve().parents[3]
    options.bin, options.output = options.bin.resolve(), options.output.resolve()
    options.left_out = peers.missing()
    options.output.mkdir(parents=True, exist_ok=True)

    rows, start = [], time.monotonic()
    with (options.output / "bench.md").open("w", encoding="utf-8") as file:
        head = (f"{run(options.bin / 'vox-info', '--version').output.strip()}; {machine()}; {datetime.date.today()}; "
                f"load {os.getloadavg()[0]:.1f}")
        print(head, file=file)
        print(head, flush=True)
        for name in options.only or (OF_INPUTS if options.inputs else SECTIONS):
            tables = []

            def table(title, note, columns):
                tables.append(Markdown(title, note, columns, file))

            def add(row, cells):
                rows.append(row)
                tables[-1].add(*cells)
                write_csv(options.output / "bench.csv", FIXED + MEASURED, [one.fields(FIXED + MEASURED) for one in rows])

            SECTIONS[name](options, table, add)
        tail = f"\n{time.monotonic() - start:.0f} s; load {os.getloadavg()[0]:.1f} after"
        if options.left_out:
            tail += "\n\nLeft out, not there: " + "; ".join(options.left_out)
        print(tail, file=file)
        print(tail)
    if options.results and not options.inputs:
        merge_fixed(options.results, rows)


if __name__ == "__main__":
    try:
        main()
    except Failed as problem:
        sys.exit(f"bench: {problem}")
