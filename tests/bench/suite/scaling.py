"""Time and memory against size: the tables of ../scaling.py, as they are."""
import shutil
import sys

from process import run


def scaling(options, table, add):
    out = options.output / "scaling"
    said = run(sys.executable, options.source / "tests" / "bench" / "scaling.py", "--bin", options.bin, "-o", out).output
    table("Scaling", said.strip(), [])
    (out / "scaling.csv").replace(options.output / "scaling.csv")
    shutil.rmtree(out)  # the volumes that it compressed, 2 GB
