#!/usr/bin/env python3
"""A sweep as a Snakemake workflow, on this machine, and on Slurm where it can be started. Exits 77 where there is no Snakemake.

    workflow_test.py --bin BUILD/bin
"""
import argparse
import csv
import io
import json
import os
import pathlib
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

BIN = pathlib.Path()
SPEC = {"inputs": ["sphere:20", "menger:2"], "threads": 1,
        "codecs": [{"tool": "svmm-encode", "name": "svmm", "options": {"quality": [60, 100], "rootwidth": 4, "blockwidth": "2"}},
                   {"tool": "vq-encode", "name": "vq"}]}  # which cannot encode colours
TIMES = ("seconds", "_mb_per_s", "peak_rss_bytes", "threads")
SLURM = """ClusterName=voxkit
SlurmctldHost={host}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={port}
SlurmdPort={next_port}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory=512 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def free_port():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


class WorkflowTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="voxkit-workflow-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.spec = self.folder / "spec.json"
        self.spec.write_text(json.dumps(SPEC), encoding="utf-8")

    def sweep(self, out, *arguments):
        return subprocess.run([str(BIN / "vox-sweep"), str(self.spec), "-o", str(out), "--quiet", *arguments], capture_output=True,
                              text=True, timeout=300, check=False)

    def snakemake(self, out, *arguments, **environment):
        done = subprocess.run(["snakemake", "--snakefile", str(out / "Snakefile"), *arguments], cwd=self.folder, text=True,
                              env=dict(os.environ, HOME=str(self.folder), **environment),
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=500, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def lasting(self, out):
        text = (out / "results.csv").read_text(encoding="utf-8")
        return [{key: value for key, value in row.items() if not key.endswith(TIMES)} for row in csv.DictReader(io.StringIO(text))]

    def check_against_whole(self, out):
        whole = self.folder / "whole"
        self.assertEqual(self.sweep(whole).returncode, 1)
        self.assertEqual(self.lasting(out), self.lasting(whole))
        self.assertEqual([row["status"] for row in self.lasting(out)], ["done", "done", "done", "done", "done", "failed"])
        self.assertTrue((out / "index.html").stat().st_size > 10000)

    def test_here(self):
        out = self.folder / "here"
        self.assertEqual(self.sweep(out, "--snakemake").returncode, 0)
        self.snakemake(out, "--cores", "2")
        self.check_against_whole(out)
        # A second time nothing is to be done.
        self.assertIn("Nothing to be done", self.snakemake(out, "--cores", "2"))

    def start_slurm(self):
        """Slurm of one node, for this test alone; skips where that cannot be."""
        for program in ("slurmctld", "slurmd", "sbatch", "munged", "mungekey"):
            if shutil.which(program, path=os.environ["PATH"] + ":/usr/sbin:/sbin") is None:
                self.skipTest(f"no {program}: expected the packages slurmctld, slurmd, slurm-client and munge")
        if os.geteuid() != 0:
            self.skipTest("slurmd needs root")
        self.folder.chmod(0o755)
        key = self.folder / "munge.key"
        subprocess.run(["mungekey", "--create", "--keyfile", str(key)], check=True)
        munge = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.folder}/munge.socket",
                 f"--pid-file={self.folder}/munge.pid", f"--seed-file={self.folder}/munge.seed", f"--log-file={self.folder}/munge.log"]
        host = socket.gethostname().split(".")[0]
        config = self.folder / "slurm.conf"
        config.write_text(SLURM.format(folder=self.folder, host=host, user=pwd.getpwuid(os.geteuid()).pw_name, cpus=os.cpu_count(),
                                       port=free_port(), next_port=free_port()), encoding="utf-8")
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        environment = dict(os.environ, SLURM_CONF=str(config), PATH=os.environ["PATH"] + ":/usr/sbin:/sbin")
        for command in (munge, ["slurmctld", "-D", "-f", str(config)], ["slurmd", "-D", "-f", str(config), "-N", host]):
            process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(process.wait)
            self.addCleanup(process.terminate)
            time.sleep(0.5)
        state, deadline = "", time.monotonic() + 30
        while "idle" not in state and time.monotonic() < deadline:
            time.sleep(0.5)
            state = subprocess.run(["sinfo", "-h", "-o", "%T"], env=environment, capture_output=True, text=True, check=False).stdout
        if "idle" not in state:
            logs = [path.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:] for path in sorted(self.folder.glob("*.log"))]
            self.skipTest(f"Slurm does not start here: {logs}")
        return {"SLURM_CONF": str(config)}

    def test_slurm(self):
        environment = self.start_slurm()
        out = self.folder / "slurm"
        self.assertEqual(self.sweep(out, "--snakemake", "--threads", "2", "--max-memory", "512M").returncode, 0)
        sbatch = "sbatch --parsable --cpus-per-task={threads} --mem={resources.mem_mb} --output=/dev/null"
        self.snakemake(out, "--jobs", "4", "--cluster", sbatch, "--latency-wait", "10", **environment)
        self.check_against_whole(out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    arguments, rest = parser.parse_known_args()
    BIN = arguments.bin.resolve()
    if shutil.which("snakemake") is None:
        print("skipped: expected the package snakemake")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1] + rest)
