"""PNG images of up to 8 bits a sample, without alpha, not interlaced: ISO/IEC 15948."""

import struct
import zlib

from container import require

GREY, RGB, INDEXED = 0, 2, 3


def chunks(data):
    require(data[:8] == b"\x89PNG\r\n\x1a\n", "chunk COLR: not a PNG file")
    at = 8
    while True:
        require(at + 12 <= len(data), "chunk COLR: the PNG file is cut short")
        length, kind = struct.unpack_from(">I4s", data, at)
        require(at + 12 + length <= len(data), "chunk COLR: the PNG file is cut short")
        body = data[at + 8:at + 8 + length]
        require(zlib.crc32(kind + body) == struct.unpack_from(">I", data, at + 8 + length)[0],
                "chunk COLR: PNG chunk {}: its checksum", kind)
        if kind == b"IEND":
            return
        yield kind, body
        at += 12 + length


def unfiltered(rows, stride, step):
    """Rows of bytes; each begins with its filter."""
    last = bytes(stride)
    for at in range(0, len(rows), stride + 1):
        kind, row = rows[at], bytearray(rows[at + 1:at + 1 + stride])
        require(kind <= 4, "chunk COLR: PNG filter {}", kind)
        for i in range(stride):
            a, b, c = (row[i - step] if i >= step else 0), last[i], (last[i - step] if i >= step else 0)
            p = a + b - c
            paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            row[i] = row[i] + (0, a, b, (a + b) // 2, paeth)[kind] & 255
        yield row
        last = row


def read_png(data, width, height):
    """Rows of (R, G, B); the size is what it must have."""
    found = list(chunks(data))
    require(found and found[0][0] == b"IHDR" and len(found[0][1]) == 13, "chunk COLR: PNG without IHDR")
    w, h, bits, kind, _, _, interlaced = struct.unpack(">2I5B", found[0][1])
    require((w, h) == (width, height), "chunk COLR: {} x {} pixels, expected {} x {}", w, h, width, height)
    require(kind in (GREY, RGB, INDEXED) and bits <= 8, "chunk COLR: PNG of {} bits, kind {}", bits, kind)
    require(not interlaced, "chunk COLR: interlaced PNG is not supported by this decoder")
    samples = 3 if kind == RGB else 1
    stride = -(-width * samples * bits // 8)
    inflate = zlib.decompressobj()
    try:
        rows = inflate.decompress(b"".join(body for name, body in found if name == b"IDAT"), (stride + 1) * height)
    except zlib.error:
        rows = b""
    require(len(rows) == (stride + 1) * height, "chunk COLR: PNG without all its pixels")
    table = b"".join(body for name, body in found if name == b"PLTE")
    if kind == GREY:
        table = bytes(v * 255 // ((1 << bits) - 1) for v in range(1 << bits) for _ in range(3))
    out = []
    for row in unfiltered(rows, stride, max(samples * bits // 8, 1)):
        if kind == RGB:
            out.append([tuple(row[3 * x:3 * x + 3]) for x in range(width)])
            continue
        indices = [row[x * bits // 8] >> 8 - bits - x * bits % 8 & (1 << bits) - 1 for x in range(width)]
        require(3 * max(indices) + 3 <= len(table), "chunk COLR: PNG pixel behind its palette")
        out.append([tuple(table[3 * i:3 * i + 3]) for i in indices])
    return out
