#!/usr/bin/env python3
"""Times commands in turn: alternate.py [-n ROUNDS] [-o OUT.json] COMMAND...

Each COMMAND is one argument, split as a shell would. All are run once unmeasured, then ROUNDS times in turn, so that
whatever else the machine does meets all of them. Prints a table of wall and CPU seconds, and the load before and after.
"""
import argparse
import json
import os
import pathlib
import shlex
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent / "suite"))
from process import Failed, run  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", "--rounds", type=int, default=10)
    parser.add_argument("-o", "--output", help="all figures, as JSON")
    parser.add_argument("commands", nargs="+", metavar="COMMAND")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error("--rounds: expected 1 or more")
    commands = [shlex.split(command) for command in options.commands]

    load = os.getloadavg()[0]
    for words in commands:
        run(*words, out=os.devnull)
    results = [[] for _ in commands]
    for _ in range(options.rounds):
        for words, result in zip(commands, results):
            result.append(run(*words, out=os.devnull))

    print(f"{options.rounds} rounds; load {load:.2f} before, {os.getloadavg()[0]:.2f} after\n")
    print("| command | wall min | wall median | wall max | CPU median | MB |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for command, result in zip(options.commands, results):
        wall, cpu, memory = zip(*((one.seconds, one.cpu_seconds, one.peak_bytes) for one in result))
        print(f"| `{command}` | {min(wall):.3f} | {statistics.median(wall):.3f} | {max(wall):.3f} "
              f"| {statistics.median(cpu):.3f} | {max(memory) / 1e6:.0f} |")
    if options.output:
        rows = [{"command": command, "runs": [{"wall_s": one.seconds, "cpu_s": one.cpu_seconds, "rss_bytes": one.peak_bytes} for one in result]}
                for command, result in zip(options.commands, results)]
        with open(options.output, "w", encoding="utf-8") as out:
            json.dump(rows, out, indent=1)


if __name__ == "__main__":
    try:
        main()
    except Failed as problem:
        sys.exit(str(problem))
