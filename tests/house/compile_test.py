#!/usr/bin/env python3
"""What a compiler must say about this source, without building it.

usage: compile_test.py dropped COMPILER
       compile_test.py aarch64 FOLDER-OF-BUILD_INFO HEADER...
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
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


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def aarch64(build_info, *headers):
    """Libraries and programs compile for other machines than this one: by Clang, which needs no more than headers. Those
    that are given are precompiled. Files that want a header of a library that is not here are left out, and named."""
    clang = next((found for name in ("clang++", "clang++-14") if (found := shutil.which(name))), None)
    if not clang:
        skip("no clang++ here: expected Debian's clang")
    folders = [f for name in ("nifti", "Imath", "gdcm-*") for f in Path("/usr/include").glob(name)]
    command = [clang, "--target=aarch64-linux-gnu", "-std=c++20", "-w", "-fPIC", f"-I{ROOT}", f"-I{build_info}",
               *(f"-isystem{f}" for f in folders)]
    probe = subprocess.run([*command, "-fsyntax-only", "-xc++", "-"], input="#include <cstdlib>\n#include <vector>\n",
                           capture_output=True, text=True)
    if probe.returncode != 0:
        skip("no headers for aarch64 here: expected Debian's libc6-dev-arm64-cross and libstdc++-12-dev-arm64-cross")
    sources = [f for top in ("formats", "lib*", "tools") for f in sorted(ROOT.glob(f"{top}/**/*.cc"))]
    wrong, left_out = [], []
    with tempfile.TemporaryDirectory(prefix="voxkit-aarch64-") as temporary:
        all_headers = Path(temporary, "all.h")
        all_headers.write_text("".join(f"#include {header}\n" for header in headers))
        pch = f"{all_headers}.pch"
        subprocess.run([*command, "-xc++-header", str(all_headers), "-o", pch], check=True)
        command += ["-include-pch", pch, "-fsyntax-only"]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            runs = pool.map(lambda f: subprocess.run([*command, str(f)], capture_output=True, text=True), sources)
            for source, run in zip(sources, runs):
                name = str(source.relative_to(ROOT))
                if run.returncode == 0:
                    continue
                errors = [line for line in run.stderr.splitlines() if "error:" in line] or ["failed"]
                missing = re.search(r"fatal error: '([^']+)' file not found", errors[0])
                if missing and not re.match(r"(formats|lib\w+|tools)/|build_info", missing.group(1)):
                    left_out.append(f"{name} ({missing.group(1)})")
                else:
                    wrong.append(f"{name}: {errors[0]}")
    print(f"{len(sources) - len(left_out)} files for aarch64; left out: {', '.join(left_out) or 'none'}")
    return wrong


def main():
    check = {"dropped": dropped, "aarch64": aarch64}.get(sys.argv[1] if len(sys.argv) > 2 else "")
    if not check:
        sys.exit(__doc__)
    wrong = check(*sys.argv[2:])
    for line in wrong:
        print(line)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
