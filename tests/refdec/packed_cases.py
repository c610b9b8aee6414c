"""What the tests of layout packed share: writers of models, pages and masks, contents, and runs of the tools."""

import itertools
import math
import os
import struct
import subprocess

from container import Container, Refused
from helpers import BIN, ToolCase, container, raw_file, read, write
from mask_decode import CONTEXTS
from packed_decode import Packed, decode
from page_decode import DECISIONS, counts, lacks, rest_tap


# ---- Writers ---------------------------------------------------------------------------------------------------------


class BitWriter:
    def __init__(self):
        self.bits = []

    def put(self, value, count):
        self.bits += [value >> i & 1 for i in range(count)]
        return self

    def golomb(self, value, k):
        zeros = (value + (1 << k)).bit_length() - 1 - k
        return self.put(1 << zeros, zeros + 1).put(value + (1 << k) - (1 << k + zeros), k + zeros)

    def signed_golomb(self, value, k):
        return self.golomb(2 * value if value >= 0 else -2 * value - 1, k)

    def bytes(self):
        return bytes(sum(bit << i for i, bit in enumerate(self.bits[at:at + 8])) for at in range(0, len(self.bits), 8))


class Fields:
    """A page model whose weights are all on the rest taps, unless `weights` has others by (class, tap), and whose tables are
    all the same. Version 2 has parents."""

    def __init__(self, **changes):
        self.version, self.most, self.bound, self.background, self.palette = 1, 9, 1, 5, None
        self.weights, self.parts, self.first_same, self.more = {}, (1000, 500, 500), 0, 0
        for name, value in changes.items():
            setattr(self, name, value)

    def bytes(self):
        out = BitWriter().put(self.version, 8).put(self.palette is not None, 1).put(self.most, 32)
        out.golomb(self.bound, 0).golomb(self.background, 8)
        before = -1
        for entry in self.palette or ():
            out.golomb(entry - before - 1, 2)
            before = entry
        parents = self.version == 2
        classes, taps, tables = counts(parents)
        for c in range(classes):
            for t in range(taps):
                if not lacks(c, t, parents) and t != rest_tap(c, parents):
                    out.signed_golomb(self.weights.get((c, t), 0), 7)
        out.put(self.first_same, 1)
        if not self.first_same:
            out.put(len(self.parts), 7)
            before = 512
            for part in self.parts:
                out.golomb(part, max(0, before.bit_length() - 2))
                before = part
        out.put((1 << tables - 1) - 1, tables - 1)
        if self.more:
            out.put(self.more, 8)
        return out.bytes()

    def page(self, folded):
        """A page of these folded residuals, as section 5.2 has it backwards; narrow models, symbols below 16."""
        parts = list(self.parts) + [0] * (72 - len(self.parts)) + [2048 - sum(self.parts)]
        state, words = 1, b""
        for f in reversed(folded):
            s, bits = (f, 0) if f < 16 and parts[f] else (72, 17)
            if state << bits << 11 >= parts[s] << 64:
                words += struct.pack("<I", state & 0xffffffff)
                state >>= 32
            state = state << bits | (f if bits else 0)
            state = (state // parts[s] << 11) + state % parts[s] + sum(parts[:s])
        least = 1 if self.most < 256 else 2
        return state.to_bytes(max((state.bit_length() + 7) // 8, 0 if words else least + 1), "little") + words


def decisions(taken, least):
    """A page of such, as section 5.3 has it backwards: of each the parts of 2048 of the first of two, and whether it is that.
    Without words it has `least` bytes or more."""
    state, words = 1, b""
    for q, first_of_two in reversed(taken):
        part, first = (q, 0) if first_of_two else (2048 - q, q)
        if state << 11 >= part << 64:
            words += struct.pack("<I", state & 0xffffffff)
            state >>= 32
        state = (state // part << 11) + state % part + first
    return state.to_bytes(max((state.bit_length() + 7) // 8, 0 if words else least), "little") + words


class MaskFields:
    """A mask model, of which some contexts have other `numbers` than 0. Version 2 has parents."""

    def __init__(self, version=1, numbers=()):
        self.version, self.numbers = version, dict(numbers)

    def bytes(self):
        out, next_one = BitWriter().put(self.version, 8), 0
        for context, number in sorted(self.numbers.items()):
            out.golomb(context - next_one, 2).put(number, 5)
            next_one = context + 1
        if next_one < CONTEXTS:
            out.golomb(CONTEXTS - next_one, 2)
        return out.bytes()

    def page(self, solid):
        """A mask page: of each voxel that may be solid its context, and if it is."""
        return decisions([(DECISIONS[self.numbers.get(context, 0)], is_solid) for context, is_solid in solid], 2)


# ---- Contents --------------------------------------------------------------------------------------------------------


def smooth(noise, dims, most):
    """Waves and a little noise, of whole numbers from 0 to most; some voxels are far off."""
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        wave = math.sin(x / 5 + y / 7) + math.cos(z / 6 - y / 9)
        yield noise.randrange(most + 1) if noise.random() < 0.01 else int((wave + 2) / 4 * (most - 3)) + noise.randrange(3)


def few(noise, dims, most):
    values = sorted(noise.randrange(most + 1) for _ in range(5))
    for z, y, x in itertools.product(*map(range, dims[::-1])):
        yield values[(x // 4 + y // 3 + z // 5) % 4 if noise.random() < 0.9 else 4]


# ---- The tools -------------------------------------------------------------------------------------------------------


class PackedCase(ToolCase):
    """Compresses, and compares what both decoders make of it."""

    def encode(self, source, *options):
        """Without loss unless the options say otherwise."""
        options = options if "--max-error" in options else (*options, "--max-error", 0)
        self.run_program(os.path.join(BIN, "svmm-encode"), source, "-f", "-o", self.path("x.svmm"), "--layout", "packed",
                         *options)
        return self.path("x.svmm")

    def encode_raw(self, data, dims, kind, *options):
        write(self.path("in.raw"), data)
        return self.encode(self.path("in.raw"), "--dims", "%d,%d,%d" % dims, "--type", kind, *options)

    def compare(self, file):
        """All levels, decoded by both; returns the reference decoder's view of the file, and the voxels of level 0."""
        packed = Packed(Container(read(file)))
        first = None
        for level in range(packed.finest, packed.count):
            with self.subTest(level=level):
                self.run_program(os.path.join(BIN, "vox-decode"), file, "-f", "-o", self.path("tool.raw"), "--level", level)
                tool = read(self.path("tool.raw"))
                reference = raw_file(packed.volume.samples(decode(packed, level)), packed.volume.sample)
                first = reference if first is None else first
                if tool != reference:
                    self.assertEqual(len(tool), len(reference))
                    different = [at for at in range(len(tool)) if tool[at] != reference[at]]
                    self.fail("{} bytes differ, the first at {}".format(len(different), different[0]))
        return packed, first

    def damage(self, file, noise, kinds, changes):
        """Changes of chunks behind right checksums: both refuse it, or both make the same of it. Returns how often."""
        good, counts_of = Container(read(file)), [0, 0]
        chunks = [[*key, bytes(good.data[c.offset:c.offset + c.length])] for key, c in good.chunks.items()]
        places = [i for i, c in enumerate(chunks) if c[0] in kinds]
        for change in range(changes):
            changed = [list(c) for c in chunks]
            chunk = changed[noise.choice(places)]
            content = bytearray(chunk[3])
            for _ in range(1 + noise.randrange(2)):
                at = noise.randrange(min(len(content), 300) if noise.random() < 0.5 else len(content))
                content[at] = noise.choice((content[at] ^ 1 << noise.randrange(8), noise.randrange(256)))
            if noise.random() < 0.1:
                del content[noise.randrange(len(content)):]
            chunk[3] = bytes(content)
            with self.subTest(change=change, chunk=chunk[:3]):
                counts_of[self.same_or_refused(container(changed, version=good.version))] += 1
        return counts_of

    def same_or_refused(self, data):
        """What both decoders make of a file is the same; returns whether it is anything. Of what a reader may leave
        unread the tool need not have seen that it is not valid."""
        write(self.path("bad.svmm"), data)
        results = []
        for strict in (True, False):
            try:
                packed = Packed(Container(data), strict)
                results.append(raw_file(packed.volume.samples(decode(packed, 0)), packed.volume.sample))
                break
            except Refused as error:
                results.append(None)
                why = error
        command = [os.path.join(BIN, "vox-decode"), self.path("bad.svmm"), "-f", "-o", self.path("bad.raw")]
        done = subprocess.run(command, stderr=subprocess.PIPE)
        self.assertIn(done.returncode, (0, 3), done.stderr)
        tool = read(self.path("bad.raw")) if done.returncode == 0 else None
        self.assertTrue(tool in results, done.stderr or (why if results == [None, None] else "other voxels"))
        return tool is not None
