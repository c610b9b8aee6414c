"""A manual page, section 1, in the macros of man(7)."""
import dataclasses
import json
import re


def escaped(text):
    """Text as it is: no letter of it is a command."""
    return text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("^", "\\(ha").replace("~", "\\(ti")


def paragraph(text):
    """A line of running text; hyphens in words stay hyphens, those of options are signs that can be copied."""
    text = re.sub(r"(?<!\w)-|-(?=-)", "\0", text)
    return "\\&" + text.replace("\\", "\\e").replace("'", "\\(aq").replace("\0", "\\-")


def bold(text):
    return f"\\fB{escaped(text)}\\fR"


def italic(text):
    return f"\\fI{escaped(text)}\\fR"


def name_line(table):
    first = re.match(r"[^.]+", table.purpose)[0]
    return f"{escaped(table.tool)} \\- {first[0].lower()}{first[1:]}"


def synopsis(table):
    required = [f"{bold(min(option.names, key=len))} {italic(option.value)}" for option in table.options if option.required]
    arguments = [italic(argument.name) + (" ..." if argument.several else "") for argument in table.arguments]
    return " ".join([bold(table.tool), f"[{italic('OPTIONS')}]", *required, *arguments])


def option_entry(option):
    head = ", ".join(bold(name) for name in option.names)
    if option.value:
        head += f" {italic(option.value)}"
    text = [paragraph(option.help + "." if option.help[-1] not in ".!?" else option.help)]
    if not all(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", f"{option.value} {option.help}") for word in option.words):
        text.append(f"One of {', '.join(bold(word) for word in option.words)}.")
    if option.required:
        text.append("Required.")
    if option.excludes:
        text.append(f"Not together with {', '.join(bold(name) for name in option.excludes)}.")
    return [".TP", head, *text]


def page(table, version, others):
    """`others`: the names of all programs."""
    lines = [f'.TH "{escaped(table.tool.upper())}" 1 "" "Voxkit {version}" "Voxkit"', ".nh", ".ad l",
             ".SH NAME", name_line(table), ".SH SYNOPSIS", synopsis(table), ".SH DESCRIPTION", paragraph(table.purpose)]
    for argument in table.arguments:
        lines += [".TP", italic(argument.name), paragraph(argument.help + ".")]
    if "README" in json.dumps(dataclasses.asdict(table)):
        lines += [".PP", "A README file that is named here is in the folder", italic("share/doc/voxkit"), "of the installation."]
    lines.append(".SH OPTIONS")
    for option in table.options:
        lines += option_entry(option)
    lines.append(".SH EXIT STATUS")
    for code, meaning in table.exit_codes:
        lines += [".TP", bold(str(code)), paragraph(meaning + ".")]
    lines += [".SH ENVIRONMENT", ".TP", bold("VOX_THREADS"), f"Worker threads, where {bold('--threads')} is not given."]
    lines += [".SH EXAMPLES", ".EX", *("\\&" + escaped(example) for example in table.examples), ".EE"]
    see = [name for name in others if name != table.tool]
    lines += [".SH SEE ALSO", *(f".BR {escaped(name)} (1){',' if name != see[-1] else ''}" for name in see)]
    return "\n".join(lines) + "\n"
