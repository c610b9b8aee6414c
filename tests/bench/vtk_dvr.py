#!/usr/bin/python3
"""Direct volume rendering beside VTK: vtk_dvr.py --bin BUILD/bin INPUT:TF.json...

Every INPUT is drawn by VTK's vtkFixedPointVolumeRayCastMapper, and by vox-render: the dense volume, its lossless
forms (RBUC, packed), and k-means to 1/16 of the bricks. Same cameras (an orbit), transfer function, opacity for a way,
sample distance, threads and light. All draw the orbit in turn, some rounds; a frame's time is the least of its rounds,
and the table has the least and the median frame. MS-SSIM, by voxdiff, is between VTK's pictures and ours; they are kept
with -o; --json prints JSON instead. Needs Debian's python3-vtk9 (with /usr/bin/python3) and xvfb.
"""
import argparse
import json
import math
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

try:
    import numpy as np
    from vtkmodules import vtkRenderingOpenGL2, vtkRenderingVolumeOpenGL2  # noqa: F401 (draw what the mapper made)
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkVersion
    from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import (vtkColorTransferFunction, vtkLight, vtkRenderer, vtkRenderWindow, vtkVolume,
                                             vtkVolumeProperty, vtkWindowToImageFilter)
    from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
except ImportError as missing:
    sys.exit(f"{missing}: expected Debian's python3-vtk9, run with /usr/bin/python3")

ELEVATION, DISTANCE, FIELD_OF_VIEW = 20, 1.8, 45
AMBIENT, DIFFUSE, SPECULAR, SHINE = 0.3, 0.6, 0.15, 32  # librender/light.h
FORMS = {"dense": None, "RBUC": ["--lossless"], "packed": ["--lossless", "--codebook", "packed"],
         "RBUC 1/16": ["--reduce", "16"]}


def tool(options, name, *words):
    command = [str(options.bin / name), *map(str, words), "--json"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}")
    return json.loads(done.stdout)


def angles(options):
    return [360 * i / options.frames + 10 for i in range(options.frames)]


def eye_of(angle):
    a, e = math.radians(angle), math.radians(ELEVATION)
    return np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)]) * DISTANCE


def read_nrrd(path):
    """Voxels (z, y, x) and spacing of a file that vox-convert wrote."""
    data = path.read_bytes()
    end = data.index(b"\n\n")
    fields = dict(line.split(": ", 1) for line in data[:end].decode().splitlines() if ": " in line)
    sizes = [int(word) for word in fields["sizes"].split()]
    kind = {"uint8": "u1", "uint16": "<u2", "float": "<f4"}[fields["type"]]
    rows = fields["space directions"].split()
    spacing = [abs(float(row.strip("()").split(",")[axis])) for axis, row in enumerate(rows)]
    return np.frombuffer(data, dtype=kind, offset=end + 2).reshape(sizes[::-1]), spacing


class Peer:
    """VTK's side of it."""

    def __init__(self, volume, transfer, options, lit):
        voxels, spacing = read_nrrd(volume)
        size = [n * edge for n, edge in zip(voxels.shape[::-1], spacing)]
        edge = [s / max(size) for s in spacing]
        image = vtkImageData()
        image.SetDimensions(*voxels.shape[::-1])
        image.SetSpacing(*edge)
        # The middle of the voxels is that of the world; voxels are points here.
        image.SetOrigin(*(-(n - 1) / 2 * e for n, e in zip(voxels.shape[::-1], edge)))
        image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(), deep=True))
        colour, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
        for point in json.loads(transfer.read_text())["points"]:
            colour.AddRGBPoint(point["value"], *point["rgba"][:3])
            opacity.AddPoint(point["value"], point["rgba"][3])
        properties = vtkVolumeProperty()
        properties.SetColor(colour)
        properties.SetScalarOpacity(opacity)
        properties.SetScalarOpacityUnitDistance(min(edge))
        properties.SetInterpolationTypeToLinear()
        properties.SetShade(lit)
        properties.SetAmbient(AMBIENT)
        properties.SetDiffuse(DIFFUSE)
        properties.SetSpecular(SPECULAR)
        properties.SetSpecularPower(SHINE)
        self.mapper = vtkFixedPointVolumeRayCastMapper()
        self.mapper.SetInputData(image)
        self.mapper.SetNumberOfThreads(options.threads)
        self.mapper.AutoAdjustSampleDistancesOff()
        self.mapper.LockSampleDistanceToInputSpacingOff()
        self.mapper.SetImageSampleDistance(1)
        self.mapper.SetSampleDistance(options.step * min(edge))
        self.mapper.SetInteractiveSampleDistance(options.step * min(edge))
        self.mapper.IntermixIntersectingGeometryOff()
        self.volume = vtkVolume()
        self.volume.SetMapper(self.mapper)
        self.volume.SetProperty(properties)
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(1, 1, 1)
        self.renderer.AddVolume(self.volume)
        self.light = vtkLight()
        self.light.PositionalOff()
        self.light.SetAmbientColor(1, 1, 1)  # black else
        self.renderer.AutomaticLightCreationOff()
        self.renderer.AddLight(self.light)
        self.window = vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.AddRenderer(self.renderer)

    def look(self, angle):
        eye = eye_of(angle)
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(*eye)
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewUp(0, 1, 0)
        camera.SetViewAngle(FIELD_OF_VIEW)
        forward = -eye / np.linalg.norm(eye)
        side = np.cross(forward, [0, 1, 0])
        side /= np.linalg.norm(side)
        self.light.SetPosition(*(-forward - 0.5 * side + 0.6 * np.cross(side, forward)))
        self.light.SetFocalPoint(0, 0, 0)
        self.renderer.ResetCameraClippingRange()

    def picture(self, angle, width, height, path):
        """Draws a frame as any program would, and keeps it if there is a path."""
        self.window.SetSize(width, height)
        self.look(angle)
        for _ in range(5):  # a window may get its size late, and was drawn for another one then
            self.window.Render()
            if self.window.GetActualSize() == (width, height) and self.has_aspect(width, height):
                break
        else:
            sys.exit(f"VTK's window is not {width} x {height} pixels")
        if path is None:
            return
        grab = vtkWindowToImageFilter()
        grab.SetInput(self.window)
        grab.ReadFrontBufferOff()
        writer = vtkPNGWriter()
        writer.SetInputConnection(grab.GetOutputPort())
        writer.SetFileName(str(path))
        writer.Write()

    def has_aspect(self, width, height):
        return abs(self.renderer.GetTiledAspectRatio() * height / width - 1) < 1e-3

    def seconds(self, angle):
        """Casting alone: what the mapper does for a frame, without showing it through OpenGL."""
        self.look(angle)
        if not self.has_aspect(*self.window.GetActualSize()):
            sys.exit("VTK's picture is not that of its window")
        start = time.perf_counter()
        self.mapper.PerVolumeInitialization(self.renderer, self.volume)
        self.mapper.PerSubVolumeInitialization(self.renderer, self.volume, 0)
        self.mapper.RenderSubVolume()
        return time.perf_counter() - start


def render(options, volume, transfer, size, lit, path, *words):
    return tool(options, "vox-render", volume, "--mode", "dvr", "--tf", transfer, "--step", options.step, "--path", path,
                "--fov", FIELD_OF_VIEW, "--size", size, "--shade", "phong" if lit else "none", "--threads",
                options.threads, *words)


class Comparison:
    """A volume in pictures of one size, with or without light: VTK's and ours, and the least time of each frame."""

    def __init__(self, options, folder, volumes, transfer, size, lit, name):
        self.options, self.volumes, self.transfer, self.size, self.lit = options, volumes, transfer, size, lit
        width, height = map(int, size.split("x"))
        self.path = folder / "path.json"
        frames = [{"orbit": [angle, ELEVATION, DISTANCE]} for angle in angles(options)]
        self.path.write_text(json.dumps({"frames": frames}))
        prefix = options.output / f"{name}-{size}-{'lit' if lit else 'unlit'}"
        self.peer = Peer(folder / "dense.nrrd", transfer, options, lit)
        start = time.perf_counter()
        self.peer.picture(angles(options)[0], width, height, None)
        self.first = time.perf_counter() - start
        render(options, volumes["dense"], transfer, size, lit, self.path, "-o", f"{prefix}-ours-%02d.png", "--force")
        self.similar = []
        for i, angle in enumerate(angles(options)):
            self.peer.picture(angle, width, height, f"{prefix}-vtk-{i:02}.png")
            diff = tool(options, "voxdiff", f"{prefix}-vtk-{i:02}.png", f"{prefix}-ours-{i:02}.png")
            self.similar.append(diff["ms_ssim"])
        self.best = {who: [math.inf] * options.frames for who in ["VTK", *volumes]}

    def draw(self, who):
        """All frames once more."""
        if who == "VTK":
            times = [1000 * self.peer.seconds(angle) for angle in angles(self.options)]
        else:
            done = render(self.options, self.volumes[who], self.transfer, self.size, self.lit, self.path, "--no-images")
            times = [frame["ms"] for frame in done["frames"]]
        self.best[who] = [min(old, new) for old, new in zip(self.best[who], times)]

    def median(self, who):
        return statistics.median(self.best[who])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volumes", nargs="+", metavar="INPUT:TF.json")
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("-o", "--output", type=pathlib.Path, help="folder for the pictures")
    parser.add_argument("--sizes", default="512x512,1920x1080")
    parser.add_argument("--step", type=float, default=0.5, help="of samples, in smallest voxel edges (0.5)")
    parser.add_argument("--frames", type=int, default=6, help="of the orbit (6)")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if "DISPLAY" not in os.environ:
        if shutil.which("xvfb-run") is None:
            sys.exit("no display, and no xvfb-run: expected Debian's xvfb")
        os.execvp("xvfb-run", ["xvfb-run", "-a", "-s", "-screen 0 1920x1080x24", sys.executable, *sys.argv])

    with tempfile.TemporaryDirectory(prefix="voxkit-vtk-") as temporary:
        folder = pathlib.Path(temporary)
        options.output = options.output or folder
        options.output.mkdir(parents=True, exist_ok=True)
        rows = []
        say = (lambda *_, **__: None) if options.json else print
        say(f"VTK {vtkVersion.GetVTKVersion()}; step {options.step}, {options.threads} threads, {options.frames} frames "
            f"of an orbit, least of {options.rounds} rounds; load {os.getloadavg()[0]:.1f}\n")
        say("| volume | size | light | who | ms min | ms median | VTK / it | it / dense | lit / unlit | MS-SSIM min |")
        say("| --- | --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")
        for pair in options.volumes:
            volume, transfer = pair.rsplit(":", 1)
            name = pathlib.Path(volume).name.split(".")[0]
            tool(options, "vox-convert", volume, "-o", folder / "dense.nrrd", "--force")
            volumes = {"dense": folder / "dense.nrrd"}
            for who, words in FORMS.items():
                if words is not None:
                    volumes[who] = folder / f"{who.replace('/', '-')}.vqv"
                    tool(options, "vq-encode", folder / "dense.nrrd", "-o", volumes[who], "--force", *words)
            for size in options.sizes.split(","):
                unlit, lit = both = [Comparison(options, folder, volumes, pathlib.Path(transfer), size, light, name)
                                     for light in (False, True)]
                for _ in range(options.rounds):
                    for who in unlit.best:
                        unlit.draw(who)
                        lit.draw(who)
                for one in both:
                    for who, ms in one.best.items():
                        cells = [name, size, "on" if one is lit else "off", who, f"{min(ms):.1f}",
                                 f"{one.median(who):.1f}", f"{one.median('VTK') / one.median(who):.2f}",
                                 f"{one.median(who) / one.median('dense'):.2f}",
                                 f"{lit.median(who) / unlit.median(who):.2f}" if one is lit else "",
                                 f"{min(one.similar):.4f}" if who == "dense" else
                                 f"(first frame {one.first:.1f} s)" if who == "VTK" else ""]
                        say("| " + " | ".join(cells) + " |", flush=True)
                        rows.append({"volume": name, "size": size, "light": "on" if one is lit else "off", "who": who,
                                     "ms_min": min(ms), "ms_median": one.median(who),
                                     "vtk_ratio": one.median("VTK") / one.median(who),
                                     "dense_ratio": one.median(who) / one.median("dense"), "ms_ssim_min": min(one.similar)})
        if options.json:
            print(json.dumps({"vtk": vtkVersion.GetVTKVersion(), "rows": rows}))
        say(f"\nload {os.getloadavg()[0]:.1f} after")


if __name__ == "__main__":
    main()
