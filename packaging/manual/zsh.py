"""Completion for zsh."""


def quoted(text):
    return "'" + text.replace("'", "'\\''") + "'"


def message(text):
    """The explanation in a specification of _arguments, or what it calls a value."""
    return text.replace("\\", "\\\\").replace("[", "\\[").replace("]", "\\]").replace(":", "\\:")


def action(option):
    if option.words:
        return f"({' '.join(option.words)})"
    return {"file": "_files", "folder": "_files -/", "": " "}[option.kind]  # a blank: nothing to offer


def specifications(option):
    """One for each name; each shuts out the others, and what the option excludes."""
    others = " ".join([*option.names, *option.excludes])
    tail = f":{message(option.value)}:{action(option)}" if option.value else ""
    for name in option.names:
        joined = ("=" if name.startswith("--") else "+") if option.value else ""
        yield quoted(f"({others}){name}{joined}[{message(option.help)}]{tail}")


def completion(table):
    lines = [specification for option in table.options for specification in specifications(option)]
    lines += [quoted(f"{'*' if argument.several else ''}:{message(argument.name)}:_files") for argument in table.arguments]
    return f"#compdef {table.tool}\n# zsh completion; made from what its --help shows.\n_arguments -s -S \\\n  " + " \\\n  ".join(lines) + "\n"
