#!/usr/bin/env python3
"""Runs the command-line cases of a folder and compares what the programs print and how they end.

A case is a text file. Each runs in an empty folder of its own, line by line:

    # a comment
    $ command line, run by sh
    > a line of standard output
    2> a line of standard error
    = exit code, where it is not 0

In expected lines <*> stands for any text, and a line of only <...> for any number of lines.

    run.py --bin BUILD/bin [--bless] FOLDER-OR-CASE...

--bless writes what the programs do now into the cases where that differs.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ANY_LINES = "<...>"


def line_matches(expected, line):
    pattern = ".*".join(re.escape(part) for part in expected.split("<*>"))
    return re.fullmatch(pattern, line, re.DOTALL) is not None


def lines_match(expected, lines):
    if not expected:
        return not lines
    if expected[0] == ANY_LINES:
        return any(lines_match(expected[1:], lines[i:]) for i in range(len(lines) + 1))
    return bool(lines) and line_matches(expected[0], lines[0]) and lines_match(expected[1:], lines[1:])


class Step:
    def __init__(self, command):
        self.before = []  # comments and empty lines
        self.command = command
        self.out, self.err, self.code = [], [], 0

    def expectation(self):
        lines = ["> " + line if line else ">" for line in self.out]
        lines += ["2> " + line if line else "2>" for line in self.err]
        return lines + ([f"= {self.code}"] if self.code else [])


def parse(path):
    steps, before = [], []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.startswith("$ "):
            steps.append(Step(line[2:]))
            steps[-1].before, before = before, []
        elif not line or line.startswith("#"):
            before.append(line)
        elif not steps or before:
            sys.exit(f"{path}:{number}: an expectation without a command before it")
        elif line.startswith("2>"):
            steps[-1].err.append(line[3:])
        elif line.startswith(">"):
            steps[-1].out.append(line[2:])
        elif line.startswith("= "):
            steps[-1].code = int(line[2:])
        else:
            sys.exit(f"{path}:{number}: expected a line that begins with #, $, >, 2> or =")
    return steps, before


def run_case(path, bin_folder, bless):
    steps, after = parse(path)
    env = {"PATH": f"{bin_folder}:{os.environ['PATH']}", "LC_ALL": "C", "HOME": "/nonexistent"}
    for name in ("TMPDIR", "ASAN_OPTIONS", "UBSAN_OPTIONS", "TSAN_OPTIONS"):
        if name in os.environ:
            env[name] = os.environ[name]
    failures, changed = [], False
    with tempfile.TemporaryDirectory(prefix="voxkit-cli-") as folder:
        for step in steps:
            try:
                done = subprocess.run(["sh", "-c", step.command], cwd=folder, env=env, stdin=subprocess.DEVNULL,
                                      capture_output=True, timeout=120)
            except subprocess.TimeoutExpired:
                failures.append(f"$ {step.command}\n  took longer than 120 seconds")
                break
            out = done.stdout.decode(errors="replace").splitlines()
            err = done.stderr.decode(errors="replace").splitlines()
            if lines_match(step.out, out) and lines_match(step.err, err) and step.code == done.returncode:
                continue
            expected = step.expectation()
            step.out = step.out if lines_match(step.out, out) else out
            step.err = step.err if lines_match(step.err, err) else err
            step.code = done.returncode
            changed = True
            failures.append("\n".join([f"$ {step.command}", "  expected:"] + ["    " + e for e in expected] +
                                      ["  got:"] + ["    " + e for e in step.expectation()]))
    if bless and changed:
        lines = []
        for step in steps:
            lines += step.before + ["$ " + step.command] + step.expectation()
        path.write_text("\n".join(lines + after) + "\n")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("--bless", action="store_true", help="accept what the programs do now")
    parser.add_argument("cases", nargs="+", type=pathlib.Path)
    args = parser.parse_args()
    paths = []
    for case in args.cases:
        paths += sorted(case.rglob("*.case")) if case.is_dir() else [case]
    if not paths:
        sys.exit("no cases found")
    failed = 0
    for path in paths:
        failures = run_case(path, args.bin.resolve(), args.bless)
        failed += bool(failures)
        for failure in failures:
            print(f"{path}: {'blessed' if args.bless else 'FAILED'}\n{failure}")
    print(f"{len(paths)} cases, {failed} {'changed' if args.bless else 'failed'}")
    return 1 if failed and not args.bless else 0


if __name__ == "__main__":
    sys.exit(main())
