#!/usr/bin/env python3
"""Puts pictures side by side: side_by_side.py OUT-%d.png ROW...

A ROW is names of pictures with commas between them. All pictures have the size of the first one; "none" is an empty
place. NAME*8 is a picture of errors: eight times its values, on white. Needs vox-convert and vox-info.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

GAP = 4  # pixels between pictures
WHITE = 255


def read(name, scratch):
    """Width, and rows of RGB bytes."""
    info = json.loads(subprocess.run(["vox-info", name, "--json"], check=True, stdout=subprocess.PIPE).stdout)
    subprocess.run(["vox-convert", name, "-o", scratch, "--force", "--quiet"], check=True)
    data = scratch.read_bytes()
    width, height, _ = info["dims"]
    if len(data) == width * height:  # gray
        data = bytes(value for value in data for _ in range(3))
    if len(data) != 3 * width * height:
        sys.exit(f"{name}: expected 8 bits of gray or of RGB")
    return width, [data[3 * width * y:3 * width * (y + 1)] for y in range(height)]


def tile(cell, scratch):
    name, _, factor = cell.partition("*")
    width, rows = read(name, scratch)
    if factor:
        amplified = bytes(WHITE - min(WHITE, int(factor) * value) for value in range(256))
        rows = [row.translate(amplified) for row in rows]
    return width, rows


def main(output, *lines):
    grid = [line.split(",") for line in lines]
    with tempfile.TemporaryDirectory(prefix="voxkit-") as folder:
        scratch = pathlib.Path(folder) / "picture.raw"
        width, first = tile(grid[0][0], scratch)
        height = len(first)
        empty = [bytes([WHITE]) * 3 * width] * height
        between = bytes([WHITE]) * 3 * GAP
        sheet = []
        for line in grid:
            tiles = [empty if cell == "none" else tile(cell, scratch)[1] for cell in line]
            if any(len(rows) != height or len(rows[0]) != 3 * width for rows in tiles):
                sys.exit(f"{','.join(line)}: expected pictures of {width} x {height} pixels")
            if sheet:
                sheet += [bytes([WHITE]) * len(sheet[0])] * GAP
            sheet += [between.join(rows[y] for rows in tiles) for y in range(height)]
        if any(len(row) != len(sheet[0]) for row in sheet):
            sys.exit("expected as many pictures in every row")
        scratch.write_bytes(b"".join(sheet))
        subprocess.run(["vox-convert", scratch, "--dims", f"{len(sheet[0]) // 3},{len(sheet)},1", "--type", "rgb8",
                        "-o", output, "--force", "--quiet"], check=True)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__.strip())
    main(*sys.argv[1:])
