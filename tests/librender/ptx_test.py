#!/usr/bin/env python3
"""The device code must round as the host does: multiply-adds are never contracted, nothing is approximated.

Compiles the kernels to PTX with the build's own flags and looks for instructions that would break that. The
one place that asks for fused multiply-adds is ExactRay, which wants the rounding error of a product.

    ptx_test.py NVCC SOURCE... -- FLAGS...
"""
import re
import subprocess
import sys


def look_through(ptx):
    """Counts kernels and multiply-adds in ExactRay; collects what is wrong."""
    function, kernels, exact, wrong = "", 0, 0, []
    for line in ptx.splitlines():
        if re.search(r"\.(entry|func)\b", line):
            kernels += ".entry" in line
            name = re.search(r"(_Z\w+)", line)
            function = name.group(1) if name else ""
        if re.search(r"\bfma\.|\bmad\.(?:rn\.)?f|\.approx\b|\.ftz\b|\.full\b", line):
            if "ExactRay" in function and re.search(r"\bfma\.rn\.f64\b", line):
                exact += 1
            else:
                wrong.append(f"{function}: {line.strip()}")
    return kernels, exact, wrong


def main():
    end = sys.argv.index("--")
    nvcc, sources, flags = sys.argv[1], sys.argv[2:end], sys.argv[end + 1:]
    failed, all_exact = False, 0
    for source in sources:
        ptx = subprocess.run([nvcc, *flags, "-arch=sm_80", "-ptx", source, "-o", "-"], check=True,
                             stdout=subprocess.PIPE, text=True).stdout
        kernels, exact, wrong = look_through(ptx)
        print(f"{source}: {kernels} kernels; {exact} multiply-adds in ExactRay; {len(wrong)} elsewhere")
        print("\n".join(wrong))
        failed |= bool(wrong) or not kernels
        all_exact += exact
    return 1 if failed or not all_exact else 0


sys.exit(main())
