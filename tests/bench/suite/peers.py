"""How a volume is compressed and decompressed by us and by others: one thread each, from and to files of samples.

Every method is a pair of commands. The first reads the volume and writes one file, the second one reads that and writes the
samples again.
"""
import dataclasses
import pathlib
import shutil
import sys
from ctypes.util import find_library
from importlib.util import find_spec

from process import run

HERE = pathlib.Path(__file__).parent


@dataclasses.dataclass
class Method:
    what: str
    setting: str
    encode: list
    file: pathlib.Path
    decode: list
    back: pathlib.Path  # its samples, in the order and type of the volume's
    finish: list = None  # a command, not timed, that makes `back` of what was decoded

    @property
    def label(self):
        return f"{self.what} {self.setting}".strip()


def missing():
    """Peers that are not installed, with the package of Debian that has them."""
    programs = {"zstd": "zstd", "xz": "xz-utils", "zfp": "zfp", "teem-unu": "teem-apps"}
    gone = [f"{program} ({package})" for program, package in programs.items() if not shutil.which(program)]
    if not find_library("blosc"):
        gone.append("blosc (libblosc1)")
    return gone + ([] if has_numpy() else ["NumPy (python3-numpy), and so OpenVDB and zfp"])


def has_numpy():
    """Whether samples.py can be run."""
    return find_spec("numpy") is not None


def ours(volume, encoder, *words):
    ending = {"svmm-encode": "svmm", "vq-encode": "vqv"}[encoder]
    label = "-".join(map(str, words)).replace("/", "")
    file, back = volume.folder / f"{encoder}{label}.{ending}", volume.folder / "ours.raw"
    return Method(encoder, " ".join(map(str, words)),
                  [volume.bin / encoder, volume.raw, "-o", file, "-f", "--quiet", "-j", 1, *volume.open, *words], file,
                  [volume.bin / "vox-decode", file, "-o", back, "-f", "--quiet", "-j", 1], back)


def openvdb(volume):
    """OpenVDB, written and read by vox-convert: floats."""
    file, decoded, back = (volume.folder / name for name in ("volume.vdb", "vdb.f32.raw", "vdb.raw"))
    return Method("OpenVDB", "", [volume.bin / "vox-convert", volume.raw, "-o", file, "-f", "--quiet", "-j", 1, *volume.open],
                  file, [volume.bin / "vox-convert", file, "-o", decoded, "-f", "--quiet", "-j", 1], back,
                  [sys.executable, HERE / "samples.py", "f32", decoded, volume.type, back])


def zstd(volume, level):
    file, back = volume.folder / f"volume.{level}.zst", volume.folder / "zstd.raw"
    return Method("zstd", f"-{level}", ["zstd", f"-{level}", "-q", "-f", "--single-thread", volume.raw, "-o", file], file,
                  ["zstd", "-d", "-q", "-f", file, "-o", back], back)


def xz(volume):
    file, back = volume.folder / "volume.xz", volume.folder / "xz.raw"
    return Method("xz", "-9", ["sh", "-c", 'xz -9 -T1 -c "$0" >"$1"', volume.raw, file], file,
                  ["sh", "-c", 'xz -d -c "$0" >"$1"', file, back], back)


def blosc(volume):
    file, back, program = volume.folder / "volume.blosc", volume.folder / "blosc.raw", HERE / "blosc_file.py"
    return Method("blosc", "zstd 9", [sys.executable, program, "c", volume.width, volume.raw, file], file,
                  [sys.executable, program, "d", volume.width, file, back], back)


def zfp(volume, setting, *words):
    """zfp takes 32 bit integers, of which it stores 31, or floats; lossless the former, else the latter."""
    kind = "i32" if words == ("-R",) and volume.type != "f32" else "f32"
    samples, file = volume.folder / f"volume.{kind}", volume.folder / f"zfp{'-'.join(map(str, words))}.zfp"
    decoded, back = volume.folder / f"zfp.{kind}", volume.folder / "zfp.raw"
    program = HERE / "samples.py"
    if not samples.exists():
        run(sys.executable, program, volume.type, volume.raw, kind, samples)
    shape = ["-t", kind, "-3", *volume.dims]
    return Method("zfp", setting, ["zfp", *words, *shape, "-i", samples, "-z", file], file,
                  ["zfp", *words, *shape, "-z", file, "-o", decoded], back,
                  [sys.executable, program, kind, decoded, volume.type, back])


def installed(*methods):
    """Those whose programs are there: pairs of a program's name and a function that makes the method."""
    return [make() for program, make in methods if shutil.which(program) and (program != "zfp" or has_numpy())]
