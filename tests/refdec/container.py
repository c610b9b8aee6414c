"""What all voxkit files have in common, from section 1 of formats/FORMAT.md alone: the container and the volume.

For the reference decoders beside this file. Section numbers are those of FORMAT.md.
"""

import ctypes
import ctypes.util
import math
import struct
from collections import namedtuple


class Refused(Exception):
    """The file is not one that a reader may accept."""


def require(condition, message, *values):
    if not condition:
        raise Refused(message.format(*values))


# ---- XXH64, seed 0 ---------------------------------------------------------------------------------------------------

M64 = (1 << 64) - 1
P1, P2, P3, P4, P5 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63,
                      0x27D4EB2F165667C5)


def rotate(x, bits):
    return (x << bits | x >> (64 - bits)) & M64


def mix(accumulator, lane):
    return rotate((accumulator + lane * P2) & M64, 31) * P1 & M64


def xxh64(data):
    data, length = memoryview(data), len(data)
    full = length & ~31
    h = P5
    if full:
        a, b, c, d = (P1 + P2) & M64, P2, 0, -P1 & M64
        for i, j, k, l in struct.iter_unpack("<4Q", data[:full]):
            a, b, c, d = mix(a, i), mix(b, j), mix(c, k), mix(d, l)
        h = rotate(a, 1) + rotate(b, 7) + rotate(c, 12) + rotate(d, 18)
        for lane in (a, b, c, d):
            h = ((h ^ mix(0, lane)) * P1 + P4) & M64
    h = (h + length) & M64
    words = full + (length - full) // 8 * 8
    for (lane,) in struct.iter_unpack("<Q", data[full:words]):
        h = (rotate(h ^ mix(0, lane), 27) * P1 + P4) & M64
    if length - words >= 4:
        h = (rotate(h ^ struct.unpack_from("<I", data, words)[0] * P1 & M64, 23) * P2 + P3) & M64
        words += 4
    for byte in data[words:]:
        h = rotate(h ^ byte * P5 & M64, 11) * P1 & M64
    h = (h ^ h >> 33) * P2 & M64
    h = (h ^ h >> 29) * P3 & M64
    return h ^ h >> 32


# ---- Zstandard frames, by its library --------------------------------------------------------------------------------

def unzstd(frame, length):
    """The content of a frame of `length` bytes; None unless it is one."""
    name = ctypes.util.find_library("zstd") or "libzstd.so.1"
    try:
        library = ctypes.CDLL(name)
    except OSError:
        raise Refused("the file has compressed chunks: expected libzstd to be there") from None
    library.ZSTD_getFrameContentSize.restype = ctypes.c_uint64
    library.ZSTD_decompress.restype = ctypes.c_size_t
    if library.ZSTD_getFrameContentSize(frame, ctypes.c_size_t(len(frame))) != length:
        return None
    out = ctypes.create_string_buffer(length)
    size = library.ZSTD_decompress(out, ctypes.c_size_t(length), frame, ctypes.c_size_t(len(frame)))
    return out.raw if size == length else None


# ---- Section 1: the container ----------------------------------------------------------------------------------------

Chunk = namedtuple("Chunk", "kind index part offset length checksum")
KINDS = (b"VOLI", b"VOLX", b"SVMP", b"BLKS", b"VQPM", b"OFFS", b"ADDR", b"CODE", b"DAGP", b"LEAF", b"NODE",
         b"COLR", b"ATTP", b"ATTR", b"PALT", b"PAKP", b"MODL", b"MMOD", b"PAGE", b"MASK", b"RNGE", b"CTAB", b"OCTD", b"SNOD")  # any other kind is ignored


class Container:
    """Checks all that is common to all codecs; `chunks` maps (kind, index, part) to the chunk."""

    def __init__(self, data):
        self.data = memoryview(data)
        size = len(data)
        require(size >= 8 and data[:8] == b"\x89VOX\r\n\x1a\n", "header: byte 0: not a voxkit file")
        require(size >= 128, "file: {} bytes, shorter than a header and a trailer", size)
        self.check("header", 0, 56, self.unpack("<Q", 56)[0])
        self.version, self.codec = self.unpack("<HH", 8)
        require(1 <= self.version <= 3, "header: byte 8: container version {}, expected 1 to 3", self.version)

        end = size - 64
        require(data[end:end + 8] == b"VOXTABLE", "trailer: byte {}: not found, the file is truncated", end)
        table, entries, length, table_sum = self.unpack("<4Q", end + 8)
        self.check("trailer", end, 56, self.unpack("<Q", end + 56)[0])
        require(length == size, "trailer: byte {}: file length {}, found {}", end + 24, length, size)
        require(table % 64 == 0 and 64 <= table <= end and table + 64 * entries == end,
                "trailer: byte {}: the chunk table does not end at the trailer", end + 8)
        self.check("chunk table", table, end - table, table_sum)

        self.chunks, free, expanded = {}, 64, []
        for at in range(table, end, 64):
            chunk = Chunk(*self.unpack("<4sIQQQQ", at))
            require(chunk.offset % 64 == 0, "chunk table: byte {}: offset not a multiple of 64", at + 16)
            require(free <= chunk.offset and chunk.offset + chunk.length <= table,
                    "chunk table: byte {}: chunks overlap, are out of order or leave their section", at + 16)
            free = chunk.offset + chunk.length
            if chunk.kind in KINDS:
                require(chunk[:3] not in self.chunks, "chunk table: byte {}: chunk listed twice", at)
                self.check("chunk " + chunk.kind.decode(), chunk.offset, chunk.length, chunk.checksum)
                content = self.unpack("<Q", at + 40)[0]
                if self.version >= 2 and content != 0:
                    require(chunk.length < content < chunk.length << 15, "chunk table: byte {}: {} bytes in {}", at + 40,
                            content, chunk.length)
                    stored = bytes(self.data[chunk.offset:free])
                    plain = unzstd(stored, content)
                    require(plain is not None, "chunk {}: byte {}: not a frame of {} bytes", chunk.kind.decode(), chunk.offset, content)
                    # Behind all else, so that it is found as any other.
                    chunk = chunk._replace(offset=size + sum(map(len, expanded)), length=content)
                    expanded.append(plain)
                self.chunks[chunk[:3]] = chunk
        if expanded:
            self.data = memoryview(b"".join([data, *expanded]))

    def unpack(self, layout, offset):
        return struct.unpack_from(layout, self.data, offset)

    def check(self, what, offset, length, expected):
        require(xxh64(self.data[offset:offset + length]) == expected, "{}: byte {}: checksum differs", what, offset)

    def only(self, kind):
        """The chunk of a kind of which there is exactly one."""
        found = [key for key in self.chunks if key[0] == kind]
        require(found == [(kind, 0, 0)], "chunk {}: expected exactly one, index 0, part 0", kind.decode())
        return self.chunks[found[0]]


# ---- Section 1.4: the volume -----------------------------------------------------------------------------------------

FORMATS = {1: ("RGBA32", 4), 2: ("RGB24", 3), 3: ("DENSITY8", 1), 4: ("DENSITY16", 2), 5: ("FLOAT32", 4),
           6: ("BITMAP", 1)}
SAMPLES = {1: "u8", 2: "i8", 3: "u16", 4: "i16", 5: "u32", 6: "i32", 7: "u64", 8: "i64", 9: "f32", 10: "f64", 11: "bit",
           12: "f16"}
SAMPLES_OF = {"DENSITY8": ("u8", "i8"), "DENSITY16": ("u16", "i16"), "BITMAP": ("bit",),
              "FLOAT32": ("u32", "i32", "u64", "i64", "f32", "f64")}
WIDE = {"u32": (0, 2**32), "i32": (-2**31, 2**31), "u64": (-2**63, 2**63), "i64": (-2**63, 2**63)}


class Volume:
    def __init__(self, container):
        chunk = container.only(b"VOLI")
        at = chunk.offset
        require(chunk.length == 112, "chunk VOLI: byte {}: {} bytes, expected 112", at, chunk.length)
        self.dims = x, y, z = container.unpack("<3Q", at)
        require(all(1 <= d <= 1 << 31 for d in self.dims) and x * y * z <= 1 << 62,
                "chunk VOLI: byte {}: dimensions {} out of range", at, self.dims)
        voxel, sample, self.has_range = container.unpack("<3B", at + 24)
        require(voxel in FORMATS, "chunk VOLI: byte {}: unknown voxel format {}", at + 24, voxel)
        self.format, self.voxel_bytes = FORMATS[voxel]
        self.colour = voxel <= 2
        self.sample = SAMPLES.get(sample)
        more = container.version == 3 and any(kind == b"VOLX" for kind, _, _ in container.chunks)
        allowed = SAMPLES_OF.get(self.format, tuple(SAMPLES.values())[:11])
        if more and not self.colour:
            allowed += {"FLOAT32": ("f16",), "DENSITY8": tuple(WIDE), "DENSITY16": tuple(WIDE)}.get(self.format, ())
        require(self.sample in allowed,
                "chunk VOLI: byte {}: sample type {} does not go with {}", at + 25, sample, self.format)
        require(self.has_range <= 1, "chunk VOLI: byte {}: {}, expected 0 or 1", at + 26, self.has_range)
        self.spacing, self.origin = container.unpack("<3d", at + 32), container.unpack("<3d", at + 56)
        require(all(map(math.isfinite, self.spacing + self.origin)),
                "chunk VOLI: byte {}: spacing or origin not finite", at + 32)
        self.slope, self.intercept, *self.range = container.unpack("<4d", at + 80)
        self.axes = [[self.spacing[a] if a == b else 0.0 for b in range(3)] for a in range(3)]
        self.world = self.unit = self.base = 0
        self.fill = None
        self.labels, self.description = None, ""
        if more:
            self.read_more(container)

    def samples(self, voxels):
        """What voxels stand for where samples are wider than voxels (section 1.5); else the voxels themselves."""
        if self.sample not in WIDE or self.format not in ("DENSITY8", "DENSITY16"):
            return voxels
        size = int(self.sample[1:]) // 8
        stored = memoryview(bytes(voxels)).cast("B" if self.voxel_bytes == 1 else "H")
        if self.labels is not None:
            table = [label % (1 << 8 * size) for label in self.labels]
            return b"".join(table[min(v, len(table) - 1)].to_bytes(size, "little") for v in stored)
        return b"".join(((v + self.base) % (1 << 8 * size)).to_bytes(size, "little") for v in stored)

    def read_more(self, container):
        """Section 1.5: the chunk VOLX."""
        chunk = container.only(b"VOLX")
        at = chunk.offset
        require(chunk.length >= 136, "chunk VOLX: byte {}: {} bytes, expected 136 or more", at, chunk.length)
        self.world, self.unit, _, flags, text, count = container.unpack("<4BIQ", at)
        require(self.world <= 6 and self.unit <= 7 and flags < 16, "chunk VOLX: byte {}: unknown world, unit or flag", at)
        require(text <= 4096 and count <= 65536 and (count > 0) == bool(flags & 4) and
                chunk.length == 136 + 8 * count + text, "chunk VOLX: byte {}: lengths do not add up", at + 4)
        numbers = container.unpack("<12d", at + 16)
        self.axes, self.origin = [list(numbers[3 * a:3 * a + 3]) for a in range(3)], numbers[9:]
        a, b, c = self.axes
        volume = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
        require(all(map(math.isfinite, numbers)) and volume != 0, "chunk VOLX: byte {}: no axes of a volume", at + 16)
        self.fill, self.base = container.unpack("<dq", at + 112)
        if not flags & 1:
            self.fill = None
        if count:
            require(self.format in ("DENSITY8", "DENSITY16"), "chunk VOLX: byte {}: labels of {}", at + 8, self.format)
            self.labels = container.unpack(f"<{count}q", at + 136)
            least, end = WIDE.get(self.sample, (-2**63, 2**63))
            require(all(least <= label < end for label in self.labels), "chunk VOLX: byte {}: no {}", at + 136, self.sample)
        self.description = bytes(container.data[at + 136 + 8 * count:at + chunk.length]).decode("utf-8", "replace")
