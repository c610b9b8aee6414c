#!/usr/bin/env python3
"""Writes the manual page and the completions of a program from what it says of itself.

generate.py PROGRAM VERSION OUT ALL...: ALL are the names of all programs; OUT is the folder that becomes share/.
"""
import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

from manual import bash, fish, man_page, zsh  # noqa: E402
from manual.table import table_of  # noqa: E402

# Where manuals and shells look, below share/.
PLACES = {"man": "man/man1/{}.1", "bash": "bash-completion/completions/{}", "zsh": "zsh/site-functions/_{}",
          "fish": "fish/vendor_completions.d/{}.fish"}


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def main():
    program, version, out, *everything = sys.argv[1:]
    table = table_of(program)
    texts = {"man": man_page.page(table, version, everything), "bash": bash.completion(table), "zsh": zsh.completion(table),
             "fish": fish.completion(table)}
    for kind, text in texts.items():
        write(os.path.join(out, PLACES[kind].format(table.tool)), text)


if __name__ == "__main__":
    main()
