#!/usr/bin/env python3
"""Reference decoder of SVMM files of layout packed, written from formats/FORMAT.md. Python 3.9 or later, nothing else.

    packed_decode.py FILE.svmm OUT.raw [--level N]    write the voxels of level N (default 0), x fastest
    packed_decode.py --info FILE.svmm                 print what the headers say as JSON

It is meant to be read and to be trusted, not to be fast: some ten thousand voxels a second. Section numbers are those
of FORMAT.md. Exit codes: 0 done, 2 usage, 3 the file is unreadable, corrupt or unsupported, 4 cannot write, 5 too large.
"""

import argparse
import itertools
import json
import math
import struct
import sys
from functools import lru_cache

from container import Container, Refused, Volume, require
from mask_decode import MaskModel, decode_mask
from page_decode import Model, decode_page

SVMM = 1
INTEGERS, ORDERED, STEPS, COLOURS, INDEXED = 1, 2, 3, 4, 5
CODES = {1: "integers", 2: "ordered", 3: "steps", 4: "colours", 5: "indexed"}
CHANNELS = {"RGBA32": 4, "RGB24": 3}
MASK = -1  # in place of a channel
page_model, mask_model = lru_cache(maxsize=64)(Model), lru_cache(maxsize=64)(MaskModel)  # of their bytes
CODE_BYTES = {"DENSITY8": 1, "DENSITY16": 2, "FLOAT32": 4, "BITMAP": 1}
GREATEST = {"DENSITY8": 255, "DENSITY16": 65535, "FLOAT32": 2**32 - 1, "BITMAP": 1}
GREATEST_FLOAT = (2 - 2.0**-23) * 2.0**127
SPECIAL = [bytes.fromhex(bits)[::-1] for bits in ("7fc00000", "ff800000", "7f800000")]


def divide_up(a, b):
    return -(-a // b)


class Packed:
    """Section 2.6: the parameters of a file, its models, and where its pages are. One that is not `strict` leaves
    unread whatever a reader may."""

    def __init__(self, container, strict=True):
        self.strict = strict
        require(container.codec == SVMM, "header: byte 10: codec {}, expected 1 (SVMM)", container.codec)
        self.container, self.volume = container, Volume(container)
        chunk = container.only(b"PAKP")
        at = chunk.offset
        require(chunk.length == 64, "chunk PAKP: byte {}: {} bytes, expected 64", at, chunk.length)
        log_side, self.count, self.codes, self.opaque, self.differences = container.unpack("<5B", at)
        self.lo, self.step, self.max_error = container.unpack("<3d", at + 8)
        fmt = self.volume.format
        self.masked = self.codes == COLOURS  # pages have masks and channels
        self.channels = CHANNELS.get(fmt, 1) if self.masked else 1
        require(log_side in (3, 4), "chunk PAKP: byte {}: pages of 2^{}", at, log_side)
        self.side = 1 << log_side
        most = 1
        while max(self.dims(most - 1)) > self.side:
            most += 1
        require(self.count in (1, most), "chunk PAKP: byte {}: {} levels, expected 1 or {}", at + 1, self.count, most)
        codes = (ORDERED, STEPS) if fmt == "FLOAT32" else (COLOURS, INDEXED) if self.volume.colour else (INTEGERS,)
        require(self.codes in codes, "chunk PAKP: byte {}: codes {} of {}", at + 2, self.codes, fmt)
        require(self.opaque <= (fmt == "RGBA32"), "chunk PAKP: byte {}: {} of {}", at + 3, self.opaque, fmt)
        require(self.differences <= self.masked, "chunk PAKP: byte {}: {} of {}", at + 4, self.differences, fmt)
        require(self.codes != STEPS or math.isfinite(self.lo) and 0 < self.step < math.inf,
                "chunk PAKP: byte {}: steps of {} from {}", at + 8, self.step, self.lo)
        self.table = self.read_table() if self.codes == INDEXED else None
        self.check_chunks()
        self.models, self.masks = [], []  # of each level: the models of its channels, and that of its masks or None
        models = masks = None  # of levels finer than the file has, where it was cut
        for level in range(self.count):
            if (b"MODL", level, 0) in container.chunks:
                models, masks = [self.read_model(level, part) for part in range(self.channels)], None
                if self.masked:
                    masks = self.named("chunk MMOD {}".format(level), mask_model, self.content((b"MMOD", level, 0)))
                    require(all(m.parents == masks.parents for m in models),
                            "level {}: only some of its models have parents", level)
            self.models.append(models)
            self.masks.append(masks)
        require(self.models[self.finest] is not None, "chunk table: chunk MODL {} is missing", self.finest)
        require(not models[0].parents, "chunks MODL: the model of level {} has parents", self.count - 1)
        self.known, self.parts = {}, {}  # pages that were decoded, and parts that were read

    def read_table(self):
        """Chunk CTAB."""
        chunk, size = self.container.only(b"CTAB"), self.volume.voxel_bytes
        require(chunk.length % size == 0 and 1 <= chunk.length // size <= 255, "chunk CTAB: {} bytes", chunk.length)
        data = self.content((b"CTAB", 0, 0))
        table = [data[i:i + size] for i in range(0, len(data), size)]
        values = [int.from_bytes(colour, "little") for colour in table]
        require(all(a < b for a, b in zip([0] + values, values)), "chunk CTAB: colours that do not ascend")
        return table

    def dims(self, level):
        return tuple(divide_up(d, 1 << level) for d in self.volume.dims)

    def pages(self, level):
        """How many pages there are along each axis."""
        return tuple(divide_up(d, self.side) for d in self.dims(level))

    def part_pages(self):
        return (1 << 19) // self.side**3

    def check_chunks(self):
        kinds = (b"MODL", b"PAGE") + (b"MMOD", b"MASK") * self.masked
        unused = {key for key in self.container.chunks if key[0] in kinds}

        def use(kind, level, part):
            require((kind, level, part) in unused, "chunk table: chunk {} {}.{} is missing", kind.decode(), level, part)
            unused.remove((kind, level, part))

        # A file that was cut has no pages of the finest levels.
        there = {level for kind, level, _ in unused if kind in (b"PAGE", b"MASK") and level < self.count}
        self.finest = min(there, default=self.count - 1)
        for level in range(self.count):
            if any(key[0] in (b"MODL", b"MMOD") and key[1] == level for key in unused):
                for part in range(self.channels):
                    use(b"MODL", level, part)
                if self.masked:
                    use(b"MMOD", level, 0)
            if level < self.finest:
                continue
            parts = divide_up(math.prod(self.pages(level)), self.part_pages())
            require(parts <= len(unused), "chunk table: level {}: parts of chunk PAGE are missing", level)
            for part in range(parts):
                use(b"PAGE", level, part)
                if self.masked:
                    use(b"MASK", level, part)
        require(not unused, "chunk table: {} chunks of pages or models belong to no level", len(unused))

    def content(self, key):
        chunk = self.container.chunks[key]
        return bytes(self.container.data[chunk.offset:chunk.offset + chunk.length])

    @staticmethod
    def named(name, read, *values):
        """What `read` makes of the values; its refusals say where."""
        try:
            return read(*values)
        except Refused as error:
            raise Refused("{}: {}".format(name, error)) from None

    def read_model(self, level, part):
        model = self.named("chunk MODL {}.{}".format(level, part), page_model, self.content((b"MODL", level, part)))
        most = len(self.table) if self.table else GREATEST.get(self.volume.format) or (510 if self.differences and part in (1, 2) else 255)
        require(model.greatest_sample <= most, "chunk MODL {}.{}: samples up to {}", level, part, model.greatest_sample)
        return model

    def read_part(self, kind, level, part, entries):
        """The bytes of its pages, of each `entries` in turn."""
        if (kind, level, part) in self.parts:
            return self.parts[kind, level, part]
        data = self.content((kind, level, part))
        count = entries * min(self.part_pages(), math.prod(self.pages(level)) - part * self.part_pages())
        where = "chunk {} {}.{}: ".format(kind.decode(), level, part)
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
        self.parts[kind, level, part] = pages
        return pages

    def page(self, level, at, channel):
        """The bytes of a channel of page `at`, or of its mask."""
        grid = self.pages(level)
        part, number = divmod((at[2] * grid[1] + at[1]) * grid[0] + at[0], self.part_pages())
        if channel == MASK:
            return self.read_part(b"MASK", level, part, 1)[number]
        return self.read_part(b"PAGE", level, part, self.channels)[number * self.channels + channel]

    def shape(self, level, at):
        return tuple(min(self.side, d - self.side * i) for i, d in zip(at, self.dims(level)))

    def decoded(self, level, at, channel):
        """Of a page the samples of a channel; or its mask, which scalars have none of."""
        if channel == MASK and not self.masked:
            return None
        key = level, at, channel
        if key in self.known:
            return self.known[key]
        shape, mask, parents = self.shape(level, at), None, None
        if channel == MASK:
            model, alone = self.masks[level], 0
        else:
            model, mask = self.models[level][channel], self.decoded(level, at, MASK)
            alone = model.value_bytes
        unread = mask and not self.strict and not self.page(level, at, MASK)
        page = b"" if unread else self.page(level, at, channel)
        if model.parents and (self.strict or len(page) > alone):
            above = tuple(i // 2 for i in at)
            begin = tuple(i % 2 * self.side // 2 for i in at)
            parents = self.decoded(level + 1, above, channel), self.shape(level + 1, above), begin
        name = "level {}, page at {}".format(level, tuple(self.side * i for i in at))
        if channel == MASK:
            self.known[key] = self.named(name, decode_mask, model, page, shape, parents)
        else:
            self.known[key] = self.named(name, decode_page, model, page, shape, parents, mask)
        return self.known[key]

    def voxels(self, level, at):
        """The bytes of each voxel of a page."""
        mask = self.decoded(level, at, MASK)
        samples = [self.decoded(level, at, c) for c in range(self.channels)]
        if mask is None:
            known, codes = {}, samples[0]
        else:
            known = {None: bytes(self.channels)}
            codes = [code if solid else None for code, solid in zip(zip(*samples), mask)]
        for code in set(codes) - known.keys():
            known[code] = self.stored(code)
        return [known[code] for code in codes]

    def stored(self, code):
        """The bytes of a voxel, of colours of a solid one."""
        if self.codes == COLOURS:
            green, red, blue, *alpha = code
            if self.differences:
                red, blue = red + green - 255, blue + green - 255
            return bytes(min(max(c, 0), 255) for c in (red, green, blue, *alpha))
        if self.codes == INDEXED:
            return self.table[code - 1] if code > 0 else bytes(self.volume.voxel_bytes)
        if self.codes == INTEGERS:
            return code.to_bytes(CODE_BYTES[self.volume.format], "little")
        if self.codes == ORDERED:
            return (code - 2**31 if code >= 2**31 else 2**32 - 1 - code).to_bytes(4, "little")
        if code < 3:
            return SPECIAL[code]
        value = self.lo + (code - 3) * self.step
        return struct.pack("<f", min(max(value, -GREATEST_FLOAT), GREATEST_FLOAT))


    def finite(self, code):
        """Whether a code stands for a finite number."""
        if self.codes == ORDERED:
            return math.isfinite(struct.unpack("<f", self.stored(code))[0])
        return self.codes == INTEGERS or code >= 3

    def check_ranges(self):
        """Whether chunk RNGE says which codes the pages of level 0 have."""
        key = b"RNGE", 0, 0
        if key not in self.container.chunks or self.volume.colour or self.finest > 0:
            return
        data = self.content(key)
        require(len(data) >= 8, "chunk RNGE: {} bytes", len(data))
        least, greatest = struct.unpack("<2I", data[:8])
        step, at, seen = (greatest - least) // 16 + 1, 8, set()
        for place in itertools.product(*map(range, self.pages(0)[::-1])):
            if len(self.page(0, place[::-1], 0)) <= self.models[0][0].value_bytes:
                continue
            require(at < len(data), "chunk RNGE: fewer pages than are coded")
            codes = {code for code in self.decoded(0, place[::-1], 0) if self.finite(code)}
            seen |= codes
            low, high = least + data[at] % 16 * step, least + data[at] // 16 * step + step - 1
            require(all(low <= code <= high for code in codes), "chunk RNGE: byte {}: other codes than are there", at)
            at += 1
        require(at == len(data), "chunk RNGE: more pages than are coded")
        require((least, greatest) == (min(seen), max(seen)) if seen else least > greatest,
                "chunk RNGE: codes of {} to {}", least, greatest)


def decode(packed, level):
    """The voxels of a level."""
    require(level >= packed.finest, "level {}: its chunks PAGE are missing: the file was cut", level)
    if level == 0 and packed.strict:
        packed.check_ranges()
    dims, size = packed.dims(level), packed.volume.voxel_bytes
    out = bytearray(math.prod(dims) * size)
    for z, y, x in itertools.product(*map(range, packed.pages(level)[::-1])):
        shape, voxels = packed.shape(level, (x, y, z)), packed.voxels(level, (x, y, z))
        corner = [packed.side * i for i in (x, y, z)]
        for row in range(shape[1] * shape[2]):
            y, z = corner[1] + row % shape[1], corner[2] + row // shape[1]
            at = ((z * dims[1] + y) * dims[0] + corner[0]) * size
            out[at:at + shape[0] * size] = b"".join(voxels[row * shape[0]:(row + 1) * shape[0]])
    return out


# ---- The program -----------------------------------------------------------------------------------------------------


def describe(packed):
    volume = packed.volume
    return {
        "format": "voxkit", "version": packed.container.version, "codec": "svmm", "dims": volume.dims,
        "voxel_format": volume.format, "sample_type": volume.sample, "spacing": volume.spacing, "origin": volume.origin,
        "slope": volume.slope, "intercept": volume.intercept, "range": volume.range if volume.has_range else None,
        "raw_bytes": math.prod(volume.dims) * volume.voxel_bytes, "file_bytes": len(packed.container.data),
        "params": {"layout": "packed", "page_side": packed.side, "codes": CODES[packed.codes],
                   "max_error": packed.max_error, "opaque": bool(packed.opaque),
                   "differences": bool(packed.differences)},
        "palettes": [[len(m.palette) if m.has_palette else None for m in models] for models in packed.models[packed.finest:]],
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
