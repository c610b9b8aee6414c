"""What the tests of both reference decoders share."""

import os
import struct
import subprocess
import sys
import tempfile
import unittest

from container import xxh64

HERE = os.path.dirname(os.path.abspath(__file__))
BIN = os.environ.get("VOXKIT_BIN")


def read(path):
    with open(path, "rb") as file:
        return file.read()


def write(path, data):
    with open(path, "wb") as file:
        file.write(data)


def raw_file(voxels, sample):
    """What a .raw file has for the voxels: signed samples without their bias, bits eight to a byte."""
    if sample in ("i8", "i16"):
        size = int(sample[1:]) // 8
        return bytes(byte ^ 128 if at % size == size - 1 else byte for at, byte in enumerate(voxels))
    if sample == "bit":
        return bytes(sum(bit << i for i, bit in enumerate(voxels[at:at + 8])) for at in range(0, len(voxels), 8))
    return voxels


def container(chunks, version=1, codec=1):
    """A file of (kind, index, part, data) with all checksums right."""
    header = b"\x89VOX\r\n\x1a\n" + struct.pack("<HH44x", version, codec)
    out, table = header + struct.pack("<Q", xxh64(header)), b""
    for kind, index, part, data in chunks:
        table += struct.pack("<4sIQQQQ24x", kind, index, part, len(out), len(data), xxh64(data))
        out += data + bytes(-len(data) % 64)
    trailer = b"VOXTABLE" + struct.pack("<4Q16x", len(out), len(chunks), len(out) + len(table) + 64, xxh64(table))
    return out + table + trailer + struct.pack("<Q", xxh64(trailer))


class ToolCase(unittest.TestCase):
    """Runs the tools and the decoders in a folder of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = lambda name: os.path.join(folder.name, name)

    def run_program(self, *command, expect=0):
        done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True)
        self.assertEqual(done.returncode, expect, "{}: {}".format(" ".join(map(str, command)), done.stderr))
        return done

    def decode_both(self, decoder, file, out, *options, expect=0):
        """Has both programs decode the file; returns what the tool and what the reference decoder wrote."""
        tool, reference = self.path("tool-" + out), self.path("reference-" + out)
        self.run_program(os.path.join(BIN, "vox-decode"), file, "-f", "-o", tool, *options, expect=expect)
        done = self.run_program(sys.executable, decoder, file, reference, *options, expect=expect)
        self.assertEqual(len(done.stderr.splitlines()), 1 if expect else 0, done.stderr)
        return [read(path) if os.path.exists(path) else None for path in (tool, reference)]
