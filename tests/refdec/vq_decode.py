#!/usr/bin/env python3
"""Reference decoder of VQ files, written from formats/FORMAT.md alone. Python 3.9 or later, nothing else.

    vq_decode.py FILE.vqv OUT.raw    write the voxels, x fastest
    vq_decode.py --info FILE.vqv     print what the headers say as JSON

It is meant to be read and to be trusted, not to be fast. Section numbers are those of FORMAT.md.
Exit codes: 0 done, 2 usage, 3 the file is unreadable, corrupt or unsupported, 4 cannot write, 5 too large.
"""

import argparse
import json
import math
import struct
import sys

from container import Container, Refused, Volume, require

VQ = 2
RBUC, PACKED = 1, 2
DIRECT, INDIRECT = 1, 2
CODEBOOKS = {1: "rbuc", 2: "packed"}
MAPPINGS = {1: "direct", 2: "indirect"}
SEEDINGS = {0: None, 1: "furthest", 2: "d2"}
GREATEST = {"DENSITY8": 255, "DENSITY16": 65535, "BITMAP": 1}
CHUNK = 1 << 20


def divide_up(a, b):
    return -(-a // b)


def bits_at(data, position, count):
    """`count` bits from bit `position` of the bytes on, least significant first (section 3)."""
    first, last = position // 8, divide_up(position + count, 8)
    return int.from_bytes(data[first:last], "little") >> position % 8 & (1 << count) - 1


class Vq:
    """The parameters of a VQ file, its offset volume and its codebook."""

    def __init__(self, container):
        require(container.codec == VQ, "header: byte 10: codec {}, expected 2 (VQ)", container.codec)
        self.container, self.volume = container, Volume(container)
        require(self.volume.format in GREATEST or self.volume.format == "FLOAT32",
                "chunk VOLI: voxel format {} in a VQ file", self.volume.format)
        self.read_parameters(container.only(b"VQPM"))
        self.bricks = tuple(divide_up(d, 4) for d in self.volume.dims)
        self.blocks = tuple(divide_up(d, 16) for d in self.volume.dims)
        places = self.bricks[0] * self.bricks[1] * self.bricks[2]
        require(1 <= self.count <= places, "chunk VQPM: {} bricks in the codebook for {} places", self.count, places)
        self.read_chunks()

    # Section 3.1
    def read_parameters(self, chunk):
        at = chunk.offset
        require(chunk.length == 128, "chunk VQPM: byte {}: {} bytes, expected 128", at, chunk.length)
        (self.codebook, self.mapping, self.bits, self.seeding, self.iterations, self.count, self.common, self.base,
         self.step, self.max_error, self.unique, self.offset_bytes, self.codebook_bytes,
         self.widest, special) = self.container.unpack("<4BIQQ3dQQQII", at)
        require(special <= 1 << self.bits, "chunk VQPM: byte {}: code {} for no value", at + 76, special - 1)
        require(special == 0 or self.volume.format == "FLOAT32" or self.volume.fill is not None,
                "chunk VQPM: byte {}: a code for a fill value, and none", at + 76)
        self.special = special - 1 if special else None
        require(self.codebook in CODEBOOKS, "chunk VQPM: byte {}: codebook {}", at, self.codebook)
        require(self.mapping in MAPPINGS, "chunk VQPM: byte {}: mapping {}", at + 1, self.mapping)
        require(self.mapping == INDIRECT or self.codebook == RBUC,
                "chunk VQPM: byte {}: mapping direct of a packed codebook", at + 1)
        require(1 <= self.bits <= 16, "chunk VQPM: byte {}: {} bits", at + 2, self.bits)
        require(math.isfinite(self.base) and math.isfinite(self.step), "chunk VQPM: byte {}: base or step", at + 24)
        if self.volume.format == "FLOAT32":
            require(self.step > 0, "chunk VQPM: byte {}: step {}", at + 32, self.step)
        else:
            require(self.base == int(self.base) and -65535 <= self.base <= 131070,
                    "chunk VQPM: byte {}: base {}", at + 24, self.base)
            require(self.step == int(self.step) and 1 <= self.step <= 131071,
                    "chunk VQPM: byte {}: step {}", at + 32, self.step)
        self.range_bytes, self.plain_bytes = divide_up(2 * self.bits, 8), 8 * self.bits

    # Section 3.2
    def read_chunks(self):
        def parts(kind):
            chunks = [chunk for chunk in self.container.chunks.values() if chunk.kind == kind]
            chunks.sort(key=lambda chunk: chunk.part)
            require([(c.index, c.part) for c in chunks] == [(0, i) for i in range(len(chunks))],
                    "chunks {}: expected index 0 and parts without gaps", kind.decode())
            return [self.container.data[c.offset:c.offset + c.length] for c in chunks]

        def require_lengths(kind, chunks, lengths):
            require([len(c) for c in chunks] == lengths, "chunks {}: lengths other than the text gives", kind)

        def split(count, of_a_part, size):
            return [min(of_a_part, count - first) * size for first in range(0, count, of_a_part)]

        self.offsets, self.addresses, self.code = parts(b"OFFS"), parts(b"ADDR"), parts(b"CODE")
        blocks = self.blocks[0] * self.blocks[1] * self.blocks[2]
        require(len(self.offsets) == divide_up(blocks, 4096), "chunks OFFS: {} of them", len(self.offsets))
        for number, chunk in enumerate(self.offsets):
            self.check_offsets(chunk, min(4096, blocks - 4096 * number))
        tables = self.codebook == RBUC and self.mapping == INDIRECT
        require_lengths("ADDR", self.addresses, split(divide_up(self.count, 32), 16384, 40) if tables else [])
        if self.codebook == PACKED:
            self.brick_bytes = self.range_bytes + self.plain_bytes
            self.per_chunk = 1
            while 2 * self.per_chunk * self.brick_bytes <= CHUNK:
                self.per_chunk *= 2
            require_lengths("CODE", self.code, split(self.count, self.per_chunk, self.brick_bytes))
        else:
            require(self.code and all(1 <= len(c) <= CHUNK for c in self.code), "chunks CODE: lengths or number")

    # Section 3.3
    @staticmethod
    def check_offsets(chunk, n):
        require(len(chunk) >= 8 * (n + 1), "chunk OFFS: {} bytes for {} blocks", len(chunk), n)
        starts = [struct.unpack_from("<I", chunk, 8 * k + 4)[0] for k in range(n + 1)]
        require(starts[0] == n + 1 and 8 * starts[n] == len(chunk), "chunk OFFS: entries begin or end elsewhere")
        require(all(0 <= b - a <= 32 for a, b in zip(starts, starts[1:])), "chunk OFFS: entries of more than 32 bits")

    def id_at(self, x, y, z):
        """The id of the brick at a place of the offset volume."""
        block = (z // 4 * self.blocks[1] + y // 4) * self.blocks[0] + x // 4
        chunk, k = self.offsets[block // 4096], block % 4096
        base, start, _, end = struct.unpack_from("<4I", chunk, 8 * k)
        width = end - start
        entry = bits_at(chunk, 64 * start + width * (x % 4 + 4 * (y % 4) + 16 * (z % 4)), width)
        return base + entry - 1 if entry else self.common

    def brick_at(self, brick):
        """The bytes that may belong to the brick with this id: sections 3.3 to 3.5."""
        if self.mapping == INDIRECT:
            require(brick < self.count, "an id of {}, expected below {}", brick, self.count)
        if self.codebook == PACKED:
            at = brick % self.per_chunk * self.brick_bytes
            return self.code[brick // self.per_chunk][at:at + self.brick_bytes]
        address, length = brick, CHUNK
        if self.mapping == INDIRECT:
            group = brick // 32
            table, at = self.addresses[group // 16384], group % 16384 * 40
            lengths = table[at + 8:at + 40]
            address = struct.unpack_from("<Q", table, at)[0] + sum(lengths[:brick % 32])
            length = lengths[brick % 32]
        part, at = address // CHUNK, address % CHUNK
        require(part < len(self.code) and at < len(self.code[part]), "an address {} of no brick", address)
        if self.mapping == INDIRECT:
            require(at + length <= len(self.code[part]), "a brick that ends behind its chunk")
        return self.code[part][at:at + length]

    # Section 3.5
    def decode_brick(self, brick):
        """The 64 codes of a brick, in raster order."""
        data = self.brick_at(brick)
        require(len(data) >= self.range_bytes, "a brick that ends behind its chunk")
        least, greatest = bits_at(data, 0, self.bits), bits_at(data, self.bits, self.bits)
        require(least <= greatest, "a brick with codes from {} to {}", least, greatest)
        data = data[self.range_bytes:]
        if self.codebook == PACKED:
            return self.plain_codes(data, least, greatest)
        if least == greatest:
            return [least] * 64
        require(len(data) >= 1, "a codeword that ends behind its chunk")
        if data[0] == 255:
            return self.plain_codes(data[1:], least, greatest)
        return [least + u for u in voxels_of(residuals_of(data, greatest - least), data[0] >> 6, greatest - least)]

    def plain_codes(self, data, least, greatest):
        require(len(data) >= self.plain_bytes, "plain codes that end behind their chunk")
        codes = [bits_at(data, i * self.bits, self.bits) for i in range(64)]
        require(all(least <= c <= greatest for c in codes), "a code outside the range of its brick")
        return codes

    def value(self, code):
        """The bytes of the voxel that a code stands for (section 3)."""
        if code == self.special:
            return struct.pack("<f", math.nan) if self.volume.format == "FLOAT32" else \
                int(self.volume.fill).to_bytes(self.volume.voxel_bytes, "little")
        value = self.base + self.step * code
        if self.volume.format == "FLOAT32":
            try:
                return struct.pack("<f", value)
            except OverflowError:  # rounds to infinity
                return struct.pack("<f", math.copysign(math.inf, value))
        value = min(max(int(value), 0), GREATEST[self.volume.format])
        return value.to_bytes(self.volume.voxel_bytes, "little")


def residuals_of(data, top):
    """The residuals of a codeword, in raster order."""
    c2 = data[0] & 63
    require(c2 <= 5, "a codeword with c2 = {}", c2)
    at, residuals = 1 + c2, [0] * 64
    require(at <= len(data), "a codeword that ends behind its chunk")
    for octant in range(8):
        c1 = bits_at(data, 8 + octant * c2, c2)
        require(c1 <= 16, "a codeword with c1 = {}", c1)
        require(at + c1 <= len(data), "a codeword that ends behind its chunk")
        for i in range(8):
            x, y, z = 2 * (octant & 1) + (i & 1), (octant & 2) + (i >> 1 & 1), 2 * (octant >> 2) + (i >> 2)
            residual = bits_at(data, 8 * at + i * c1, c1)
            require(residual <= top, "a residual of {}, expected up to {}", residual, top)
            residuals[x + 4 * y + 16 * z] = residual
        at += c1
    return residuals


def voxels_of(residuals, transform, top):
    """The codes less their least, from the residuals."""
    if transform == 0:
        return residuals
    u = {}

    def plane(a, b, ab):
        return min(max(a + b - ab, 0), top)

    for i, r in enumerate(residuals):
        x, y, z = i % 4, i // 4 % 4, i // 16

        def at(dx, dy, dz):
            return u.get((x - dx, y - dy, z - dz), 0)

        a, b, c = at(1, 0, 0), at(0, 1, 0), at(0, 0, 1)
        pz, py, px = plane(a, b, at(1, 1, 0)), plane(a, c, at(1, 0, 1)), plane(b, c, at(0, 1, 1))
        p = sorted((px, py, pz))[1]
        if transform == 1:
            p = a if x else b if y else c
        elif transform == 3:
            p = pz if z == 0 else py if y == 0 else px if x == 0 else p
        e = -(r + 1) // 2 if r % 2 else r // 2
        if transform != 3:
            value = (p + e) % (top + 1)
        elif r <= 2 * min(p, top - p):
            value = p + e
        else:
            value = r if p <= top - p else top - r
        u[x, y, z] = value
    return [u[i % 4, i // 4 % 4, i // 16] for i in range(64)]


def decode(vq):
    """The voxels of the volume, x fastest."""
    dims, size = vq.volume.dims, vq.volume.voxel_bytes
    out = bytearray(dims[0] * dims[1] * dims[2] * size)
    bricks = {}  # decoded, by id
    for bz in range(vq.bricks[2]):
        for by in range(vq.bricks[1]):
            for bx in range(vq.bricks[0]):
                brick = vq.id_at(bx, by, bz)
                if brick not in bricks:
                    bricks[brick] = [vq.value(code) for code in vq.decode_brick(brick)]
                voxels = bricks[brick]
                across = min(4, dims[0] - 4 * bx)
                for z in range(min(4, dims[2] - 4 * bz)):
                    for y in range(min(4, dims[1] - 4 * by)):
                        row = b"".join(voxels[4 * y + 16 * z:4 * y + 16 * z + across])
                        at = (((4 * bz + z) * dims[1] + 4 * by + y) * dims[0] + 4 * bx) * size
                        out[at:at + len(row)] = row
    return out


# ---- The program -----------------------------------------------------------------------------------------------------


def describe(vq):
    volume = vq.volume
    return {
        "format": "voxkit", "version": vq.container.version, "codec": "vq", "dims": volume.dims,
        "voxel_format": volume.format, "sample_type": volume.sample, "spacing": volume.spacing,
        "origin": volume.origin, "slope": volume.slope, "intercept": volume.intercept,
        "range": volume.range if volume.has_range else None, "file_bytes": len(vq.container.data),
        "params": {"codebook": CODEBOOKS[vq.codebook], "bits": vq.bits, "base": vq.base, "step": vq.step,
                   "max_error": vq.max_error, "seeding": SEEDINGS.get(vq.seeding), "iterations": vq.iterations},
        "unique_bricks": vq.unique, "codewords": vq.count, "mapping": MAPPINGS[vq.mapping],
        "offset_bits": vq.widest, "offset_bytes": vq.offset_bytes, "codebook_bytes": vq.codebook_bytes,
    }


def main():
    parser = argparse.ArgumentParser(description="Reference decoder of VQ files.")
    parser.add_argument("file")
    parser.add_argument("out", nargs="?", help="where to write the voxels")
    parser.add_argument("--info", action="store_true", help="print what the headers say as JSON")
    options = parser.parse_args()
    if options.info == bool(options.out):
        parser.error("give either OUT or --info")

    def fail(code, path, message):
        print("vq_decode: {}: {}".format(path, message), file=sys.stderr)
        return code

    try:
        with open(options.file, "rb") as file:
            vq = Vq(Container(file.read()))
        if options.info:
            print(json.dumps(describe(vq), indent=2))
            return 0
        voxels = decode(vq)
    except (Refused, OSError) as error:
        return fail(3, options.file, getattr(error, "strerror", None) or error)
    except (MemoryError, OverflowError):
        return fail(5, options.file, "too large for this program, which holds the whole volume")
    try:
        with open(options.out, "wb") as file:
            file.write(vq.volume.samples(voxels))
    except OSError as error:
        return fail(4, options.out, error.strerror)
    return 0


if __name__ == "__main__":
    sys.exit(main())
