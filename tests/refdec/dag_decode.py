#!/usr/bin/env python3
"""Reference decoder of coloured surfaces, written from formats/FORMAT.md alone. Python 3.9 or later, nothing else.

    dag_decode.py FILE.dagc OUT.raw    write the voxels, RGBA, x fastest
    dag_decode.py --info FILE.dagc     print what the headers say as JSON

It decodes all that section 4 has but storages astc, bc7, jpeg and jp2, and interlaced PNG. It is meant to be read and to be trusted, not to be fast. Section numbers are those of FORMAT.md.
Exit codes: 0 done, 2 usage, 3 the file is unreadable, corrupt or unsupported, 4 cannot write, 5 too large.
"""

import argparse
import json
import struct
import sys
from itertools import islice

from attribute_decode import read_attributes
from container import Container, Refused, Volume, require
from octree_decode import Octree
from png_decode import read_png
from predicted_decode import decode_predicted
from symmetric_decode import SymmetricNodes

SURFACE = 3
CODECS = {1: "raw", 2: "fws", 3: "vws", 4: "bc1", 5: "astc", 6: "bc7", 7: "palette", 8: "jpeg", 9: "jp2", 10: "png",
          11: "predicted"}
GEOMETRIES = {0: "dag", 1: "ssvdag", 2: "octree"}
VOXELS, ALL = 1, 2
IN_NODES, BESIDE = 1, 2
WIDE = (1 << 24) - 1
HILBERT = [[tuple(map(int, pair.split(":"))) for pair in way.split()] for way in """
0:1 2:2 6:2 4:9 5:9 7:8 3:8 1:4
0:2 4:0 5:0 1:7 3:7 7:3 6:3 2:11
0:0 1:1 3:1 2:5 6:5 7:10 5:10 4:6
3:4 1:5 5:5 7:6 6:6 4:11 0:11 2:1
3:5 7:3 6:3 2:10 0:10 4:0 5:0 1:8
3:3 2:4 0:4 1:2 5:2 4:7 6:7 7:9
5:7 7:8 3:8 1:3 0:3 2:2 6:2 4:10
5:8 1:6 0:6 4:1 6:1 2:9 3:9 7:5
5:6 4:7 6:7 7:11 3:11 2:4 0:4 1:0
6:10 4:11 0:11 2:0 3:0 1:5 5:5 7:7
6:11 2:9 3:9 7:4 5:4 1:6 0:6 4:2
6:9 7:10 5:10 4:8 0:8 1:1 3:1 2:3
""".strip().split("\n")]
MORTON = [(octant, 0) for octant in range(8)]
PART, MACRO = 1 << 20, 1 << 14
MOST_VOXELS = 1 << 27


class Surface:
    """The parameters of a file, its nodes and its colours."""

    def __init__(self, container):
        require(container.codec == SURFACE, "header: byte 10: codec {}, expected 3", container.codec)
        self.container, self.volume = container, Volume(container)
        require(self.volume.format == "RGBA32", "chunk VOLI: voxel format {}", self.volume.format)
        require(max(self.volume.dims) <= 1 << 21, "chunk VOLI: a side above 2^21")
        self.read_parameters(container.only(b"DAGP"))
        self.read_nodes()
        self.read_parts()
        self.attributes = read_attributes(self)

    # Section 4.1
    def read_parameters(self, chunk):
        at = chunk.offset
        require(chunk.length == 128, "chunk DAGP: byte {}: {} bytes, expected 128", at, chunk.length)
        (self.codec, self.has_color, self.counts, self.endpoints, self.height, _, curve, self.image_curve, self.voxels, self.count,
         self.root, self.palette_size, self.threshold, self.error) = self.container.unpack("<8BQQIIdd", at)
        require(self.codec in CODECS, "chunk DAGP: byte 0: {}", self.codec)
        require(self.has_color in (VOXELS, ALL), "chunk DAGP: byte 1: {}", self.has_color)
        require(self.counts in (IN_NODES, BESIDE), "chunk DAGP: byte 2: {}", self.counts)
        require(self.endpoints in (1, 2), "chunk DAGP: byte 3: {}", self.endpoints)
        require(curve in (1, 2), "chunk DAGP: byte 6: {}", curve)
        self.hilbert = curve == 2
        require(CODECS[self.codec] != "predicted" or (self.has_color == VOXELS and not self.hilbert),
                "chunk DAGP: byte 0: predicted colours in another order")
        require(CODECS[self.codec] not in ("bc1", "png") or self.image_curve in (1, 2), "chunk DAGP: byte 7: {}", self.image_curve)
        require(CODECS[self.codec] not in ("astc", "bc7", "jpeg", "jp2"), "chunk DAGP: byte 0: {} is not supported by this decoder",
                CODECS[self.codec])
        height = 2
        while 1 << height < max(self.volume.dims):
            height += 1
        require(self.height == height, "chunk DAGP: byte 4: height {}, expected {}", self.height, height)
        require(self.voxels <= self.count <= self.voxels * (height + 1), "chunk DAGP: {} colours", self.count)
        self.geometry = self.container.unpack("<B", at + 91)[0]
        require(self.geometry in GEOMETRIES, "chunk DAGP: byte 91: {}", self.geometry)
        require(GEOMETRIES[self.geometry] != "octree" or self.root == 0, "chunk DAGP: byte 24: {}", self.root)
        require(GEOMETRIES[self.geometry] != "ssvdag" or self.counts == IN_NODES, "chunk DAGP: byte 2: {}", self.counts)

    def words(self, kind, index, letter, size):
        found = [c for c in self.container.chunks.values() if c.kind == kind and c.index == index]
        require(len(found) == 1 and found[0].part == 0, "chunks {} {}: expected one", kind.decode(), index)
        chunk = found[0]
        require(chunk.length % size == 0, "chunk {} {}: {} bytes", kind.decode(), index, chunk.length)
        return self.container.unpack("<%d%s" % (chunk.length // size, letter), chunk.offset)

    # Sections 4.2 and 4.3, 4.9 or 4.10
    def read_nodes(self):
        """`other` has children() and word() of a geometry that is not that of sections 4.2 and 4.3."""
        self.other = None
        if GEOMETRIES[self.geometry] == "octree":
            self.other, self.root = Octree(self.container, self.height, self.voxels), 0
            return
        symmetric = GEOMETRIES[self.geometry] == "ssvdag"
        kind, not_here = (b"SNOD", b"NODE") if symmetric else (b"NODE", b"SNOD")
        require(not any(c.kind in (b"OCTD", b"MASK", not_here) for c in self.container.chunks.values()),
                "chunks OCTD, MASK and {}: beside a DAG with {}", not_here.decode(), kind.decode())
        self.leaves = self.words(b"LEAF", 0, "Q", 8)
        require(self.leaves, "chunk LEAF: no words")
        self.nodes = {h: self.words(kind, h, "B" if symmetric else "I", 1 if symmetric else 4) for h in range(3, self.height + 1)}
        indices = [c.index for c in self.container.chunks.values() if c.kind == kind]
        require(sorted(indices) == list(range(3, self.height + 1)), "chunks {}: indices {}", kind.decode(), sorted(indices))
        if symmetric:
            require(len(self.leaves) <= 1 << 28, "chunk LEAF: {} words", len(self.leaves))
            self.other = SymmetricNodes(self.leaves, {h: bytes(nodes) for h, nodes in self.nodes.items()}, self.height)
            self.root = self.root & (1 << 29) - 1, self.root >> 29

    def children(self, h, pointer):
        """(octant, pointer) of all octants of a node that have voxels."""
        if self.other:
            return self.other.children(h, pointer)
        words = self.nodes[h]
        require(pointer < len(words), "chunk NODE {}: no word {}", h, pointer)
        octants = [o for o in range(8) if words[pointer] >> o & 1]
        stride = 2 if self.counts == BESIDE else 1
        require(pointer + 1 + stride * len(octants) <= len(words), "chunk NODE {}: a node ends behind it", h)
        return [(o, words[pointer + 1 + stride * i]) for i, o in enumerate(octants)]

    def word(self, pointer):
        """A cell of height 2."""
        if self.other:
            return self.other.word(pointer)
        require(pointer < len(self.leaves), "chunk LEAF: no word {}", pointer)
        return self.leaves[pointer]

    # Section 4.4
    def walk(self):
        """(x, y, z, number of its colour) of all voxels: by counting, not by the file's counts."""
        number = 0

        def ordered(way):
            return HILBERT[way] if self.hilbert else MORTON

        def cell(h, pointer, x, y, z, way):
            nonlocal number
            if h == 2:
                yield from inside(2, self.word(pointer), x, y, z, way)
                return
            if self.has_color == ALL:
                number += 1
            half = 1 << h - 1
            children = dict(self.children(h, pointer))
            for octant, next_way in ordered(way):
                if octant in children:
                    yield from cell(h - 1, children[octant], x + half * (octant & 1), y + half * (octant >> 1 & 1),
                                    z + half * (octant >> 2), next_way)

        def inside(h, bits, x, y, z, way):
            nonlocal number
            if bits == 0:
                return
            number += 1 if h == 0 or self.has_color == ALL else 0
            if h == 0:
                yield x, y, z, number - 1
                return
            width, half = 8 ** (h - 1), 1 << h - 1
            for octant, next_way in ordered(way):
                yield from inside(h - 1, bits >> octant * width & (1 << width) - 1, x + half * (octant & 1),
                                  y + half * (octant >> 1 & 1), z + half * (octant >> 2), next_way)

        if self.voxels and GEOMETRIES[self.geometry] == "octree":
            self.other.read_masks()
        if self.voxels:
            yield from cell(self.height, self.root, 0, 0, 0, 0)
        self.counted = number

    # Section 4.5
    def read_parts(self):
        chunks = sorted((c for c in self.container.chunks.values() if c.kind == b"COLR"), key=lambda c: c.part)
        parts = -(-self.count // PART)
        require([(c.index, c.part) for c in chunks] == [(0, i) for i in range(parts)], "chunks COLR: not their parts")
        if CODECS[self.codec] == "palette":
            self.read_palette()
        if CODECS[self.codec] == "predicted":
            # A damaged DAG may have any number of voxels.
            self.places = [place for *place, _ in islice(self.walk(), self.count + 1)]
            require(len(self.places) == self.count, "{} voxels: expected {}", len(self.places), self.count)
        self.colors = []
        for chunk in chunks:
            data = self.container.data[chunk.offset:chunk.offset + chunk.length]
            n = min(PART, self.count - PART * chunk.part)
            first = PART * chunk.part
            read = {"raw": self.raw, "bc1": self.bc1, "palette": self.palettes, "png": self.png,
                    "predicted": lambda data, n: decode_predicted(data, self.places[first:first + n])}.get(CODECS[self.codec], self.part)
            self.colors += read(data, n)

    @staticmethod
    def raw(data, n):
        require(len(data) == 3 * n, "chunk COLR: {} bytes of {} colours", len(data), n)
        return [tuple(data[3 * i:3 * i + 3]) for i in range(n)]

    # Section 4.6
    def pixel(self, i):
        x = y = 0
        for k in range(10):
            q, s = i >> 2 * k & 3, 1 << k
            if self.image_curve == 1:
                x, y = x + s * (q & 1), y + s * (q >> 1)
            else:
                x, y = ((y, x), (x, y + s), (x + s, y + s), (2 * s - 1 - y, s - 1 - x))[q]
        return x, y

    def bc1(self, data, n):
        require(len(data) == 8 * -(-n // 16), "chunk COLR: {} bytes of {} colours", len(data), n)
        colors = []
        for i in range(n):
            if i % 16 == 0:
                c0, c1, values = struct.unpack_from("<HHI", data, i // 2)
                a, b = ((8 * (c >> 11) + (c >> 11) // 4, 4 * (c >> 5 & 63) + (c >> 5 & 63) // 16, 8 * (c & 31) + (c & 31) // 4)
                        for c in (c0, c1))
                mixed = lambda u, v: tuple((u * p + v * q) // (u + v) for p, q in zip(a, b))
                steps = [a, b] + ([mixed(2, 1), mixed(1, 2)] if c0 > c1 else [mixed(1, 1), (0, 0, 0)])
            x, y = self.pixel(i)
            colors.append(steps[values >> 2 * (x % 4 + 4 * (y % 4)) & 3])
        return colors

    # Section 4.7
    def read_palette(self):
        chunk, size = self.container.only(b"PALT"), self.palette_size
        require(size <= 65536 and (size == 0) == (self.count == 0), "chunk DAGP: byte 28: {}", size)
        require(chunk.length == 3 * size, "chunk PALT: {} bytes of {} colours", chunk.length, size)
        self.palette = self.raw(self.container.data[chunk.offset:chunk.offset + chunk.length], size)

    def palettes(self, data, n):
        return [self.palette[i] for i in self.numbers(data, n, self.palette_size)]

    def numbers(self, data, n, palette_size):
        """Those of n colours in a palette of that size."""
        g, m = max(palette_size - 1, 0).bit_length(), -(-n // MACRO)
        require(len(data) >= 16 + 8 * m, "chunk COLR: {} bytes", len(data))
        b, e = struct.unpack_from("<II", data)
        first_entry = 8 + 8 * m + 7 * b
        x = first_entry + -(-e * g // 8)
        require(x + 8 <= len(data), "chunk COLR: {} blocks and {} entries in {} bytes", b, e, len(data))
        entry_bits, index_bits = int.from_bytes(data[first_entry:x], "little"), int.from_bytes(data[x:-8], "little")
        end = 8 * (len(data) - x - 8)
        entries = [entry_bits >> g * i & (1 << g) - 1 for i in range(e)]
        heads = [struct.unpack_from("<II", data, 8 + 8 * k) for k in range(m)] + [(b, 0)]
        firsts = [first for first, _ in heads]
        require(firsts[0] == 0 and all(s < t for s, t in zip(firsts, firsts[1:])), "chunk COLR: macro blocks out of order")
        numbers = []
        for k in range(m):
            size, bit = min(MACRO, n - MACRO * k), heads[k][1]
            words = [int.from_bytes(data[8 + 8 * m + 7 * j:15 + 8 * m + 7 * j], "little") for j in range(firsts[k], firsts[k + 1])]
            starts = [word & 0x3FFF for word in words] + [size]
            require(starts[0] == 0 and all(s < t for s, t in zip(starts, starts[1:])), "chunk COLR: blocks of macro block {}", k)
            for word, s, t in zip(words, starts, starts[1:]):
                v, q, a = word >> 14 & 15, word >> 18 & 0x3FFFF, word >> 36
                if v == 0:
                    numbers += [a] * (t - s)
                    continue
                w = g if v == 15 else v
                require(bit + q + w * (t - s) <= end, "chunk COLR: indices behind the end")
                run = index_bits >> bit + q & (1 << w * (t - s)) - 1
                indices = [run >> w * i & (1 << w) - 1 for i in range(t - s)]
                require(v == 15 or a + max(indices) < e, "chunk COLR: entries behind the end")
                numbers += indices if v == 15 else [entries[a + i] for i in indices]
        require(max(numbers) < palette_size, "chunk COLR: no colour {}", max(numbers))
        return numbers

    # Section 4.8
    def png(self, data, n):
        pixels = [self.pixel(i) for i in range(n)]
        width, height = max(x for x, _ in pixels) + 1, max(y for _, y in pixels) + 1
        rows = read_png(data, width, height)
        return [rows[y][x] for x, y in pixels]

    def part(self, data, n):
        return self.blocks(data, n, self.endpoints)

    @staticmethod
    def blocks(data, n, endpoints):
        """n values; those of attributes may have one or two bytes (section 4.11)."""
        own = {1: 3, 2: 3, 3: 1, 4: 2}[endpoints]
        h, m = (8 if endpoints == 1 else 4 + 2 * own), -(-n // MACRO)
        require(len(data) >= 16 + 16 * m, "chunk COLR: {} bytes", len(data))
        b = struct.unpack_from("<I", data)[0]
        start = (8 + 16 * m + h * b + 7) // 8 * 8
        require(start + 8 <= len(data), "chunk COLR: {} blocks in {} bytes", b, len(data))
        weights = int.from_bytes(data[start:-8], "little")
        end = 8 * (len(data) - start - 8)
        heads = [struct.unpack_from("<QQ", data, 8 + 16 * k) for k in range(m)] + [(b, 0)]
        firsts = [first & (1 << 63) - 1 for first, _ in heads]
        require(firsts[0] == 0 and firsts == sorted(firsts), "chunk COLR: macro blocks out of order")
        colors = []
        for k in range(m):
            size, (first, bit) = min(MACRO, n - MACRO * k), heads[k]
            if first >> 63:
                require(firsts[k] == firsts[k + 1] and bit % 8 == 0 and bit + 8 * own * size <= end,
                        "chunk COLR: macro block {}", k)
                at = start + bit // 8
                colors += [tuple(data[at + own * i:at + own * i + own]) for i in range(size)]
                continue
            headers = [data[8 + 16 * m + h * j:8 + 16 * m + h * (j + 1)] for j in range(firsts[k], firsts[k + 1])]
            starts = [struct.unpack_from("<I", header)[0] & 0x3FFF for header in headers] + [size]
            require(headers and starts[0] == 0 and all(s < t for s, t in zip(starts, starts[1:])),
                    "chunk COLR: blocks of macro block {}", k)
            for header, s, t in zip(headers, starts, starts[1:]):
                colors += Surface.block(header, t - s, weights, bit, end, endpoints, own)
        return colors

    @staticmethod
    def block(header, size, weights, bit, end, endpoints, own):
        word = struct.unpack_from("<I", header)[0]
        w, q = (word >> 14 & 3) + 1, word >> 16
        if q == 65535:
            if endpoints != 1:
                return [tuple(header[4:4 + own])] * size
            v = struct.unpack_from("<I", header, 4)[0]
            return [((255 * (v & 1023) + 511) // 1023, (255 * (v >> 10 & 4095) + 2047) // 4095,
                     (255 * (v >> 22) + 511) // 1023)] * size
        if endpoints != 1:
            ends = tuple(header[4:4 + own]), tuple(header[4 + own:])
        else:
            ends = [(8 * (v & 31) + (v & 31) // 4, 4 * (v >> 5 & 63) + (v >> 5 & 63) // 16, 8 * (v >> 11) + (v >> 11) // 4)
                    for v in struct.unpack_from("<HH", header, 4)]
        most = (1 << w) - 1
        require(bit + q + w * size <= end, "chunk COLR: weights behind the end")
        steps = [tuple((2 * (a * (most - v) + c * v) + most) // (2 * most) for a, c in zip(*ends)) for v in range(most + 1)]
        return [steps[weights >> bit + q + w * i & most] for i in range(size)]


def alpha(surface, number):
    return max(1, surface.attributes["opacity"][number][0]) if "opacity" in surface.attributes else 255


def decode(surface):
    x, y, z = surface.volume.dims
    out = bytearray(4 * x * y * z)
    found = 0
    for vx, vy, vz, number in surface.walk():
        require(vx < x and vy < y and vz < z, "a voxel at {},{},{}: outside the volume", vx, vy, vz)
        require(number < surface.count, "colour {} of {}", number, surface.count)
        at = 4 * ((vz * y + vy) * x + vx)
        out[at:at + 4] = bytes(surface.colors[number]) + bytes([alpha(surface, number)])
        found += 1
    require(found == surface.voxels and surface.counted == surface.count, "{} voxels and {} colours: expected {} and {}",
            found, surface.counted, surface.voxels, surface.count)
    return out


def info(surface):
    return {"dims": surface.volume.dims, "codec": CODECS[surface.codec], "colors": surface.has_color,
            "counts": surface.counts, "endpoints": surface.endpoints, "height": surface.height, "geometry": GEOMETRIES[surface.geometry],
            "attributes": list(surface.attributes), "leaf_voxels": surface.voxels, "color_count": surface.count, "threshold": surface.threshold}


def main():
    parser = argparse.ArgumentParser(description="Decodes a coloured surface.")
    parser.add_argument("--info", action="store_true")
    parser.add_argument("file")
    parser.add_argument("out", nargs="?")
    options = parser.parse_args()
    if options.info == (options.out is not None):
        parser.error("expected FILE OUT, or --info FILE")
    try:
        with open(options.file, "rb") as file:
            surface = Surface(Container(file.read()))
        if options.info:
            print(json.dumps(info(surface)))
            return 0
        x, y, z = surface.volume.dims
        if x * y * z > MOST_VOXELS:
            print("{}: too many voxels".format(options.file), file=sys.stderr)
            return 5
        data = decode(surface)
    except (Refused, OSError) as error:
        print("{}: {}".format(options.file, error), file=sys.stderr)
        return 3
    try:
        with open(options.out, "wb") as file:
            file.write(data)
    except OSError as error:
        print("{}: {}".format(options.out, error), file=sys.stderr)
        return 4
    return 0


if __name__ == "__main__":
    sys.exit(main())
