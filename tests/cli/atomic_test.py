#!/usr/bin/env python3
"""An output appears whole or not at all: an encoder killed, stopped by signals, on a full disk, and where it may not
write.

    atomic_test.py --bin BUILD/bin [--tool svmm-encode|vq-encode] [--kills N] [--seed N]
"""
import argparse
import hashlib
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

OPTIONS = argparse.Namespace(bin=None, tool="svmm-encode", kills=20, seed=1)
# About 0.3 s and over 10 MB: long enough to be killed in the middle of. Something for a pipe, and something endless.
WORKS = {"svmm-encode": (["menger:5", "-q", "100", "-w", "0", "-j", "1"], ["menger:4", "-q", "100", "-w", "0"], "menger:7"),
         "vq-encode": (["noise:250:1", "-j", "1"], ["noise:100:1"], "noise:4000:1")}


def command(*arguments):
    return [str(OPTIONS.bin / OPTIONS.tool), *arguments]


def work():
    return WORKS[OPTIONS.tool][0]


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


class AtomicTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.whole_folder = tempfile.TemporaryDirectory()
        whole = pathlib.Path(cls.whole_folder.name) / "whole.svmm"
        start = time.monotonic()
        subprocess.run(command(*work(), "-o", str(whole)), check=True, stderr=subprocess.DEVNULL)
        cls.seconds = time.monotonic() - start
        cls.whole = digest(whole)
        cls.whole_bytes = whole.stat().st_size
        whole.unlink()

    @classmethod
    def tearDownClass(cls):
        cls.whole_folder.cleanup()

    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = pathlib.Path(self.temporary.name)
        self.out = self.folder / "out.file"

    def files(self):
        return sorted(path.name for path in self.folder.iterdir())

    def start(self, *more, **arguments):
        return subprocess.Popen(command(*work(), "-o", str(self.out), *more), stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True, **arguments)

    def finish(self, process, limit=60):
        _, err = process.communicate(timeout=limit)
        return process.returncode, err

    def wait_for_temporary(self, process):
        """Until the output has been begun; vq-encode writes at the end, so its file is empty until then."""
        least = 0 if OPTIONS.tool == "vq-encode" else 1
        while process.poll() is None and not any(path.stat().st_size >= least for path in self.folder.glob(".*")):
            time.sleep(0.001)

    def expect_error(self, code, err, expected_code, word):
        self.assertEqual(code, expected_code, err)
        self.assertEqual(err.count("\n"), 1, err)
        self.assertTrue(err.startswith(OPTIONS.tool + ": "), err)
        self.assertIn(word, err)

    def test_kill(self):
        """SIGKILL at any moment: the final name is not there, or has the old file, or the new one, whole."""
        moments = random.Random(OPTIONS.seed)
        old = b"an old file" * 1000
        killed = finished = 0
        for i in range(OPTIONS.kills):
            force = i % 2 == 1
            if force:
                self.out.write_bytes(old)
            process = self.start(*(["--force"] if force else []))
            time.sleep(moments.uniform(0, 1.1 * self.seconds))
            process.kill()
            code, err = self.finish(process)
            self.assertIn(code, (0, -signal.SIGKILL), err)
            killed += code != 0
            if self.out.exists():
                whole = digest(self.out) == self.whole
                finished += whole
                # Killed between the renaming and the end, the new file may be there.
                self.assertTrue(whole or (force and code != 0 and self.out.read_bytes() == old), f"kill {i}")
                self.out.unlink()
            else:
                self.assertFalse(force, f"kill {i}: the old file is gone")
                self.assertNotEqual(code, 0)
            for left in self.folder.iterdir():
                self.assertTrue(left.name.startswith(".out.file.voxkit-"), left.name)
                left.unlink()
        self.assertGreater(killed, OPTIONS.kills // 4)
        print(f"{killed} of {OPTIONS.kills} killed, {finished} whole files", file=sys.stderr)

    def test_signals(self):
        """SIGINT, SIGTERM and SIGHUP: 128 + n, nothing new, the old file as it was."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            for force in (False, True):
                with self.subTest(signal=number.name, force=force):
                    if force:
                        self.out.write_bytes(b"old")
                    process = self.start(*(["--force"] if force else []))
                    self.wait_for_temporary(process)
                    process.send_signal(number)
                    code, err = self.finish(process)
                    self.assertEqual(code, 128 + number, err)
                    self.assertLessEqual(err.count("\n"), 1, err)
                    self.assertEqual(self.files(), ["out.file"] if force else [])
                    if force:
                        self.assertEqual(self.out.read_bytes(), b"old")
                        self.out.unlink()

    def test_two_signals(self):
        process = self.start()
        self.wait_for_temporary(process)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        code, err = self.finish(process)
        self.assertIn(code, (128 + signal.SIGINT, 128 + signal.SIGTERM), err)
        self.assertEqual(self.files(), [])

    def test_limit_on_file_sizes(self):
        """As on a full disk, the write fails in the middle."""
        for limit in (0, 100, self.whole_bytes // 2, self.whole_bytes - 1):
            with self.subTest(limit=limit):
                process = self.start(preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
                code, err = self.finish(process)
                self.expect_error(code, err, 4, "cannot be written")
                self.assertEqual(self.files(), [])

    def test_full_disk(self):
        """On a file system of 4 MB, which nobody else sees and which is gone with the process."""
        script = """
            mount -t tmpfs -o size=4m voxkit-test "$1" || exit 77
            cd "$1" && shift
            "$@" -o out.file; echo "code $?"; ls -A
            printf old > out.file
            "$@" -o out.file --force; echo "code $?"; ls -A; cat out.file
        """
        namespace = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user", "--mount"]
        try:
            done = subprocess.run([*namespace, "sh", "-c", script, "sh", str(self.folder), *command(*work())],
                                  capture_output=True, text=True, timeout=60)
        except FileNotFoundError:
            self.skipTest("no unshare")
        if done.returncode == 77 or done.stderr.startswith("unshare:"):
            self.skipTest("mounting is not allowed here")
        self.assertEqual(done.stdout, "code 4\ncode 4\nout.file\nold")
        lines = done.stderr.splitlines()
        self.assertEqual(len(lines), 2, lines)
        for line in lines:
            self.assertTrue(line.startswith(OPTIONS.tool + ": out.file: cannot be written after "), line)
            self.assertIn("No space left on device", line)

    def test_full_device(self):
        code, err = self.finish(subprocess.Popen(command("sphere:20", "-o", "/dev/full"), stderr=subprocess.PIPE,
                                                 text=True))
        self.expect_error(code, err, 4, "/dev/full: cannot be written")
        with open("/dev/full", "wb") as full:
            code, err = self.finish(subprocess.Popen(command("sphere:20", "-o", "-"), stdout=full,
                                                     stderr=subprocess.PIPE, text=True))
        self.expect_error(code, err, 4, "cannot be written")

    def test_closed_pipe(self):
        read, write = os.pipe()
        process = subprocess.Popen(command(*WORKS[OPTIONS.tool][1], "-o", "-"), stdout=write, stderr=subprocess.PIPE,
                                   text=True)
        os.close(write)
        os.read(read, 100)
        os.close(read)
        code, err = self.finish(process)
        self.expect_error(code, err, 4, "cannot be written")

    def test_checked_before_any_work(self):
        """What cannot be written is refused at once, before tens of GiB are encoded."""
        (self.folder / "file").write_bytes(b"old")
        (self.folder / "locked").mkdir()
        for name, word in (("none/out.file", "does not exist"), ("file", "exists: use --force"),
                           ("locked", "is a folder"), ("file/out.file", "cannot be written"),
                           ("/proc/out.file", "cannot be")):
            with self.subTest(name=name):
                start = time.monotonic()
                process = subprocess.Popen(command(WORKS[OPTIONS.tool][2], "-j", "1", "-o", str(self.folder / name)),
                                           stderr=subprocess.PIPE, text=True)
                code, err = self.finish(process, limit=20)
                self.expect_error(code, err, 4, word)
                self.assertLess(time.monotonic() - start, 5)
        self.assertEqual(self.files(), ["file", "locked"])
        self.assertEqual((self.folder / "file").read_bytes(), b"old")

    def test_bad_input_leaves_nothing(self):
        (self.folder / "cut.nrrd").write_bytes(b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 100 100 100\n"
                                               b"encoding: raw\n\n" + b"x" * 5000)
        process = subprocess.Popen(command(str(self.folder / "cut.nrrd"), "-o", str(self.out)),
                                   stderr=subprocess.PIPE, text=True)
        code, err = self.finish(process)
        self.expect_error(code, err, 3, "cut.nrrd")
        self.assertEqual(self.files(), ["cut.nrrd"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--tool", choices=sorted(WORKS), default=OPTIONS.tool)
    parser.add_argument("--kills", type=int, default=OPTIONS.kills)
    parser.add_argument("--seed", type=int, default=OPTIONS.seed)
    OPTIONS, rest = parser.parse_known_args()
    unittest.main(argv=sys.argv[:1] + rest)
