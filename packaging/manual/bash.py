"""Completion for bash."""
import shlex

TEMPLATE = """\
# bash completion for {tool}; made from what its --help shows.
{function}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}}
  # --option=value is three words, of which the value may be missing.
  if [[ $current == "=" ]]; then
    current=
  elif [[ $previous == "=" ]]; then
    previous=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  COMPREPLY=()
  case $previous in
{cases}  esac
  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W {options} -- "$current")
  else
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}}
complete -F {function} {tool}
"""


def action(option):
    """The lines that complete its value."""
    if option.words:
        return [f'mapfile -t COMPREPLY < <(compgen -W {shlex.quote(" ".join(option.words))} -- "$current")']
    if option.kind:
        return ["compopt -o filenames 2>/dev/null", f'mapfile -t COMPREPLY < <(compgen -{"d" if option.kind == "folder" else "f"} -- "$current")']
    return []  # a number, say


def completion(table):
    cases = ""
    for option in table.options:
        if option.value:
            cases += f'    {" | ".join(option.names)})\n'
            cases += "".join(f"      {line}\n" for line in [*action(option), "return ;;"])
    names = " ".join(name for option in table.options for name in option.names)
    return TEMPLATE.format(tool=table.tool, function="_voxkit_" + table.tool.replace("-", "_"), cases=cases,
                           options=shlex.quote(names))
