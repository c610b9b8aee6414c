#!/usr/bin/env python3
"""Installs, moves what was installed, runs it there, and builds a project of its own against it.

consumer_test.py --cmake CMAKE --generator NAME --build FOLDER --compiler CXX [--flags FLAGS]; 77: cannot be run, with the reason.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
EXPECTED = """\
svmm: [0-9]+ bytes, [1-9][0-9]* of 262144 voxels differ, greatest error ([0-9.]+)
render: ([1-9][0-9]*) of 4096 rays hit, [1-9] levels
vq: [0-9]+ bytes, 0 of 262144 voxels differ, greatest error 0
vq: [1-9][0-9]* of 4096 bricks are different
color: 8000 voxels
"""


def run(*command, **more):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def files_below(folder):
    return sorted(os.path.relpath(os.path.join(path, name), folder) for path, _, names in os.walk(folder) for name in names)


def check(condition, what):
    if not condition:
        sys.exit(f"consumer_test.py: {what}")


def check_headers(include):
    """What an installed header includes of ours is installed."""
    headers = files_below(include)
    check("libsvmm/svmm.h" in headers, f"no libsvmm/svmm.h in {include}")
    for header in headers:
        with open(os.path.join(include, header), encoding="utf-8") as file:
            for name in re.findall(r'^#include "([^"]+)"', file.read(), re.MULTILINE):
                check(name in headers, f"{header} includes {name}, which is not installed: name it in voxkit_library()")


def check_modules(build, library):
    """Every module that was built."""
    built = files_below(os.path.join(build, "lib", "voxkit"))
    check(files_below(os.path.join(library, "voxkit")) == built, f"the modules in {library}/voxkit are not those built: {built}")


def check_programs(prefix, library, folder):
    """Programs find the installed library, and it the modules."""
    programs = os.path.join(prefix, "bin")
    encode = os.path.join(programs, "svmm-encode")
    linked = re.search(r"libvoxkit-formats\S* => (\S+)", run("ldd", encode))
    check(linked and os.path.realpath(linked[1]).startswith(os.path.realpath(library) + os.sep),
          f"svmm-encode is linked with {linked and linked[1]}: expected the library in {library}")
    run(encode, "menger:2", "-o", "sponge.svmm", "--quiet", cwd=folder)
    if os.path.exists(os.path.join(library, "voxkit", "image_stack.so")):
        run(os.path.join(programs, "vox-decode"), "sponge.svmm", "-o", "slice-%d.png", "--quiet", cwd=folder)
        check(os.path.exists(os.path.join(folder, "slice-8.png")), "vox-decode wrote no slices")
    with open(os.path.join(folder, "spec.json"), "w", encoding="utf-8") as file:
        file.write('{"inputs": ["sphere:16"], "codecs": [{"tool": "svmm-encode", "options": {"quality": [90, 100]}}]}')
    plan = run(os.path.join(programs, "vox-sweep"), "spec.json", "-o", "sweep", "--dry-run", cwd=folder)
    check("svmm-encode" in plan, f"vox-sweep plans no encoding: {plan}")


def check_manual(prefix):
    """Every program has its page and its completions."""
    share = files_below(os.path.join(prefix, "share"))
    for program in files_below(os.path.join(prefix, "bin")):
        for path in (f"man/man1/{program}.1", f"bash-completion/completions/{program}", f"zsh/site-functions/_{program}",
                     f"fish/vendor_completions.d/{program}.fish"):
            check(path in share, f"there is no share/{path}")


def check_consumer(arguments, prefix, folder):
    """A project that knows nothing but where Voxkit is installed."""
    build = os.path.join(folder, "consumer")
    run(arguments.cmake, "-G", arguments.generator, "-S", HERE, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_COMPILER={arguments.compiler}",
        f"-DCMAKE_CXX_FLAGS={arguments.flags}", "-DCMAKE_BUILD_TYPE=Release")
    run(arguments.cmake, "--build", build)
    printed = run(os.path.join(build, "consumer"))
    found = re.fullmatch(EXPECTED, printed)
    check(found, f"the consumer printed\n{printed}expected\n{EXPECTED}")
    check(float(found[1]) <= 25.5, f"greatest error {found[1]}: quality 90 promises 25.5")
    check(int(found[2]) < 4096, "a ball does not fill the picture")


def main():
    parser = argparse.ArgumentParser()
    for name in ("cmake", "generator", "build", "compiler"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--flags", default="")
    arguments = parser.parse_args()
    if not os.access(arguments.cmake, os.X_OK):
        print(f"skipped: {arguments.cmake} is not there")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        stage, prefix = os.path.join(folder, "stage"), os.path.join(folder, "prefix")
        run(arguments.cmake, "--install", arguments.build, "--prefix", stage)
        os.rename(stage, prefix)  # nothing may know where it was
        found = [os.path.dirname(path) for path in files_below(prefix) if re.search(r"/libvoxkit-formats\.so$", path)]
        check(len(found) == 1, f"libvoxkit-formats.so is in {found}: expected one folder")
        library = os.path.join(prefix, found[0])
        check_headers(os.path.join(prefix, "include", "voxkit"))
        check_modules(arguments.build, library)
        check_programs(prefix, library, folder)
        check_manual(prefix)
        check_consumer(arguments, prefix, folder)
    print("ok")


if __name__ == "__main__":
    main()
