#!/usr/bin/env python3
"""Runs the examples of the main README and follows the links of all READMEs: test_readme.py --bin BUILD/bin

An example is a ```sh block: lines that begin with "$ " are commands, the lines after one are what it prints on standard
output and standard error together. The blocks are run in order, in one empty folder. Every command must exit 0 and
print what is shown, but for times, such as "in 0.11 s" and "3.5 ms a frame".
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def examples(text):
    """Yields (command, lines shown)."""
    for block in re.findall(r"^```sh\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        command, shown = None, []
        for line in block.splitlines():
            if line.startswith("$ "):
                if command is not None:
                    yield command, shown
                command, shown = line[2:], []
            elif command is None:
                sys.exit(f'README.md: "{line}": expected a line that begins with "$ " at the start of an example')
            else:
                shown.append(line)
        if command is not None:
            yield command, shown


def without_times(lines):
    lines = [re.sub(r"\bin \d+\.\d+ s\b", "in <time> s", line) for line in lines]
    return [re.sub(r"[\d.e+]+ ms a frame, [\d.e+]+ million rays", "<time> a frame, <speed>", line) for line in lines]


def run_examples(bin_folder):
    failures, count = [], 0
    env = dict(os.environ, PATH=f"{bin_folder}:{os.environ['PATH']}", LC_ALL="C")
    with tempfile.TemporaryDirectory(prefix="voxkit-readme-") as folder:
        for command, shown in examples((ROOT / "README.md").read_text(encoding="utf-8")):
            count += 1
            # In a pipe every program must succeed, so bash.
            done = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=folder, env=env,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  timeout=120)
            printed = done.stdout.decode(errors="replace").splitlines()
            if done.returncode != 0 or without_times(printed) != without_times(shown):
                failures.append("\n".join([f"README.md: $ {command}", "  shown:"] + ["    " + line for line in shown] +
                                          [f"  printed, with exit code {done.returncode}:"] +
                                          ["    " + line for line in printed]))
    print(f"{count} commands, {len(failures)} failed")
    if count == 0:
        failures.append("README.md: expected examples in ```sh blocks")
    return failures


def follow_links():
    failures = []
    pages = [ROOT / "README.md", ROOT / "CHANGELOG.md", *ROOT.glob("*/README.md")]
    for page in pages:
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
            if "://" not in target and not (page.parent / target).exists():
                failures.append(f"{page.relative_to(ROOT)}: the link to {target} leads nowhere")
    print(f"{len(pages)} pages, {len(failures)} broken links")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    failures = run_examples(parser.parse_args().bin.resolve()) + follow_links()
    for failure in failures:
        print(failure)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
