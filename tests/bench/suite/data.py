"""What is measured: built-in volumes, those that packages of Debian bring, and what is in a folder."""
import array
import json
import math
import pathlib
import sys
import tarfile

from process import run

SKULL = pathlib.Path("/usr/share/doc/invesalius-examples/examples/Cranium.inv3")  # a CT of 12 bits
BRAIN = pathlib.Path("/usr/share/mricron/templates/ch2better.nii.gz")  # an MRI of 8 bits, interpolated
VOLUMES = (".nrrd", ".nhdr", ".nii", ".nii.gz", ".mrc", ".vdb")
SURFACES = (".obj", ".gltf", ".glb", ".ply", ".vox")
WIDTHS = {"u8": 1, "i8": 1, "u16": 2, "i16": 2, "f32": 4, "rgba8": 4}


class Volume:
    """A volume as a .raw file of its samples in the folder of the run."""

    def __init__(self, options, name, source):
        self.bin, self.name, self.source = options.bin, name, str(source)
        self.folder = options.output / "volumes" / name.replace(":", "-").replace(",", "-")
        self.folder.mkdir(parents=True, exist_ok=True)
        self.raw = self.folder / "volume.raw"
        run(self.bin / "vox-convert", source, "-o", self.raw, "-f", "-q")
        info = json.loads(run(self.bin / "vox-info", source, "--json").output)
        self.dims, self.type = info["dims"], info.get("sample_type")
        if self.type not in WIDTHS:  # all that a .raw file holds of other types
            self.type = "rgba8" if "RGB" in info["voxel_format"] else "f32"
        self.width = WIDTHS[self.type]
        self.voxels = math.prod(self.dims)
        self.bytes = self.raw.stat().st_size
        self.megabytes = self.bytes / 1e6
        self.open = ["--dims", ",".join(map(str, self.dims)), "--type", self.type]

    @property
    def whole_numbers(self):
        return self.type in ("u8", "i8", "u16", "i16")

    def difference(self, other, *words):
        """What voxdiff says of this volume and another one."""
        return json.loads(run(self.bin / "voxdiff", self.raw, other, *self.open, "--json", *words, may_fail=True).output)


def skull(options):
    """The CT as a .nrrd file: from -1024 upwards in the package, from 0 here."""
    path = options.output / "volumes" / "skull.nrrd"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        # In a process of its own, for its memory.
        run(sys.executable, __file__, SKULL, path)
    return path


def unpack_skull(source, target):
    with tarfile.open(source) as package:
        member = next(m for m in package.getmembers() if m.name.endswith("matrix.dat"))
        values = array.array("h", package.extractfile(member).read())
    head = ("NRRD0004\ntype: uint16\ndimension: 3\nsizes: 256 256 108\nspace dimension: 3\n"
            "space directions: (0.957,0,0) (0,0.957,0) (0,0,1.5)\nendian: little\nencoding: raw\n\n")
    with open(target, "wb") as out:
        out.write(head.encode() + array.array("H", (value + 1024 for value in values)).tobytes())


def files(folder, endings):
    """Files of a folder and its folders, by their names."""
    found = [path for pattern in ("*", "*/*") for path in sorted(folder.glob(pattern)) if path.name.endswith(endings)]
    return {path.name.split(".")[0]: path for path in found}


def named(sources):
    return {source if ":" in source else pathlib.Path(source).name.split(".")[0]: source for source in sources}


def is_surface(source):
    return source.endswith(SURFACES) or source.startswith(("terrain:", "menger:"))


def scalar_volumes(options):
    """Volumes of one channel: {name: source}."""
    if options.inputs:
        return named(source for source in options.inputs if not is_surface(source))
    found = {"membrane:256,256,128:1": "membrane:256,256,128:1", "marschner-lobb:128": "marschner-lobb:128"}
    if SKULL.exists():
        found["skull"] = skull(options)
    if BRAIN.exists():
        found["ch2better"] = BRAIN
    if options.data:
        found |= files(options.data, VOLUMES)
    return found


def all_volumes(options):
    """Those, and volumes of colours."""
    color = [source for source in options.inputs or ["menger:5"] if source.startswith("menger:")]
    return scalar_volumes(options) | named(color)


def surfaces(options):
    """Coloured surfaces: {name: source}."""
    if options.inputs:
        return named(filter(is_surface, options.inputs))
    return {"terrain:512": "terrain:512"} | (files(options.data, SURFACES) if options.data else {})


if __name__ == "__main__":
    unpack_skull(*sys.argv[1:])
