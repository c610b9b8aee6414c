"""What a program says of itself with --describe: its options, and what else stands in --help."""
import dataclasses
import json
import subprocess


@dataclasses.dataclass(frozen=True)
class Option:
    names: list  # "-b", "--base"; the long one last
    value: str  # what --help calls its value; "" for a flag
    help: str
    required: bool
    kind: str  # what its value names: "file", "folder", or ""
    words: list  # all values that there are, where these are words
    excludes: list  # names of options that cannot be given as well

    def long(self):
        return self.names[-1]


@dataclasses.dataclass(frozen=True)
class Argument:
    """Names a file."""
    name: str
    help: str
    several: bool = False  # it may be given more than once


@dataclasses.dataclass(frozen=True)
class Table:
    tool: str
    purpose: str
    arguments: list
    options: list
    examples: list  # command lines
    exit_codes: list  # (number, meaning)


def table_of(program):
    told = json.loads(subprocess.run([program, "--describe"], check=True, capture_output=True, text=True).stdout)
    if told["schema"] != 1:
        raise ValueError(f'{program} --describe: schema {told["schema"]}: expected 1')
    return Table(told["tool"], told["purpose"], [Argument(**argument) for argument in told["arguments"]],
                 [Option(**option) for option in told["options"]], told["examples"],
                 [(entry["code"], entry["meaning"]) for entry in told["exit_codes"]])
