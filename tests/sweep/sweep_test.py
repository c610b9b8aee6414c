#!/usr/bin/env python3
"""Sweeps: what is in their tables, what is left after a kill, what happens to failures.

    sweep_test.py --bin BUILD/bin
"""
import argparse
import csv
import io
import itertools
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

BIN = pathlib.Path()
SPEC = {"inputs": ["sphere:24", "menger:3"],
        "codecs": [{"tool": "svmm-encode", "name": "svmm", "options": {"quality": [60, 90, 100], "blockwidth": ["0", 4], "rootwidth": 4}},
                   {"tool": "vq-encode", "name": "vq", "inputs": ["sphere:24"], "options": [{"lossless": True}, {"reduce": [2, 8]}]}]}
POINTS = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
end_header
0 0 0 255 0 0
1 0 0 0 255 0
0 1 0 0 0 255
0 0.02 1 9 9 9
"""


def program(name, *arguments, **more):
    return subprocess.run([str(BIN / name), *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False, **more)


def answer(name, *arguments):
    """The JSON that a program prints."""
    done = program(name, *arguments, "--json")
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return json.loads(done.stdout)


class SweepCase(unittest.TestCase):
    results = None

    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="voxkit-sweep-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.out = self.folder / "out"

    def spec(self, value=SPEC, name="spec.json"):
        path = self.folder / name
        path.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
        return str(path)

    def sweep(self, *arguments, spec=None, out=None, code=0):
        done = program("vox-sweep", spec or self.spec(), "-o", out or self.out, *arguments)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def swept(self, out=None):
        """A folder of results of SPEC, as a sweep leaves it: a copy of one that was run once for all tests."""
        if not SweepCase.results:
            SweepCase.results = tempfile.TemporaryDirectory(prefix="voxkit-sweep-")
            self.sweep("--quiet", out=pathlib.Path(SweepCase.results.name) / "out")
        shutil.copytree(pathlib.Path(SweepCase.results.name) / "out", out or self.out)

    def rows(self, out=None):
        return [json.loads(line) for line in ((out or self.out) / "results.jsonl").read_text(encoding="utf-8").splitlines()]

    def table(self, out=None):
        return list(csv.DictReader(io.StringIO((out or self.out).joinpath("results.csv").read_text(encoding="utf-8"))))

    def lasting(self, out=None):
        """The table without times and what depends on the machine."""
        ends = ("seconds", "ms_min", "ms_avg", "ms_max", "_mb_per_s", "mrays_per_s", "peak_rss_bytes", "speed_ratio", "threads")
        return [{key: value for key, value in row.items() if not key.endswith(ends)} for row in self.table(out)]

    def records(self, out=None):
        """Finished steps: file name to bytes and time of writing."""
        return {path.name: (path.read_bytes(), path.stat().st_mtime_ns)
                for path in (out or self.out).glob("work/*.json")}


class TablesTest(SweepCase):
    def test_every_setting_once_in_order(self):
        self.swept()
        expected = [("sphere:24", "svmm", {"quality": q, "blockwidth": w, "rootwidth": "4"})
                    for q, w in itertools.product(("60", "90", "100"), "04")]
        expected += [("sphere:24", "vq", {"lossless": True})] + [("sphere:24", "vq", {"reduce": n}) for n in "28"]
        expected += [("menger:3", codec, options) for _, codec, options in expected[:6]]
        self.assertEqual([(row["input"], row["codec"], row["options"]) for row in self.rows()], expected)
        self.assertEqual({row["status"] for row in self.rows()}, {"done"})

    def test_numbers_are_those_of_the_programs(self):
        self.swept()
        rows = self.rows()
        table = self.table()
        for index, options in ((0, ["--quality", 60, "--blockwidth", 0, "--rootwidth", 4]), (12, ["--quality", 90, "--blockwidth", 0, "--rootwidth", 4])):
            row, cells = rows[index if index == 0 else 11], table[index if index == 0 else 11]
            packed = self.folder / f"{index}.svmm"
            encoded = answer("svmm-encode", row["input"], "-o", packed, *options)
            compared = answer("voxdiff", row["input"], packed)
            self.assertEqual(set(encoded), set(row["encode"]))  # every key
            self.assertEqual(set(compared), set(row["compare"]))
            self.assertEqual(row["encode"]["levels"], encoded["levels"])
            self.assertEqual(int(cells["file_bytes"]), packed.stat().st_size)
            self.assertEqual(int(cells["levels"]), len(encoded["levels"]))
            for key in ("rmse", "max_abs_error", "differing_voxels"):
                self.assertEqual(float(cells[key]), float(compared[key]), key)
            self.assertEqual(float(cells["psnr_db"]), float(compared["psnr_db"]))
            self.assertGreater(float(cells["decode_seconds"]), 0)
            self.assertIn("cpu", row["machine"])
            self.assertEqual(row["encode"]["version"], encoded["version"])

    def test_front(self):
        """Marked is what no other setting of the input beats in both size and PSNR."""
        self.swept()
        table = self.table()
        for row in table:
            size, psnr = int(row["file_bytes"]), float(row["psnr_db"])
            others = [(int(other["file_bytes"]), float(other["psnr_db"])) for other in table if other["input"] == row["input"]]
            beaten = any(s <= size and p >= psnr and (s, p) != (size, psnr) for s, p in others)
            self.assertEqual(row["pareto"], "false" if beaten else "true", row["setting"])

    def test_surface(self):
        """Has no volume of its own: compared is with its colours as they are."""
        (self.folder / "t.ply").write_text(POINTS, encoding="utf-8")
        spec = self.spec({"inputs": ["t.ply"], "codecs": [{"tool": "dagcolor-pack", "options": {"resolution": [2, 64], "codec": ["raw", "fws"]}}]})
        self.sweep("--quiet", spec=spec)
        table = self.table()
        self.assertEqual([row["status"] for row in table], ["done"] * 4)
        self.assertEqual([row["psnr_db"] for row in table[::2]], ["inf", "inf"])
        self.assertEqual([row["dims"] for row in table[1:3]], ["2x2x2", "64x64x64"])
        for row, cells in zip(self.rows(), table):  # of its voxels, not of the void around them
            self.assertEqual(float(cells["grmse"]), row["encode"]["grmse"])

    def test_data(self):
        """What is in a folder of data is left out, with a word, until the folder is named."""
        (self.folder / "data").mkdir()
        (self.folder / "data" / "t.ply").write_text(POINTS, encoding="utf-8")
        inputs = [{"name": "points", "input": "t.ply", "data": True}]
        codecs = [{"tool": "dagcolor-pack", "options": {"codec": "raw"}}]
        spec = self.spec({"inputs": ["terrain:8", *inputs], "codecs": codecs, "decode": False, "metrics": False})
        self.assertIn("left out: points: --data names", self.sweep(spec=spec).stderr)
        self.assertEqual([row["input"] for row in self.table()], ["terrain:8"])
        self.assertNotIn("left out", self.sweep("--data", self.folder / "data", spec=spec).stderr)
        self.assertEqual([(row["input"], row["status"]) for row in self.table()], [("terrain:8", "done"), ("points", "done")])
        alone = self.spec({"inputs": inputs, "codecs": codecs}, "alone.json")
        self.assertIn("inputs: all of them are in a folder of data: expected --data DIR", self.sweep(spec=alone, code=2).stderr)
        self.assertIn("is no folder", self.sweep("--data", self.folder / "none", spec=spec, code=3).stderr)

    def test_front_of_colours(self):
        """Where nothing but colours is compared, the front is of their error."""
        spec = self.spec({"inputs": ["menger:2"], "metrics": False, "decode": False, "codecs": [
            {"tool": "dagcolor-pack", "options": {"codec": ["fws", "vws"], "threshold": [6.38, 25.5, 60], "effort": [1, 3]}}]})
        self.sweep("--quiet", spec=spec)
        points = [(int(row["file_bytes"]), float(row["grmse"])) for row in self.table()]
        expected = [not any(s <= size and e <= error and (s, e) != (size, error) for s, e in points) for size, error in points]
        self.assertIn(False, expected)
        self.assertEqual([row["pareto"] == "true" for row in self.table()], expected)

    def test_side_by_side(self):
        """As many at a time as fit make the same table."""
        self.swept()
        beside = self.folder / "beside"
        self.sweep("--quiet", "-j", "2", spec=self.spec(SPEC | {"threads": 1}, "beside.json"), out=beside)
        self.assertEqual(self.lasting(), self.lasting(beside))

    def test_shares(self):
        """Memory is split between those that run at a time, of which there are no more than threads, and as many."""
        spec = self.spec({"inputs": ["noise:64:1", "noise:64:2"], "threads": 1, "decode": False, "metrics": False,
                          "codecs": [{"tool": "vq-encode", "options": {"reduce": [8, 16]}}]})
        self.sweep("--quiet", "--threads", "2", "--max-memory", "2K", spec=spec, code=1)
        self.assertIn("allows 1024:", self.table()[0]["error"])
        for threads in (1, 2):
            process = subprocess.Popen([str(BIN / "vox-sweep"), spec, "-o", str(self.out), "-q", "-f", "-j", str(threads)])
            children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
            most = 0
            while process.poll() is None:
                try:
                    running = [pathlib.Path(f"/proc/{child}/cmdline").read_bytes() for child in children.read_text(encoding="ascii").split()]
                except OSError:
                    running = []
                most = max(most, sum(b"--reduce" in words for words in running))
                time.sleep(0.005)
            self.assertEqual((process.returncode, most), (0, threads))

    def test_repeat(self):
        """Each of what is timed runs so often, and the fastest run counts."""
        spec = {"inputs": ["sphere:20"], "codecs": [{"tool": "svmm-encode"}], "repeat": 4}
        trace = self.folder / "trace"
        trace.mkdir()
        for name in ("vox-sweep", "svmm-encode", "vox-decode", "voxdiff", "vox-render", "dagcolor-pack"):
            if name == "svmm-encode":  # counts its runs, and says that the second was the fastest
                script = f"""#!/bin/sh
                    case $1 in --*) exec {BIN / name} "$@" ;; esac
                    echo run >>{trace}/runs
                    {BIN / name} "$@" | sed "s/\\"encode_seconds\\": .*/\\"encode_seconds\\": $(grep -c run {trace}/runs | tr 1234 5167),/" """
                (trace / name).write_text(script, encoding="utf-8")
                (trace / name).chmod(0o755)
            elif name == "vox-sweep":
                shutil.copy(BIN / name, trace / name)
            else:
                (trace / name).symlink_to(BIN / name)
        (self.folder / "share").symlink_to(BIN.parent / "share")
        done = subprocess.run([str(trace / "vox-sweep"), self.spec(spec), "-o", str(self.out), "-q"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((trace / "runs").read_text(encoding="utf-8"), "run\n" * 4)
        self.assertEqual(self.table()[0]["encode_seconds"], "1")
        self.assertEqual(self.table()[0]["status"], "done")

    def test_yaml(self):
        try:
            import yaml
        except ImportError:
            self.skipTest("no python3-yaml")
        self.sweep("--quiet")
        other = self.folder / "yaml"
        self.sweep("--quiet", spec=self.spec(yaml.safe_dump(SPEC, sort_keys=False), "spec.yaml"), out=other)
        self.assertEqual(self.lasting(), self.lasting(other))
        # on, off and 1:30 are the texts that they look like
        text = "inputs: [menger:1]\ncodecs:\n- tool: svmm-encode\n  options: {alpha-weight: [on, off], threads: 1}\n"
        planned = json.loads(self.sweep("--dry-run", "--json", spec=self.spec(text, "on.yml")).stdout)
        self.assertIn("--alpha-weight off", planned["plan"][3]["command"])

    def test_bad_yaml(self):
        for text, word in (("inputs: [", "line 1"), ("a: 1\na: 2", "twice"), ("a: &x [1]\nb: *x", "alias"), ("1: 2", "no text"),
                           ("!!python/object/apply:os.system [ls]", "no YAML"), ("? [1]\n: 2", ""), ("a: b: c", "line 1")):
            with self.subTest(text=text):
                try:
                    import yaml  # noqa: F401
                except ImportError:
                    word = "python3-yaml"
                done = self.sweep(spec=self.spec(text, "bad.yaml"), code=3)
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                self.assertIn(word, done.stderr)


class ResumeTest(SweepCase):
    def test_nothing_is_repeated(self):
        self.swept()
        before, table = self.records(), self.table()
        self.assertEqual(json.loads(self.sweep("--json").stdout)["steps_run"], 0)
        self.assertEqual(self.records(), before)
        self.assertEqual(self.table(), table)
        self.assertEqual(list(self.out.glob("work/*.svmm")), [])  # unless asked for

    def test_more_settings(self):
        self.swept()
        before = self.records()
        more = json.loads(json.dumps(SPEC))
        more["codecs"][0]["options"]["quality"].append(75)
        done = json.loads(self.sweep("--json", spec=self.spec(more)).stdout)
        self.assertEqual(done["settings"], 15 + 4)
        self.assertEqual(done["steps_run"], 4 * 3)
        after = self.records()
        self.assertEqual({name: after[name] for name in before}, before)

    def test_changed_input(self):
        volume = self.folder / "v.nrrd"
        spec = self.spec({"inputs": ["v.nrrd"], "codecs": [{"tool": "svmm-encode"}]})
        program("vox-convert", "sphere:9", "-o", volume)
        self.sweep("--quiet", spec=spec)
        first = self.table()[0]["dims"]
        program("vox-convert", "sphere:10", "-o", volume, "--force")
        self.assertEqual(json.loads(self.sweep("--json", spec=spec).stdout)["steps_run"], 3)
        self.assertEqual((first, self.table()[0]["dims"]), ("9x9x9", "10x10x10"))

    def test_force(self):
        self.swept()
        self.assertEqual(json.loads(self.sweep("--json", "--force").stdout)["steps_run"], 15 * 3)

    def test_damaged_record(self):
        self.swept()
        table, victims = self.lasting(), sorted(self.out.glob("work/*.json"))
        victims[0].write_text("{", encoding="utf-8")
        victims[7].write_text("[]", encoding="utf-8")
        victims[9].unlink()
        self.sweep("--quiet")
        self.assertEqual(self.lasting(), table)

    def test_keep(self):
        self.sweep("--quiet", spec=self.spec(SPEC | {"keep": True}))
        self.assertEqual(len(list(self.out.glob("work/*.svmm"))), 12)
        self.assertEqual(len(list(self.out.glob("work/*.vqv"))), 3)

    def start(self, *arguments):
        return subprocess.Popen([str(BIN / "vox-sweep"), self.spec(), "-o", str(self.out), "--quiet", *arguments],
                                stderr=subprocess.PIPE, text=True)

    def stop_after(self, steps, number):
        """Sends a signal once so many records are there; the records of then."""
        process = self.start()
        while process.poll() is None and len(list(self.out.glob("work/*.json"))) < steps:
            time.sleep(0.001)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
        return process.returncode, err, self.records()

    def test_killed_twice(self):
        whole = self.folder / "whole"
        self.swept(whole)
        code, _, first = self.stop_after(7, signal.SIGKILL)
        self.assertEqual(code, -signal.SIGKILL)
        self.assertFalse((self.out / "results.csv").exists())
        code, _, second = self.stop_after(20, signal.SIGKILL)
        self.assertEqual(code, -signal.SIGKILL)
        self.assertLess(len(second), 15 * 3)
        self.sweep("--quiet")
        last = self.records()
        for earlier in (first, second):
            self.assertEqual({name: last[name] for name in earlier}, earlier)  # none was run again
        self.assertEqual(self.lasting(), self.lasting(whole))
        self.assertEqual([path.name for path in self.out.glob("work/.*")], [])

    def test_stopped_by_signals(self):
        for number, steps in ((signal.SIGINT, 5), (signal.SIGTERM, 20)):
            code, err, records = self.stop_after(steps, number)
            self.assertEqual(code, 128 + number)
            self.assertEqual(err.count("\n"), 1, err)
            self.assertFalse((self.out / "results.csv").exists())
            self.assertEqual(list(self.out.glob("work/.*")), [])
            for data, _ in records.values():
                json.loads(data)

    def test_programs_die_with_it(self):
        spec = self.spec({"inputs": ["noise:500:1"], "codecs": [{"tool": "vq-encode", "options": {"reduce": 4}}]})
        process = subprocess.Popen([str(BIN / "vox-sweep"), spec, "-o", str(self.out)], stderr=subprocess.DEVNULL)
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
        child = ""
        while process.poll() is None and not child:
            words = children.read_text(encoding="ascii").split() if children.exists() else []
            child = words[0] if words and b"reduce" in pathlib.Path(f"/proc/{words[0]}/cmdline").read_bytes() else ""
            time.sleep(0.01)
        process.kill()
        process.wait()
        deadline = time.monotonic() + 10
        while os.path.exists(f"/proc/{child}") and time.monotonic() < deadline:
            time.sleep(0.01)
        self.assertFalse(os.path.exists(f"/proc/{child}"))


class FailureTest(SweepCase):
    def test_marked_and_the_rest_goes_on(self):
        spec = self.spec({"inputs": ["sphere:12", "menger:2"], "codecs": [{"tool": "vq-encode", "options": {"reduce": [2, "x"]}}]})
        done = self.sweep(spec=spec, code=1)
        self.assertIn("3 of 4 settings failed", done.stderr)
        rows = self.rows()
        self.assertEqual([row["status"] for row in rows], ["done", "failed", "failed", "failed"])
        self.assertIn('vq-encode: --reduce: "x"', rows[1]["error"])
        self.assertIsNone(rows[1]["encode"])
        self.assertIn("menger:2", rows[2]["error"])
        self.assertEqual([bool(row["file_bytes"]) for row in self.table()], [True, False, False, False])
        # It would fail again.
        self.assertEqual(json.loads(self.sweep("--json", spec=spec, code=1).stdout)["steps_run"], 0)

    def test_limits_can_be_raised(self):
        self.sweep("--quiet", "--max-memory", "1K", code=1)
        self.assertIn("--max-memory", self.table()[0]["error"])
        self.sweep("--quiet")
        self.assertEqual({row["status"] for row in self.table()}, {"done"})

    def test_timeout(self):
        spec = {"inputs": ["noise:500:1"], "codecs": [{"tool": "vq-encode", "options": {"reduce": 4}}], "decode": False, "metrics": False,
                "timeout": 0.3}
        done = self.sweep("--quiet", spec=self.spec(spec), code=1)
        self.assertIn("longer than the timeout", done.stderr)

    def test_picture_is_missing(self):
        """One that was drawn and is gone is drawn again."""
        if not (BIN.parent / "lib" / "voxkit" / "image_stack.so").exists():
            self.skipTest("the module image_stack was not built")
        spec = self.spec({"inputs": ["menger:2"], "codecs": [{"tool": "svmm-encode"}], "renders": [{"options": {"size": "40x30"}}]})
        self.sweep("--quiet", spec=spec)
        pictures = list(self.out.glob("work/*.png"))
        self.assertEqual(len(pictures), 2)
        for picture in pictures:
            picture.unlink()
        self.assertEqual(json.loads(self.sweep("--json", spec=spec).stdout)["steps_run"], 3)  # and the encoding, for its file
        self.assertEqual(sorted(self.out.glob("work/*.png")), sorted(pictures))
        self.assertEqual(self.table()[0]["render.psnr_db_avg"][:1].isdigit() or self.table()[0]["render.psnr_db_avg"] == "inf", True)


class OutputTest(SweepCase):
    def test_standard_output_is_full(self):
        for arguments in (["--help"], ["--version"], [self.spec(), "-o", str(self.out), "--dry-run"]):
            with open("/dev/full", "wb") as full:
                done = subprocess.run([str(BIN / "vox-sweep"), *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
            self.assertEqual((done.returncode, done.stderr), (4, "vox-sweep: standard output: No space left on device\n"))

    def test_disk_is_full(self):
        """A table that cannot be written is an error; the old one stays."""
        spec = self.spec({"inputs": ["sphere:8"], "codecs": [{"tool": "svmm-encode"}]})
        self.sweep("--quiet", spec=spec)
        old = (self.out / "results.csv").read_bytes()
        limited = f"ulimit -f 8; exec {BIN / 'vox-sweep'} {spec} -o {self.out} --quiet"
        done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (4, 1), done.stderr)
        self.assertIn("File too large", done.stderr)
        self.assertEqual((self.out / "results.csv").read_bytes(), old)
        self.assertEqual([path.name for path in self.out.glob(".*")], [".lock"])


class FiguresTest(SweepCase):
    def test_figures(self):
        """The specs of scripts/figures are good ones."""
        specs = sorted((pathlib.Path(__file__).resolve().parents[2] / "scripts" / "figures").glob("*.json"))
        self.assertGreater(len(specs), 2)
        for spec in specs:
            self.assertGreater(json.loads(self.sweep("--dry-run", "--json", spec=spec).stdout)["settings"], 10)

    def test_figures_of_small_volumes(self):
        """Each makes the plots that it names, of values that there are; of volumes, settings and pictures made small."""
        if not (BIN.parent / "lib" / "voxkit" / "image_stack.so").exists():
            self.skipTest("the module image_stack was not built")
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("no python3-matplotlib")
        smaller = ((r"menger:[0-9]", "menger:2"), ("terrain:512:box", "menger:3"), ("terrain:512", "menger:1"), (r"(marschner-lobb|sphere):[0-9]+", r"\1:16"),
                   (r"membrane:[0-9,]+", "membrane:16,16,8"), (r'"size": "[0-9x]+"', '"size": "24x18"'), ("orbit:4", "orbit:1"), ("thesis94", "orbit:1"))
        for path in sorted((pathlib.Path(__file__).resolve().parents[2] / "scripts" / "figures").glob("*.json")):
            text = path.read_text(encoding="utf-8")
            for pattern, replacement in smaller:
                text = re.sub(pattern, replacement, text)
            spec = self.few(json.loads(text))
            with self.subTest(path.name):
                out = self.folder / path.stem
                done = self.sweep(spec=self.spec(spec, path.name), out=out)
                self.assertNotIn("no plot", done.stderr)
                made = {plot.stem for plot in out.glob("plots/*.png")}
                for plot in spec["plots"]:
                    self.assertTrue([name for name in made if name.startswith(plot["name"])], plot["name"])

    @staticmethod
    def few(spec):
        """Each built-in input once, two values of one option, and one of the others."""
        def cut(options):
            lists = [key for key, value in options.items() if isinstance(value, list)]
            return {key: value[: 2 if key == lists[-1] else 1] if key in lists else value for key, value in options.items()}
        for thing in (spec, *spec["codecs"], *spec["plots"]):
            if "inputs" in thing:
                thing["inputs"] = list(dict.fromkeys(name for name in thing["inputs"] if isinstance(name, str)))
        for codec in spec["codecs"]:
            grids = codec["options"]
            codec["options"] = [cut(grid) for grid in grids] if isinstance(grids, list) else cut(grids)
        return spec | {"repeat": 1, "threads": 1}


class BestTest(SweepCase):
    def test_against_the_table(self):
        self.swept()
        table = self.table()
        for psnr, error in ((0, 255), (30, 255), (30, 20), (60, 0)):
            done = self.sweep("--json", "--best", f"psnr>={psnr}", "--best", f"max_abs_error<={error}", code=0)
            for found in json.loads(done.stdout)["best"]:
                good = [row for row in table if row["input"] == found["input"] and float(row["psnr_db"]) >= psnr and
                        float(row["max_abs_error"]) <= error]
                self.assertEqual(found["file_bytes"], min(int(row["file_bytes"]) for row in good))
                self.assertGreaterEqual(float(found["values"]["psnr_db"]), psnr)

    def test_none(self):
        self.swept()
        done = self.sweep("--quiet", "--best", "percent<0.001", code=1)
        self.assertEqual(done.stdout, "sphere:24: no setting has percent < 0.001\nmenger:3: no setting has percent < 0.001\n")


class SpecTest(unittest.TestCase):
    """The reader of specs, on what nobody should write."""

    @classmethod
    def setUpClass(cls):
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(BIN.parent / "share" / "voxkit"))
        from sweep import failure, plan, spec, table
        cls.failure, cls.plan, cls.spec, cls.table = failure, plan, spec, table

    def names(self, _):
        return {"quality", "base", "reduce", "size", "json", "output", "peak", "help"}

    def read(self, value):
        with tempfile.NamedTemporaryFile("w", suffix=".json", encoding="utf-8") as file:
            file.write(json.dumps(value))
            file.flush()
            return self.spec.read(file.name, self.names)

    def places(self, value, path=()):
        yield path
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, item in items:
            yield from self.places(item, path + (key,))

    def test_every_wrong_value(self):
        """Any value anywhere is either read, or an error of the file with one line; never a bug."""
        good = {"inputs": ["a", {"name": "b", "input": "c", "options": {"peak": 1}, "reference": "d"}],
                "codecs": [{"tool": "svmm-encode", "name": "n", "options": {"quality": [1, 2]}, "inputs": ["b"]}],
                "renders": [{"name": "r", "options": {"size": "4x4"}, "inputs": ["a"], "codecs": ["n"], "compare": False}],
                "plots": [{"name": "p", "x": "a", "y": "b", "log": "x", "label": ["quality"], "fit": "power", "line": "all", "baseline": "c", "inputs": ["a"], "codecs": ["n"]}],
                "metrics": {"peak": 3}, "decode": False, "threads": 2, "timeout": 1.5, "repeat": 2, "keep": True, "title": "t"}
        self.assertEqual(len(self.read(good).codecs[0].settings), 2)
        wrong = [None, True, -1, 10**400, 0.5, "", "x\ny", "-x", "\ud800", [], {}, [[]], {"": {}}, [None], "a" * 1000, {"help": 1}]
        read = refused = 0
        for path, value in itertools.product(list(self.places(good)), wrong):
            changed = {"spec": json.loads(json.dumps(good))}
            at, keys = changed, ("spec",) + path
            for key in keys[:-1]:
                at = at[key]
            at[keys[-1]] = value
            try:
                spec = self.read(changed["spec"])
                versions = {name: "1" for name in (*self.spec.ENDINGS, "vox-decode", "voxdiff", "vox-render")}
                self.assertGreater(len(self.plan.cases_of(spec, versions)), 0)
                read += 1
            except self.failure.Failure as failure:
                self.assertIn(failure.code, (3, 5))
                self.assertNotIn("\n", failure.line())
                refused += 1
        self.assertGreater(read, 50)
        self.assertGreater(refused, 200)

    def test_labels_of_plots(self):
        """None hides another one, or a point, or leaves the chart; what has room has one."""
        try:
            from sweep import plots
            figure, axes = plots.new_figure()
        except ImportError:
            self.skipTest("no python3-matplotlib")
        numbers = random.Random(2)
        points = [(f"({i}, 90)", numbers.random() ** 3, numbers.random() ** 3) for i in range(60)] + [("", 0.7, 0.7), ("far", 1.5, 0.5)]
        axes.plot([a for _, a, _ in points], [b for _, _, b in points], "o", markersize=5, label="x")
        axes.legend()
        plots.place_labels(figure, axes, points)
        boxes = {note.get_text(): note.get_window_extent() for note in axes.texts}
        self.assertGreater(len(boxes), 20)
        self.assertLess(len(boxes), 61)
        self.assertIn("far", boxes)
        self.assertNotIn("", boxes)
        room = axes.get_window_extent()
        for name, box in boxes.items():
            self.assertEqual(box.count_overlaps(list(boxes.values())), 1, name)  # itself
            self.assertTrue(room.x0 <= box.x0 and box.x1 <= room.x1, name)
            self.assertFalse(any(box.contains(*axes.transData.transform((a, b))) for _, a, b in points), name)

    def test_front(self):
        numbers = random.Random(1)
        for _ in range(200):
            points = [(numbers.randrange(8), numbers.choice([None, *range(8)])) for _ in range(numbers.randrange(20))]
            expected = [i for i, (x, y) in enumerate(points) if y is not None and not any(
                v is not None and u <= x and v <= y and (u, v) != (x, y) for u, v in points)]
            self.assertEqual(sorted(self.table.front(points)), expected)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    arguments, rest = parser.parse_known_args()
    BIN = arguments.bin.resolve()
    unittest.main(argv=sys.argv[:1] + rest)
