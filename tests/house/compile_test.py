#!/usr/bin/env python3
"""What a compiler must say about this source, without building it.

usage: compile_test.py dropped COMPILER
"""
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77


def dropped(compiler):
    """Who drops a Result or a Status hears of it, and who looks at them does not."""
    source = """#include "formats/result.h"
voxkit::Status status();
voxkit::Result<int> result();
bool both() { return status() && result(); }
"""
    wrong = []
    for extra, expected in (("", 0), ("void f() { status(); }", 1), ("void f() { result(); }", 1)):
        run = subprocess.run([compiler, "-std=c++20", "-Werror=unused-result", "-fsyntax-only", f"-I{ROOT}",
                              "-xc++", "-"], input=source + extra, capture_output=True, text=True)
        if (run.returncode != 0) != expected or (expected and "unused-result" not in run.stderr):
            wrong.append(f"{extra or 'no more'}: {run.stderr or 'compiled'}")
    return wrong


def main():
    check = {"dropped": dropped}.get(sys.argv[1] if len(sys.argv) > 2 else "")
    if not check:
        sys.exit(__doc__)
    wrong = check(*sys.argv[2:])
    for line in wrong:
        print(line)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
