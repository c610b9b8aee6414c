#!/usr/bin/env python3
"""Reference decoder of SVMM files of layout packed, written from formats/FORMAT.md. Python 3.9 or later, nothing else.

    packed_decode.py FILE.svmm OUT.raw [--level N]    write the voxels of level N (default 0), x fastest
    packed_decode.py --info FILE.svmm                 print what the headers say as JSON

It is meant to be read and to be trusted, not to be fast: some ten thousand voxels a second. Section numbers are those
of FORMAT.md. Exit codes: 0 done, 2 usage, 3 the file is unreadable, corrupt or unsupported, 4 cannot write, 5 too large.
"""

import argparse
import json
import math
import struct
import sys

from container import Container, Refused, Volume, require
from page_decode import Model, decode_page

SVMM = 1
INTEGERS, ORDERED, STEPS = 1, 2, 3
CODES = {1: "integers", 2: "ordered", 3: "steps"}
CODE_BYTES = {"DENSITY8": 1, "DENSITY16": 2, "FLOAT32": 4, "BITMAP": 1}
GREATEST = {"DENSITY8": 255, "DENSITY16": 65535, "FLOAT32": 2**32 - 1, "BITMAP": 1}
GREATEST_FLOAT = (2 - 2.0**-23) * 2.0**127
SPECIAL = [bytes.fromhex(bits)[::-1] for bits in ("7fc00000", "ff800000", "7f800000")]


def divide_up(a, b):
    return -(-a // b)


class Packed:
    """Section 2.6: the parameters of a file, its models, and where its pages are."""

    def __init__(self, container):
        require(container.codec == SVMM, "header: byte 10: codec {}, expected 1 (SVMM)", container.codec)
        self.container, self.volume = container, Volume(container)
        chunk = container.only(b"PAKP")
        at = chunk.offset
        require(chunk.length == 64, "chunk PAKP: byte {}: {} bytes, expected 64", at, chunk.length)
        log_side, self.count, self.codes = container.unpack("<3B", at)
        self.lo, self.step, self.max_error = container.unpack("<3d", at + 8)
        fmt = self.volume.format
        require(fmt in CODE_BYTES, "chunk VOLI: layout packed with {}", fmt)
        require(log_side in (3, 4), "chunk PAKP: byte {}: pages of 2^{}", at, log_side)
        self.side = 1 << log_side
        most = 1
        while max(self.dims(most - 1)) > self.side:
            most += 1
        require(self.count in (1, most), "chunk PAKP: byte {}: {} levels, expected 1 or {}", at + 1, self.count, most)
        require(self.codes in ((ORDERED, STEPS) if fmt == "FLOAT32" else (INTEGERS,)), "chunk PAKP: byte {}: codes {} of {}",
                at + 2, self.codes, fmt)
        require(self.codes != STEPS or math.isfinite(self.lo) and 0 < self.step < math.inf,
                "chunk PAKP: byte {}: steps of {} from {}", at + 8, self.step, self.lo)
        self.check_chunks()
        self.models = []  # of each level
        for level in range(self.count):
            own = (b"MODL", level, 0) in container.chunks
            self.models.append(self.read_model(level) if own else self.models[-1] if self.models else None)
        require(self.models[self.finest] is not None, "chunk table: chunk MODL {} is missing", self.finest)
        require(not self.models[-1].parents, "chunks MODL: the model of level {} has parents", self.count - 1)
        self.known = {}  # levels that were decoded, as codes

    def dims(self, level):
        return tuple(divide_up(d, 1 << level) for d in self.volume.dims)

    def pages(self, level):
        """How many pages there are along each axis."""
        return tuple(divide_up(d, self.side) for d in self.dims(level))

    def part_pages(self):
        return (1 << 19) // self.side**3

    def check_chunks(self):
        unused = {key for key in self.container.chunks if key[0] in (b"MODL", b"PAGE")}
        unused -= {(b"MODL", level, 0) for level in range(self.count)}
        # A file that was cut has no pages of the finest levels.
        there = {level for kind, level, _ in unused if kind == b"PAGE" and level < self.count}
        self.finest = min(there, default=self.count - 1)
        for level in range(self.finest, self.count):
            parts = divide_up(math.prod(self.pages(level)), self.part_pages())
            require(parts <= len(unused), "chunk table: level {}: parts of chunk PAGE are missing", level)
            for part in range(parts):
                require((b"PAGE", level, part) in unused, "chunk table: level {}: part {} of chunk PAGE is missing", level, part)
                unused.remove((b"PAGE", level, part))
        require(not unused, "chunk table: {} chunks MODL or PAGE belong to no level", len(unused))

    def content(self, key):
        chunk = self.container.chunks[key]
        return bytes(self.container.data[chunk.offset:chunk.offset + chunk.length])

    def read_model(self, index):
        try:
            model = Model(self.content((b"MODL", index, 0)))
        except Refused as error:
            raise Refused("chunk MODL {}: {}".format(index, error)) from None
        require(model.greatest_sample <= GREATEST[self.volume.format], "chunk MODL {}: samples up to {}", index,
                model.greatest_sample)
        return model

    def read_part(self, level, part):
        """The bytes of its pages."""
        data = self.content((b"PAGE", level, part))
        count = min(self.part_pages(), math.prod(self.pages(level)) - part * self.part_pages())
        where = "chunk PAGE {}.{}: ".format(level, part)
        require(data and data[0] <= 24, where + "lengths of too many bits")
        width = data[0]
        at = 1 + divide_up(count * width, 8)
        lengths = int.from_bytes(data[1:at], "little")
        pages = []
        for i in range(count):
            length = lengths >> i * width & (1 << width) - 1
            pages.append(data[at:at + length])
            at += length
        require(at == len(data), where + "lengths of pages that do not add up")
        return pages

    def codes_of(self, level):
        """Of each page of a level: its corner, its shape and its codes."""
        require(level >= self.finest, "level {}: its chunks PAGE are missing: the file was cut", level)
        if level in self.known:
            return self.known[level]
        dims, grid, side, model = self.dims(level), self.pages(level), self.side, self.models[level]
        if model.parents:
            above, above_grid = self.codes_of(level + 1), self.pages(level + 1)
        out = []
        for part in range(divide_up(math.prod(grid), self.part_pages())):
            for page in self.read_part(level, part):
                x, y, z = len(out) % grid[0], len(out) // grid[0] % grid[1], len(out) // (grid[0] * grid[1])
                corner = side * x, side * y, side * z
                shape = tuple(min(side, d - c) for c, d in zip(corner, dims))
                parents = None
                if model.parents:
                    _, parents_shape, parents = above[(z // 2 * above_grid[1] + y // 2) * above_grid[0] + x // 2]
                    parents = parents, parents_shape, tuple(i % 2 * side // 2 for i in (x, y, z))
                try:
                    out.append((corner, shape, decode_page(model, page, shape, parents)))
                except Refused as error:
                    raise Refused("level {}, page at {}: {}".format(level, corner, error)) from None
        self.known[level] = out
        return out

    def stored(self, code):
        """The bytes of a voxel."""
        if self.codes == INTEGERS:
            return code.to_bytes(CODE_BYTES[self.volume.format], "little")
        if self.codes == ORDERED:
            return (code - 2**31 if code >= 2**31 else 2**32 - 1 - code).to_bytes(4, "little")
        if code < 3:
            return SPECIAL[code]
        value = self.lo + (code - 3) * self.step
        return struct.pack("<f", min(max(value, -GREATEST_FLOAT), GREATEST_FLOAT))


def decode(packed, level):
    """The voxels of a level."""
    dims, size = packed.dims(level), packed.volume.voxel_bytes
    out, known = bytearray(math.prod(dims) * size), {}
    for corner, shape, codes in packed.codes_of(level):
        for code in set(codes) - known.keys():
            known[code] = packed.stored(code)
        for row in range(shape[1] * shape[2]):
            y, z = corner[1] + row % shape[1], corner[2] + row // shape[1]
            at = ((z * dims[1] + y) * dims[0] + corner[0]) * size
            voxels = b"".join(known[code] for code in codes[row * shape[0]:(row + 1) * shape[0]])
            out[at:at + len(voxels)] = voxels
    return out


# ---- The program -----------------------------------------------------------------------------------------------------


def describe(packed):
    volume = packed.volume
    return {
        "format": "voxkit", "version": packed.container.version, "codec": "svmm", "dims": volume.dims,
        "voxel_format": volume.format, "sample_type": volume.sample, "spacing": volume.spacing, "origin": volume.origin,
        "slope": volume.slope, "intercept": volume.intercept, "range": volume.range if volume.has_range else None,
        "raw_bytes": math.prod(volume.dims) * volume.voxel_bytes, "file_bytes": len(packed.container.data),
        "params": {"layout": "packed", "page_side": packed.side, "codes": CODES[packed.codes], "max_error": packed.max_error},
        "palettes": [len(m.palette) if m.has_palette else None for m in packed.models[packed.finest:]],
        "levels": [{"index": k, "dims": packed.dims(k), "pages": packed.pages(k)} for k in range(packed.finest, packed.count)],
    }


def main():
    parser = argparse.ArgumentParser(description="Reference decoder of SVMM files of layout packed.")
    parser.add_argument("file")
    parser.add_argument("out", nargs="?", help="where to write the voxels")
    parser.add_argument("--level", type=int, default=0, metavar="N", help="level to decode (default 0)")
    parser.add_argument("--info", action="store_true", help="print what the headers say as JSON")
    options = parser.parse_args()
    if options.info == bool(options.out):
        parser.error("give either OUT or --info")

    def fail(code, path, message):
        print("packed_decode: {}: {}".format(path, message), file=sys.stderr)
        return code

    try:
        with open(options.file, "rb") as file:
            packed = Packed(Container(file.read()))
        if options.info:
            print(json.dumps(describe(packed), indent=2))
            return 0
        if not 0 <= options.level < packed.count:
            return fail(2, options.file, "--level {}: expected 0 to {}".format(options.level, packed.count - 1))
        voxels = decode(packed, options.level)
    except (Refused, OSError) as error:
        return fail(3, options.file, getattr(error, "strerror", None) or error)
    except (MemoryError, OverflowError):
        return fail(5, options.file, "too large for this program, which holds the whole volume")
    try:
        with open(options.out, "wb") as file:
            file.write(packed.volume.samples(voxels))
    except OSError as error:
        return fail(4, options.out, error.strerror)
    return 0


if __name__ == "__main__":
    sys.exit(main())
