#!/usr/bin/env python3
"""Reference decoder of SVMM files, written from formats/FORMAT.md alone. Python 3.9 or later, nothing else.

    svmm_decode.py FILE.svmm OUT.raw [--level N]    write the voxels of mip level N (default 0), x fastest
    svmm_decode.py --info FILE.svmm                 print what the headers say as JSON

It is meant to be read and to be trusted, not to be fast. Section numbers are those of FORMAT.md.
Exit codes: 0 done, 2 usage, 3 the file is unreadable, corrupt or unsupported, 4 cannot write, 5 too large.
"""

import argparse
import json
import math
import struct
import sys
from collections import namedtuple
from functools import lru_cache

from container import Container, Refused, Volume, require


# ---- Section 2.1: parameters and levels ------------------------------------------------------------------------------

SVMM = 1
THESIS, PLAIN = 1, 2
RAW, BITMAP, ALPHA, GRAY, BC1 = 1, 2, 3, 4, 5
LAYOUTS = {1: "thesis", 2: "plain"}
BOUNDS = {1: "local", 2: "global"}
BASES = {1: "raw", 2: "bitmap", 3: "alpha", 4: "gray", 5: "bc1"}
BASE_FORMATS = {ALPHA: ("RGBA32",), GRAY: ("RGBA32", "RGB24"), BC1: ("RGBA32", "RGB24")}
Level = namedtuple("Level", "width chunk_log mip dims blocks block_bytes terminal")


def round_up_even(x):
    return x + (x & 1)


class Svmm:
    """The parameters of an SVMM file, and its blocks by level and number."""

    def __init__(self, container):
        require(container.codec == SVMM, "header: byte 10: codec {}, expected 1 (SVMM)", container.codec)
        self.container, self.volume = container, Volume(container)
        chunk = container.only(b"SVMP")
        at = chunk.offset
        require(chunk.length >= 128 and chunk.length % 64 == 0, "chunk SVMP: byte {}: {} bytes", at, chunk.length)
        self.layout, self.base, self.bound, self.weighted, n, self.root_width = container.unpack("<4BIQ", at)
        self.quality, self.delta, self.delta_unit = container.unpack("<3d", at + 16)
        require(n >= 1 and chunk.length == 64 + 64 * n, "chunk SVMP: byte {}: {} levels in {} bytes", at + 4, n,
                chunk.length)
        self.levels = []
        for k in range(n):
            w, c, p, x, y, z, blocks, size, terminal = container.unpack("<II7Q", at + 64 + 64 * k)
            self.levels.append(Level(w, c, p, (x, y, z), blocks, size, terminal))
        self.check_parameters(at)
        self.check_levels(at + 64)
        self.check_chunks()

    def check_parameters(self, at):
        layout, base, fmt = self.layout, self.base, self.volume.format
        require(layout in LAYOUTS, "chunk SVMP: byte {}: unknown layout {}", at, layout)
        require(layout == PLAIN or fmt in ("RGBA32", "RGB24", "DENSITY8"),
                "chunk SVMP: byte {}: layout thesis with {}", at, fmt)
        require(base in BASES, "chunk SVMP: byte {}: unknown base {}", at + 1, base)
        require(fmt in BASE_FORMATS.get(base, (fmt,)), "chunk SVMP: byte {}: base {} with {}", at + 1, BASES[base], fmt)
        require(base == RAW or len(self.levels) > 1, "chunk SVMP: byte {}: base {} of one level", at + 1, BASES[base])
        require(base != BC1 or self.levels[0].width >= 4, "chunk SVMP: byte {}: base bc1 with w = 2", at + 1)
        require(self.bound in BOUNDS, "chunk SVMP: byte {}: unknown bound {}", at + 2, self.bound)
        require(self.weighted in (0, 1), "chunk SVMP: byte {}: {}, expected 0 or 1", at + 3, self.weighted)
        require(0 <= self.delta < math.inf and 0 < self.delta_unit < math.inf,
                "chunk SVMP: byte {}: delta {} of {}", at + 24, self.delta, self.delta_unit)
        require(self.root_width >= 1, "chunk SVMP: byte {}: root width 0", at + 8)

    def check_levels(self, at):
        mip, dims = 1, tuple(map(round_up_even, self.volume.dims))
        for k, level in enumerate(self.levels):
            where = "chunk SVMP: byte {}: level {}: ".format(at + 64 * k, k)
            root = k == len(self.levels) - 1
            require(level.mip == mip, where + "mip factor {}, expected {}", level.mip, mip)
            require(level.dims == dims, where + "dimensions {}, expected {}", level.dims, dims)
            small = any if self.layout == THESIS else all
            ends = all(d <= 2 for d in dims) or small(d <= self.root_width for d in dims)
            require(ends == root, where + ("not small enough to be the root" if root else "should be the root"))
            if root:
                require(level.width == 0 and level.blocks == 1, where + "a root has block width 0 and one block")
            else:
                w = level.width
                require(2 <= w <= 1024 and w & (w - 1) == 0, where + "block width {}", w)
                mip, dims = mip * w, tuple(round_up_even(-(-d // w)) for d in dims)
            size = self.block_size(k)
            require(level.block_bytes == size, where + "blocks of {} bytes, expected {}", level.block_bytes, size)
            log = max(0, ((1 << 20) // size).bit_length() - 1)
            require(level.chunk_log == log, where + "2^{} blocks to a chunk, expected 2^{}", level.chunk_log, log)

    def block_shape(self, k):
        level = self.levels[k]
        return (level.width,) * 3 if level.width else level.dims

    def block_size(self, k):
        x, y, z = self.block_shape(k)
        subblocks, fmt = x * y * z // 8, self.volume.format
        if self.layout == THESIS and (k > 0 or self.base == RAW):
            return subblocks * (32 if self.volume.colour else 16)
        if k > 0:
            return subblocks * 8 * (self.volume.voxel_bytes + 1)
        if self.base == RAW:
            return subblocks * (1 if fmt == "BITMAP" else 8 * self.volume.voxel_bytes)
        return subblocks * {BITMAP: self.shared_bytes() + 1, ALPHA: self.shared_bytes() + 8, GRAY: 8, BC1: 4}[self.base]

    def shared_bytes(self):
        """v of section 2.5."""
        if self.levels[0].width == 2 or self.volume.format == "BITMAP":
            return 0
        return 3 if self.volume.colour else self.volume.voxel_bytes

    def check_chunks(self):
        """Section 2.2: the parts of a level are all there, nothing else is, and each has its length."""
        unused = {key for key in self.container.chunks if key[0] == b"BLKS"}
        for k, level in enumerate(self.levels):
            parts = -(-level.blocks >> level.chunk_log)  # rounded up
            require(parts <= len(unused), "chunk table: level {}: parts of chunk BLKS are missing", k)
            for part in range(parts):
                chunk = self.container.chunks.get((b"BLKS", k, part))
                require(chunk, "chunk table: level {}: part {} of chunk BLKS is missing", k, part)
                blocks = min(1 << level.chunk_log, level.blocks - (part << level.chunk_log))
                size = blocks * level.block_bytes
                require(chunk.length == size, "chunk BLKS: byte {}: level {}: {} bytes, expected {}", chunk.offset, k,
                        chunk.length, size)
                unused.remove(chunk[:3])
        require(not unused, "chunk table: {} chunks BLKS belong to no level", len(unused))

    def block_data(self, k, number):
        level = self.levels[k]
        chunk = self.container.chunks[b"BLKS", k, number >> level.chunk_log]
        start = chunk.offset + (number & (1 << level.chunk_log) - 1) * level.block_bytes
        return bytes(self.container.data[start:start + level.block_bytes])


# ---- Sections 2.4 and 2.5: blocks to voxels --------------------------------------------------------------------------
# Voxels are `bytes` objects in lists, in block order.

ALPHAS = [(2 * a * 255 + 7) // 14 for a in range(8)]  # a × 255 ÷ 7, halves up


def split(data, size):
    return [data[i:i + size] for i in range(0, len(data), size)]


def thesis_voxels(svmm, data):
    if not svmm.volume.colour:
        words = [w for (w,) in struct.iter_unpack("<H", data)]
        return words, [bytes((w >> 8,)) for w in words]
    words = [w for (w,) in struct.iter_unpack("<I", data)]
    voxels = [bytes((w >> 24, w >> 16 & 255, w >> 8 & 255, ALPHAS[w >> 5 & 7])) for w in words]
    return words, voxels if svmm.volume.voxel_bytes == 4 else [v[:3] for v in voxels]


def structural_block(svmm, data):
    """The voxels and, for each subblock, (first child, set of non-terminal voxels)."""
    if svmm.layout == THESIS:
        words, voxels = thesis_voxels(svmm, data)
        links = [(sum((w & 15) << 4 * i for i, w in enumerate(words[s:s + 8])),
                  sum((~w >> 4 & 1) << i for i, w in enumerate(words[s:s + 8]))) for s in range(0, len(words), 8)]
        return voxels, links
    voxel_bytes = svmm.volume.voxel_bytes
    cut = len(data) * voxel_bytes // (voxel_bytes + 1)
    links = [(link & (1 << 56) - 1, link >> 56) for (link,) in struct.iter_unpack("<Q", data[cut:])]
    voxels = split(data[:cut], voxel_bytes)
    if svmm.volume.format == "BITMAP":
        voxels = [b"\1" if coverage[0] >= 128 else b"\0" for coverage in voxels]
    return voxels, links


BITS = [[b"\1" if byte >> i & 1 else b"\0" for i in range(8)] for byte in range(256)]


def base_block(svmm, data, equivalent):
    """The voxels of a block of level 0; `equivalent` is the block's voxel in level 1."""
    volume, base = svmm.volume, svmm.base
    zero, opaque = bytes(volume.voxel_bytes), b"\xff" * (volume.format == "RGBA32")
    if base == RAW:
        if volume.format == "BITMAP":
            return [voxel for byte in data for voxel in BITS[byte]]
        return thesis_voxels(svmm, data)[1] if svmm.layout == THESIS else split(data, volume.voxel_bytes)
    if base == GRAY:
        lumas = [zero] + [bytes((l, l, l)) + opaque for l in range(1, 256)]
        return [lumas[l] for l in data]
    if base == BC1:
        return bc1_block(data, svmm.levels[0].width, zero, opaque)
    if volume.format == "BITMAP":  # base bitmap: an occupied voxel is 1
        return [voxel for byte in data for voxel in BITS[byte]]
    v = svmm.shared_bytes()
    equivalent = equivalent[:3] if volume.colour else equivalent
    voxels = []
    for sub in split(data, v + (1 if base == BITMAP else 8)):
        shared = sub[:v] or equivalent
        if base == BITMAP:
            pair = (zero, shared + opaque)
            voxels += [pair[sub[v] >> i & 1] for i in range(8)]
        else:
            voxels += [shared + sub[i:i + 1] if sub[i] else zero for i in range(v, v + 8)]
    return voxels


@lru_cache(maxsize=None)
def block_order(X, Y, Z):
    """For the voxels of a block, x fastest: where they are in block order (section 2.2)."""
    return [8 * ((z // 2 * (Y // 2) + y // 2) * (X // 2) + x // 2) + z % 2 * 4 + y % 2 * 2 + x % 2
            for z in range(Z) for y in range(Y) for x in range(X)]


def rgb565(c):
    r, g, b = c >> 11, c >> 5 & 63, c & 31
    return 8 * r + r // 4, 4 * g + g // 16, 8 * b + b // 4


def bc1_block(data, w, zero, opaque):
    order, voxels, tiles = block_order(w, w, w), [zero] * w ** 3, struct.iter_unpack("<HHI", data)
    for z in range(w):
        for y in range(0, w, 4):
            for x in range(0, w, 4):
                c0, c1, indices = next(tiles)
                a, b = rgb565(c0), rgb565(c1)
                palette = [bytes(a) + opaque, bytes(b) + opaque]
                if c0 > c1:
                    palette.append(bytes((2 * i + j) // 3 for i, j in zip(a, b)) + opaque)
                    palette.append(bytes((i + 2 * j) // 3 for i, j in zip(a, b)) + opaque)
                else:
                    palette += [bytes((i + j) // 2 for i, j in zip(a, b)) + opaque, zero]
                for pixel in range(16):
                    place = order[(z * w + y + pixel // 4) * w + x + pixel % 4]
                    voxels[place] = palette[indices >> 2 * pixel & 3]
    return voxels


# ---- Section 2.3: the tree -------------------------------------------------------------------------------------------


class Canvas:
    """The decoded level: memory bytes, x fastest. Boxes beyond its edges are cut off."""

    def __init__(self, dims, voxel_bytes):
        self.dims, self.voxel_bytes = dims, voxel_bytes
        self.bytes = bytearray(dims[0] * dims[1] * dims[2] * voxel_bytes)

    def put_row(self, x, y, z, row):
        at = ((z * self.dims[1] + y) * self.dims[0] + x) * self.voxel_bytes
        self.bytes[at:at + len(row)] = row

    def fill(self, corner, width, voxel):
        if any(voxel):
            x, y, z = corner
            X, Y, Z = (min(c + width, d) for c, d in zip(corner, self.dims))
            row = voxel * (X - x)
            for j in range(z, Z):
                for i in range(y, Y):
                    self.put_row(x, i, j, row)

    def put_block(self, corner, shape, voxels):
        """Section 2.2: row (y, z) lies in every fourth pair of voxels of one row of subblocks."""
        X, Y, _ = shape
        visible = [min(s, d - c) for s, d, c in zip(shape, self.dims, corner)]
        row = [b""] * X
        for z in range(visible[2]):
            for y in range(visible[1]):
                start = (z // 2 * (Y // 2) + y // 2) * X * 4 + z % 2 * 4 + y % 2 * 2
                row[0::2] = voxels[start:start + 4 * X:8]
                row[1::2] = voxels[start + 1:start + 4 * X:8]
                self.put_row(corner[0], corner[1] + y, corner[2] + z, b"".join(row[:visible[0]]))


def decode(svmm, target):
    """The volume at mip level `target`, going down from the root one level at a time."""
    levels = svmm.levels
    canvas = Canvas(dims_at(svmm, target), svmm.volume.voxel_bytes)
    blocks = [(0, (0, 0, 0), None)]  # number, corner on level k, equivalent voxel
    for k in range(len(levels) - 1, target - 1, -1):
        shape, children = svmm.block_shape(k), []
        seen = bytearray(levels[k - 1].blocks if k else 0)
        for number, corner, equivalent in blocks:
            data = svmm.block_data(k, number)
            if k == 0:
                voxels = base_block(svmm, data, equivalent)
            else:
                voxels, links = structural_block(svmm, data)
                terminals = visit(svmm, k, (number, corner), (voxels, links), seen, children)
                if k > target:
                    scale = levels[k].mip // levels[target].mip
                    for at, voxel in terminals:
                        canvas.fill([c * scale for c in at], scale, voxel)
            if k == target:
                canvas.put_block(corner, shape, voxels)
        require(0 not in seen, "chunk BLKS: level {}: block {} is the child of no voxel", k - 1, seen.find(0))
        blocks = children
    return canvas


def visit(svmm, k, block, contents, seen, children):
    """Adds the children of a structural block; returns its terminal voxels inside the volume and their places."""
    (number, corner), (voxels, links), terminals = block, contents, []
    X, Y, _ = svmm.block_shape(k)
    inside, w = dims_at(svmm, k), svmm.levels[k - 1].width
    for s, (child, mask) in enumerate(links):
        sx = corner[0] + s % (X // 2) * 2
        sy = corner[1] + s // (X // 2) % (Y // 2) * 2
        sz = corner[2] + s // (X // 2 * (Y // 2)) * 2
        for i in range(8):
            x, y, z = sx + (i & 1), sy + (i >> 1 & 1), sz + (i >> 2)
            is_inside = x < inside[0] and y < inside[1] and z < inside[2]
            if not mask >> i & 1:
                if is_inside:
                    terminals.append(((x, y, z), voxels[8 * s + i]))
                continue
            where = "chunk BLKS: level {}: block {}: subblock {}: ".format(k, number, s)
            require(is_inside, where + "a voxel outside the volume is not terminal")
            require(child < len(seen), where + "child {} of {}", child, len(seen))
            require(not seen[child], where + "child {} is the child of two voxels", child)
            seen[child] = 1
            children.append((child, (x * w, y * w, z * w), voxels[8 * s + i]))
            child += 1
    return terminals


def dims_at(svmm, k):
    """The dimensions of the volume seen at mip level k."""
    return tuple(-(-d // svmm.levels[k].mip) for d in svmm.volume.dims)


# ---- The program -----------------------------------------------------------------------------------------------------


def describe(svmm):
    volume, size = svmm.volume, len(svmm.container.data)
    raw = volume.dims[0] * volume.dims[1] * volume.dims[2] * volume.voxel_bytes
    return {
        "format": "voxkit", "version": svmm.container.version, "codec": "svmm", "dims": volume.dims,
        "voxel_format": volume.format, "sample_type": None if volume.colour else volume.sample,
        "spacing": volume.spacing, "origin": volume.origin,
        "slope": volume.slope, "intercept": volume.intercept, "range": volume.range if volume.has_range else None,
        "raw_bytes": raw, "file_bytes": size,
        "params": {"layout": LAYOUTS[svmm.layout], "base": BASES[svmm.base], "bound": BOUNDS[svmm.bound],
                   "alpha_weight": bool(svmm.weighted), "rootwidth": svmm.root_width, "quality": svmm.quality,
                   "delta": svmm.delta, "delta_unit": svmm.delta_unit},
        "levels": [{"index": k, "blockwidth": l.width, "mip_factor": l.mip, "dims": l.dims, "blocks": l.blocks,
                    "block_bytes": l.block_bytes, "terminal_voxels": l.terminal} for k, l in enumerate(svmm.levels)],
    }


def main():
    parser = argparse.ArgumentParser(description="Reference decoder of SVMM files.")
    parser.add_argument("file")
    parser.add_argument("out", nargs="?", help="where to write the voxels")
    parser.add_argument("--level", type=int, default=0, metavar="N", help="mip level to decode (default 0)")
    parser.add_argument("--info", action="store_true", help="print what the headers say as JSON")
    options = parser.parse_args()
    if options.info == bool(options.out):
        parser.error("give either OUT or --info")

    def fail(code, path, message):
        print("svmm_decode: {}: {}".format(path, message), file=sys.stderr)
        return code

    try:
        with open(options.file, "rb") as file:
            svmm = Svmm(Container(file.read()))
        if options.info:
            print(json.dumps(describe(svmm), indent=2))
            return 0
        if not 0 <= options.level < len(svmm.levels):
            return fail(2, options.file, "--level {}: expected 0 to {}".format(options.level, len(svmm.levels) - 1))
        voxels = decode(svmm, options.level).bytes
    except (Refused, OSError) as error:
        return fail(3, options.file, getattr(error, "strerror", None) or error)
    except (MemoryError, OverflowError):
        return fail(5, options.file, "too large for this program, which holds the whole volume")
    try:
        with open(options.out, "wb") as file:
            file.write(svmm.volume.samples(voxels))
    except OSError as error:
        return fail(4, options.out, error.strerror)
    return 0


if __name__ == "__main__":
    sys.exit(main())
