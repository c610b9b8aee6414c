#!/usr/bin/env python3
"""Every output of every tool against every fault: what could not be written whole is not there, and what was there is.

    faults_test.py --bin BUILD/bin [--table]

Faults: a full disk, a limit on the size of files, a folder that only can be read, a closed pipe, SIGTERM, SIGKILL. The
first three are exit 4 and one line; --table prints what was tried.
"""
import argparse
import os
import pathlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import unittest

OPTIONS = argparse.Namespace(bin=None, table=False)
SCALAR, COLOR = "noise:48:1", "menger:3"

# Of each output: the tool, what it is given before -o, and the name; "@" is the folder of inputs.
OUTPUTS = {
    "svmm": ("svmm-encode", [SCALAR, "-w", "0"], "a.svmm"),
    "svmm zstd": ("svmm-encode", [SCALAR, "--zstd", "3"], "a.svmm"),
    "svmm packed": ("svmm-encode", [SCALAR, "--layout", "packed"], "a.svmm"),
    "vqv": ("vq-encode", [SCALAR], "a.vqv"),
    "dagc": ("dagcolor-pack", ["terrain:64"], "a.dagc"),
    "nrrd": ("vox-convert", [SCALAR], "a.nrrd"),
    "nhdr": ("vox-convert", [SCALAR], "a.nhdr"),
    "nii": ("vox-convert", [SCALAR], "a.nii"),
    "nii.gz": ("vox-convert", [SCALAR], "a.nii.gz"),
    "mrc": ("vox-convert", [SCALAR], "a.mrc"),
    "mha": ("vox-convert", [SCALAR], "a.mha"),
    "mhd": ("vox-convert", [SCALAR], "a.mhd"),
    "vtk": ("vox-convert", [SCALAR], "a.vtk"),
    "vti": ("vox-convert", [SCALAR], "a.vti"),
    "npy": ("vox-convert", [SCALAR], "a.npy"),
    "raw": ("vox-convert", [SCALAR], "a.raw"),
    "vdb": ("vox-convert", [SCALAR], "a.vdb"),
    "stack of png": ("vox-convert", [SCALAR], "s-%03d.png"),
    "stack of tif": ("vox-convert", [SCALAR], "s-%03d.tif"),
    "colors as nrrd": ("vox-convert", [COLOR], "a.nrrd"),
    "svmm as nrrd": ("vox-decode", ["@/a.svmm"], "a.nrrd"),
    "svmm as vdb": ("vox-decode", ["@/a.svmm"], "a.vdb"),
    "vqv as nii": ("vox-decode", ["@/a.vqv"], "a.nii"),
    "dagc as dagc": ("vox-convert", ["@/a.dagc", "--crop", "1,1,1,63,17,64"], "b.dagc"),
    "dagc as ply": ("vox-decode", ["@/a.dagc"], "a.ply"),
    "dagc as vox": ("vox-decode", ["@/a.dagc"], "a.vox"),
    "dagc as glb": ("vox-decode", ["@/a.dagc"], "a.glb"),
    "dagc as obj": ("vox-decode", ["@/a.dagc"], "a.obj"),
    "dagc as vdb": ("vox-decode", ["@/a.dagc"], "a.vdb"),
    "tiles": ("vox-decode", ["@/png.dagc", "--tiles"], "t-%02d.png"),
    "error volume": ("voxdiff", ["@/a.nrrd", "@/b.nrrd"], "e.nrrd"),
    "error image": ("voxdiff", ["@/a.png", "@/b.png"], "e.png"),
    "png": ("vox-render", ["@/a.svmm", "--size", "300x200"], "p.png"),
    "exr": ("vox-render", ["@/a.svmm", "--size", "300x200", "--aov", "depth,normal"], "p.exr"),
    "report": ("vox-render", ["@/a.svmm", "--size", "200x100", "--path", "orbit:64", "--no-images", "--report"],
               "r.json"),
    "frames": ("vox-render", ["@/a.svmm", "--size", "120x80", "--path", "orbit:4"], "f-%02d.png"),
    "dvr": ("vox-render", ["@/a.svmm", "--mode", "dvr", "--size", "200x100"], "d.png"),
}
# Each of their files is an output of its own: those that were done stay, whole.
ONE_BY_ONE = {"frames"}
PIPED = {  # what is written to standard output with -o -
    "svmm": ("svmm-encode", ["noise:100:1", "-w", "0"]),
    "vqv": ("vq-encode", ["noise:100:1"]),
    "nrrd": ("vox-convert", ["noise:100:1"]),
    "decoded": ("vox-decode", ["@/large.svmm"]),
}
INPUTS = [("svmm-encode", SCALAR, "a.svmm"), ("vq-encode", SCALAR, "a.vqv"), ("dagcolor-pack", "terrain:64", "a.dagc"),
          ("dagcolor-pack", "terrain:64", "--codec", "png", "png.dagc"), ("vox-convert", SCALAR, "a.nrrd"),
          ("vox-convert", "noise:48:2", "b.nrrd"), ("svmm-encode", "noise:100:1", "large.svmm"),
          ("vox-render", SCALAR, "--size", "300x200", "a.png"),
          ("vox-render", "noise:48:2", "--size", "300x200", "b.png")]
NAMESPACE = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user", "--mount"]


class FaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.kept = tempfile.TemporaryDirectory()
        cls.inputs = pathlib.Path(cls.kept.name)
        for tool, *arguments, name in INPUTS:
            subprocess.run([OPTIONS.bin / tool, *arguments, "-o", cls.inputs / name], check=True, capture_output=True)
        cls.whole = {}  # of each output: names and bytes of its files, and how long it took
        for name in OUTPUTS:
            with tempfile.TemporaryDirectory() as folder:
                start = time.monotonic()
                done = subprocess.run(cls.command(name, folder), capture_output=True, text=True)
                if done.returncode != 0 and "is needed" in done.stderr:  # a module that was not built
                    print(f"{name} is left out: {done.stderr.strip()}", file=sys.stderr)
                    continue
                assert done.returncode == 0, (name, done.stderr)
                files = {path.name: path.read_bytes() for path in pathlib.Path(folder).iterdir()}
                cls.whole[name] = files, time.monotonic() - start

    @classmethod
    def tearDownClass(cls):
        cls.kept.cleanup()

    @classmethod
    def arguments(cls, given):
        return [argument.replace("@", str(cls.inputs), 1) if argument.startswith("@/") else argument
                for argument in given]

    @classmethod
    def command(cls, name, folder, *more):
        tool, given, out = OUTPUTS[name]
        option = [] if given[-1] == "--report" else ["-o"]
        return [str(OPTIONS.bin / tool), *cls.arguments(given), *option, os.path.join(folder, out), *more]

    def each(self, fault, test):
        """Every output, without and with old files in its place: test(name, folder, force, old files, seconds)."""
        for name, (files, seconds) in self.whole.items():
            for old in (False, True):
                with self.subTest(output=name, fault=fault, old=old), tempfile.TemporaryDirectory() as folder:
                    folder = pathlib.Path(folder)
                    if old:
                        for file in files:
                            (folder / file).write_text("old " + file)
                    test(name, folder, ["--force"] if old else [],
                         {file: f"old {file}".encode() for file in files} if old else {}, seconds)
                    if OPTIONS.table:
                        print(f"{name:16} {fault:12} {'old files' if old else 'none there':10}", file=sys.stderr)

    def expect_refused(self, name, code, err):
        self.assertEqual(code, 4, err)
        lines = [line for line in err.splitlines() if "cannot" in line and ": dropped" not in line]
        self.assertEqual(len(lines), 1, err)
        self.assertTrue(lines[0].startswith(OUTPUTS[name][0] + ": "), err)

    @staticmethod
    def files(folder, hidden=True):
        return {path.name: path.read_bytes() for path in folder.iterdir() if hidden or not path.name.startswith(".")}

    def test_limit_on_file_sizes(self):
        def test(name, folder, force, old, _):
            limit = max(len(data) for data in self.whole[name][0].values()) // 2
            done = subprocess.run(self.command(name, str(folder), *force), capture_output=True, text=True,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
            self.expect_refused(name, done.returncode, done.stderr)
            self.assertEqual(self.files(folder), old)

        self.each("file size", test)

    def mounted(self, name, folder, force, options, before):
        """Runs it in a namespace that has a file system of its own in the place of `folder`."""
        script = """
            old=$(mktemp -d) && cp -a "$1"/. "$old" && mount -t tmpfs -o "$2" voxkit-test "$1" || exit 77
            cp -a "$old"/. "$1" && rm -r "$old" && eval "$3" || exit 77
            folder=$1; shift 3
            "$@"; code=$?
            cd "$folder" && for file in $(ls -A); do printf '%s: ' "$file"; cat "$file"; echo; done
            exit $code
        """
        try:
            done = subprocess.run([*NAMESPACE, "sh", "-c", script, "sh", str(folder), options, before,
                                   *self.command(name, str(folder), *force)], capture_output=True, timeout=120)
        except FileNotFoundError:
            self.skipTest("no unshare")
        err = done.stderr.decode(errors="replace")
        if done.returncode == 77 or err.startswith("unshare:"):
            self.skipTest("mounting is not allowed here")
        return done.returncode, err, done.stdout

    def listing(self, old):
        return b"".join(f"{file}: ".encode() + data + b"\n" for file, data in sorted(old.items()))

    def test_full_disk(self):
        def test(name, folder, force, old, _):
            files = self.whole[name][0]
            room = sum(len(data) for data in files.values()) // 2 // 4096 + len(old)
            code, err, left = self.mounted(name, folder, force, f"size={4 * max(room, 1)}k", "true")
            self.expect_refused(name, code, err)
            if name in ONE_BY_ONE:
                for file, data in files.items():
                    for known in (data, old.get(file, b"")):
                        left = left.replace(f"{file}: ".encode() + known + b"\n", b"", 1)
                old = {}
            self.assertEqual(left, self.listing(old))

        self.each("full disk", test)

    def test_read_only_folder(self):
        def test(name, folder, force, old, _):
            code, err, left = self.mounted(name, folder, force, "size=8m", 'mount -o remount,ro "$1"')
            self.expect_refused(name, code, err)
            self.assertEqual(left, self.listing(old))

        self.each("read only", test)

    def test_signals(self):
        moments = random.Random(1)
        for number in (signal.SIGTERM, signal.SIGKILL):
            def test(name, folder, force, old, seconds, number=number):
                process = subprocess.Popen(self.command(name, str(folder), *force), stdout=subprocess.DEVNULL,
                                           stderr=subprocess.PIPE, text=True)
                time.sleep(moments.uniform(0, seconds))
                process.send_signal(number)
                _, err = process.communicate(timeout=60)
                code = process.returncode
                self.assertIn(code, (0, -number) if number == signal.SIGKILL else (0, -number, 128 + number), err)
                left = self.files(folder, hidden=number != signal.SIGKILL)  # whose temporary files are left to others
                whole = self.whole[name][0]
                for file, data in left.items():
                    if name != "report" and data != old.get(file):
                        self.assertEqual(data, whole[file], f"{file} is neither the old nor the new one, whole")
                self.assertGreaterEqual(set(left), set(old))
                if code != 0 and number == signal.SIGTERM and name not in ONE_BY_ONE:
                    self.assertEqual(left, old)

            self.each(number.name, test)

    def test_closed_pipe(self):
        for name, (tool, given) in PIPED.items():
            with self.subTest(output=name):
                read, write = os.pipe()
                process = subprocess.Popen([str(OPTIONS.bin / tool), *self.arguments(given), "-o", "-"], stdout=write,
                                           stderr=subprocess.PIPE, text=True)
                os.close(write)
                os.read(read, 100)
                os.close(read)
                _, err = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 4, err)
                self.assertIn("cannot be written", err)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--table", action="store_true")
    OPTIONS, rest = parser.parse_known_args()
    unittest.main(argv=sys.argv[:1] + rest)
