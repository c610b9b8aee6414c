"""Attributes of coloured surfaces (FORMAT.md, section 4.11), by the number of a colour."""

import math
import struct

from container import require

ATTRIBUTES = (("emissive", 3), ("opacity", 1), ("normal", 2), ("rm", 2), ("id", 4))
RAW, FWS, VWS, PALETTE = 1, 2, 3, 7
PART = 1 << 20


def read_attributes(surface):
    """{name: [bytes of each value]} of those that a surface has."""
    container = surface.container
    there = container.unpack("<B", container.only(b"DAGP").offset + 92)[0]
    attributes = {}
    for a, (name, size) in enumerate(ATTRIBUTES):
        chunks = {kind: sorted((c for c in container.chunks.values() if c.kind == kind and c.index == a), key=lambda c: c.part)
                  for kind in (b"ATTP", b"ATTR")}
        parts = -(-surface.count // PART) if there >> a & 1 else 0
        require([c.part for c in chunks[b"ATTP"]] == ([0] if there >> a & 1 else []), "chunks ATTP {}: expected one", a)
        require([c.part for c in chunks[b"ATTR"]] == list(range(parts)), "chunks ATTR {}: not their parts", a)
        if not there >> a & 1:
            continue
        head = chunks[b"ATTP"][0]
        require(head.length == 64, "chunk ATTP {}: {} bytes", a, head.length)
        codec, endpoints = container.unpack("<BB", head.offset)
        require(codec in ((RAW, PALETTE) if name == "id" else (RAW, FWS, VWS)), "chunk ATTP {}: byte 0: {}", a, codec)
        if codec in (FWS, VWS):
            require(endpoints in {3: (1, 2), 1: (3,), 2: (4,)}[size], "chunk ATTP {}: byte 1: {}", a, endpoints)
        values = []
        for chunk in chunks[b"ATTR"]:
            data = container.data[chunk.offset:chunk.offset + chunk.length]
            values += part(surface, data, min(PART, surface.count - PART * chunk.part), size, codec, endpoints)
        attributes[name] = values
    return attributes


def part(surface, data, n, size, codec, endpoints):
    if len(data) == size:
        return [bytes(data)] * n
    if codec in (FWS, VWS):
        return [bytes(value) for value in surface.blocks(data, n, endpoints)]
    if codec == PALETTE:
        require(len(data) >= 4, "chunk ATTR: {} bytes", len(data))
        p = struct.unpack_from("<I", data)[0]
        require(p <= 65536 and len(data) >= 4 + 4 * p, "chunk ATTR: {} ids in {} bytes", p, len(data))
        if p > 0:
            ids = struct.unpack_from("<%dI" % p, data, 4)
            require(all(a < b for a, b in zip(ids, ids[1:])), "chunk ATTR: ids out of order")
            return [struct.pack("<I", ids[i]) for i in surface.numbers(data[4 + 4 * p:], n, p)]
        data = data[4:]
    require(len(data) == n * size, "chunk ATTR: {} bytes of {} values", len(data), n)
    return [bytes(data[size * i:size * i + size]) for i in range(n)]


def direction(value):
    """Of length 1, from the two bytes of a normal."""
    u, v = (max(b - 128, -127) for b in value)
    z = 127 - abs(u) - abs(v)
    x, y = (u, v) if z >= 0 else ((-1 if u < 0 else 1) * (127 - abs(v)), (-1 if v < 0 else 1) * (127 - abs(u)))
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
