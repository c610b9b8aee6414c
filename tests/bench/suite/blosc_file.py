"""blosc as a program: blosc_file.py c|d WIDTH INPUT OUTPUT

Compresses a file of samples of WIDTH bytes by bit shuffling and zstd 9, or decompresses it, with one thread. Blocks are of 1 GiB,
as one call takes no more than 2; each is preceded by its length.
"""
import ctypes
import ctypes.util
import sys

BLOCK = 1 << 30


def main():
    mode, width, source, target = sys.argv[1:]
    name = ctypes.util.find_library("blosc")
    if name is None:
        sys.exit("blosc is not there: expected Debian's libblosc1")
    library = ctypes.CDLL(name)
    library.blosc_init()
    library.blosc_set_compressor(b"zstd")
    with open(source, "rb") as reader, open(target, "wb") as writer:
        while head := reader.read(BLOCK if mode == "c" else 16):
            if mode == "c":
                out = ctypes.create_string_buffer(len(head) + 16)
                size = library.blosc_compress(9, 2, int(width), ctypes.c_size_t(len(head)), head, out,
                                              ctypes.c_size_t(len(out)))
                if size <= 0:
                    sys.exit("blosc: nothing came out")
                writer.write(size.to_bytes(8, "little") + len(head).to_bytes(8, "little") + memoryview(out)[:size])
            else:
                part = reader.read(int.from_bytes(head[:8], "little"))
                out = ctypes.create_string_buffer(int.from_bytes(head[8:], "little"))
                if library.blosc_decompress(part, out, ctypes.c_size_t(len(out))) != len(out):
                    sys.exit("blosc: what comes back is too short")
                writer.write(out)


if __name__ == "__main__":
    main()
