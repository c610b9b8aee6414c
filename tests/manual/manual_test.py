#!/usr/bin/env python3
"""Manual pages and completions say what --help says, and the shells take them.

manual_test.py --bin BUILD/bin --share BUILD/share pages|bash|zsh|fish; 77: there is no such shell, or no groff.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile

# As a user of zsh meets it: types $1 and a tab, prints what the terminal shows until it is "plain", for half a minute at most.
DRIVEN = """
zmodload zsh/zpty zsh/zselect
read_until() {
  local part shown= i
  for ((i = 0; i < 300; i++)); do
    while zpty -r -t shell part; do shown+=$part; done
    [[ $shown == *$1* ]] && break
    zselect -t 10
  done
  print -r -- $shown
}
zpty shell zsh -f -i
zpty -w shell "PROMPT=; fpath=($0 \\$fpath); autoload -Uz compinit; compinit -u -D; print rea''dy"
read_until ready >/dev/null
zpty -w -n shell "$1"$'\\t'
read_until plain
zpty -d shell
"""
BASES = ["raw", "bitmap", "alpha", "gray", "bc1"]


def run(*command, **more):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **more)
    check(done.returncode == 0, f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    check(not done.stderr, f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def check(condition, what):
    if not condition:
        sys.exit(f"manual_test.py: {what}")


def need(program):
    if shutil.which(program) is None:
        print(f"skipped: {program} is not installed")
        sys.exit(77)


def options_of(program):
    """Pairs of all names and the value of each option, as --help shows them."""
    lines = re.findall(r"^  (-\S+)((?: \S+)*?)(?:  |$)", run(program, "--help").partition("\nOptions:\n")[2], re.MULTILINE)
    options = [(names.split(","), value.replace(" REQUIRED", "").partition(" Excludes:")[0].strip()) for names, value in lines]
    check(len(options) >= 10, f"{program} --help shows {len(options)} options")
    return options


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


class Pages:
    def __init__(self):
        need("groff")

    def check(self, tool, options, share):
        path = os.path.join(share, "man/man1", f"{tool}.1")
        run("groff", "-man", "-ww", "-z", "-Kutf8", "-Tutf8", path)
        if shutil.which("mandoc"):
            # Without a date, so that the page is the same whenever it is made.
            lint = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", path], capture_output=True, text=True, check=False).stdout
            wrong = [line for line in lint.splitlines() if "missing date" not in line]
            check(not wrong, "\n".join(wrong))
        text = run("groff", "-man", "-Kutf8", "-Tascii", "-P-cbou", "-rLL=999n", path)
        for section in ("NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "ENVIRONMENT", "EXAMPLES", "SEE ALSO"):
            check(re.search(rf"^{section}$", text, re.MULTILINE), f"{tool}.1 has no section {section}")
        for names, value in options:
            entry = f"       {', '.join(names)} {value}".rstrip()
            # A short one has its text on the same line.
            check(re.search(rf"^{re.escape(entry)}( +[A-Z].*)?$", text, re.MULTILINE), f"{tool}.1 lacks the entry {entry.strip()}")


class Bash:
    def __init__(self):
        need("bash")

    def complete(self, script, tool, *words, folder=None):
        """What is offered for the last word."""
        program = f"""source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
            [[ $(complete -p {tool}) == *" -F "* ]] || exit 1
            $(complete -p {tool} | sed 's/.* -F \\([^ ]*\\) .*/\\1/') && printf '%s\\n' "${{COMPREPLY[@]}}" """
        return run("bash", "--norc", "-c", program, script, tool, *words, cwd=folder).split()

    def check(self, tool, options, share):
        script = os.path.join(share, "bash-completion/completions", tool)
        run("bash", "-n", script)
        offered = self.complete(script, tool, "-")
        check(offered == [name for names, _ in options for name in names], f"{tool} -<Tab> offers {offered}")
        check(self.complete(script, tool, "--vers") == ["--version"], f"{tool} --vers<Tab>")
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "scan of a head.nrrd"), "w", encoding="ascii"):
                pass
            names_file = [["-o", ""], ["--output", "s"], ["--output", "="]] if tool not in ("vox-info", "vox-sweep") else []
            for words in ([""], ["sca"], ["--json", "s"], *names_file):
                offered = " ".join(self.complete(script, tool, *words, folder=folder))
                check(offered == "scan of a head.nrrd", f"{tool} {' '.join(words)}<Tab> offers {offered}")
            check(self.complete(script, tool, "--max-memory", "", folder=folder) == [], f"{tool} --max-memory <Tab>")
        check(self.complete(script, tool, "--progress", "=", "p") == ["plain"], f"{tool} --progress=p<Tab>")
        if tool == "svmm-encode":
            check(self.complete(script, tool, "-b", "") == BASES, "svmm-encode -b <Tab>")


class Zsh:
    def __init__(self):
        need("zsh")

    def check(self, tool, options, share):
        script = os.path.join(share, "zsh/site-functions", f"_{tool}")
        run("zsh", "-n", script)
        check(read(script).startswith(f"#compdef {tool}\n"), f"_{tool} does not begin with #compdef")
        given = run("zsh", "-f", "-c", "_arguments() { print -rl -- $@ }; . $0", script).splitlines()
        names = [found[1] for found in (re.match(r"\([^)]*\)(-[A-Za-z]|--[a-z0-9-]+)[=+]?\[", line) for line in given) if found]
        check(names == [name for all_names, _ in options for name in all_names], f"_{tool} offers {names}")
        check(any(line.endswith(":_files") and line.startswith(":") for line in given), f"_{tool} offers no files")
        if tool == "svmm-encode":
            check(any(line.startswith("(-b --base)--base=[") and line.endswith(f":BASE:({' '.join(BASES)})") for line in given),
                  "_svmm-encode does not offer bases")
        with tempfile.TemporaryDirectory() as home:
            shown = run("zsh", "-f", "-c", DRIVEN, os.path.dirname(script), f"{tool} --progress p",
                        env=dict(os.environ, HOME=home, ZDOTDIR=home))
            check("plain" in shown, f"{tool} --progress p<Tab> in zsh shows {shown!r}")


class Fish:
    def __init__(self):
        need("fish")

    def complete(self, script, line, home):
        offered = run("fish", "--no-config", "-c", f"source {script}; complete -C '{line}'", env=dict(os.environ, HOME=home), cwd=home)
        return [line.partition("\t")[0] for line in offered.splitlines()]

    def check(self, tool, options, share):
        script = os.path.join(share, "fish/vendor_completions.d", f"{tool}.fish")
        run("fish", "--no-execute", script)
        with tempfile.TemporaryDirectory() as home:
            with open(os.path.join(home, "head.nrrd"), "w", encoding="ascii"):
                pass
            offered = self.complete(script, f"{tool} --", home)
            long = [names[-1] for names, _ in options]
            check(sorted(offered) == sorted(long), f"{tool} --<Tab> offers {offered}: expected {long}")
            check(self.complete(script, f"{tool} --progress ", home) == ["auto", "never", "plain"], f"{tool} --progress <Tab>")
            check(self.complete(script, f"{tool} he", home) == ["head.nrrd"], f"{tool} he<Tab>")
            if tool == "svmm-encode":
                check(sorted(self.complete(script, "svmm-encode -b ", home)) == sorted(BASES), "svmm-encode -b <Tab>")


def main():
    parts = {"pages": Pages, "bash": Bash, "zsh": Zsh, "fish": Fish}
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--share", required=True)
    parser.add_argument("part", choices=parts)
    arguments = parser.parse_args()
    part = parts[arguments.part]()
    share = os.path.abspath(arguments.share)
    tools = sorted(os.listdir(os.path.join(share, "man/man1")))
    check(len(tools) >= 9, f"pages: {tools}")
    for page in tools:
        tool = page.removesuffix(".1")
        part.check(tool, options_of(os.path.join(arguments.bin, tool)), share)
    print("ok")


if __name__ == "__main__":
    main()
