"""Samples as others take them, and back: samples.py TYPE INPUT i32|f32 OUTPUT, or i32|f32 INPUT TYPE OUTPUT

TYPE is u8, i8, u16, i16 or f32. Numbers are rounded to whole ones, and kept within their type.
"""
import sys

import numpy

TYPES = {"u8": "u1", "i8": "i1", "u16": "<u2", "i16": "<i2", "i32": "<i4", "f32": "<f4"}
PART = 1 << 24


def main():
    have, source, want, target = sys.argv[1:]
    kind = numpy.dtype(TYPES[want])
    with open(source, "rb") as reader, open(target, "wb") as writer:
        while len(values := numpy.fromfile(reader, TYPES[have], PART)):
            if kind.kind in "iu" and values.dtype.kind == "f":
                limits = numpy.iinfo(kind)
                values = numpy.rint(values).clip(limits.min, limits.max)
            values.astype(kind).tofile(writer)


if __name__ == "__main__":
    main()
