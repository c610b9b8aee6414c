"""Completion for fish."""


def quoted(text):
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def line(tool, option):
    parts = [f"complete -c {tool}"]
    parts += [f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names]
    if option.words:
        parts.append(f"-x -a {quoted(' '.join(option.words))}")
    elif option.kind == "folder":
        parts.append("-x -a '(__fish_complete_directories)'")
    elif option.kind == "file":
        parts.append("-r -F")
    elif option.value:
        parts.append("-x")  # a number, say: nothing to offer
    return " ".join([*parts, f"-d {quoted(option.help)}"])


def completion(table):
    lines = [f"# fish completion for {table.tool}; made from what its --help shows."]
    return "\n".join(lines + [line(table.tool, option) for option in table.options]) + "\n"
