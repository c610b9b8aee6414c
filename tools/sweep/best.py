"""The smallest setting of each input that fulfils conditions such as "psnr>=45,decode_seconds<2"."""
import operator
import re

from sweep.failure import Failure, USAGE, nearest
from sweep.table import find_column, number

OPERATORS = {">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt, "=": operator.eq, "==": operator.eq}


def parse(texts):
    """Triples (name, operator's text, number) of all --best options."""
    conditions = []
    for text in texts:
        for part in text.split(","):
            found = re.fullmatch(r"\s*([^<>=]+?)\s*(>=|<=|==|>|<|=)\s*(\S+)\s*", part)
            value = number(found[3]) if found else None
            if value is None or value != value:
                raise Failure(USAGE, f'--best: "{text}": expected conditions such as psnr>=45, with commas between them')
            conditions.append((found[1], found[2], value))
    return conditions


def resolve(conditions, columns, complete):
    """With names of columns. Unless the tables are `complete`, a name may be one that is not there yet."""
    resolved = []
    for name, sign, value in conditions:
        column = find_column(name, columns)
        if column is None and complete:
            raise Failure(USAGE, f'--best: there is no "{name}": did you mean "{nearest(name, columns)}"?')
        resolved.append((column or name, sign, value))
    return resolved


def fulfils(values, conditions):
    for column, sign, value in conditions:
        cell = number(values.get(column))
        if cell is None or not OPERATORS[sign](cell, value):
            return False
    return True


def best(rows, flats, conditions):
    """One object an input, in the order of the rows."""
    answers = []
    for name in dict.fromkeys(row["input"] for row in rows):
        answer = {"input": name, "found": False}
        fitting = [(values["file_bytes"], i) for i, values in enumerate(flats)
                   if rows[i]["input"] == name and "file_bytes" in values and fulfils(values, conditions)]
        if fitting:
            row, values = rows[min(fitting)[1]], flats[min(fitting)[1]]
            answer |= {"found": True, "codec": row["codec"], "tool": row["encoder"], "setting": row["setting"],
                       "options": row["options"], "case": row["case"], "file_bytes": values["file_bytes"],
                       "percent": values.get("percent"), "values": {column: values[column] for column, _, _ in conditions}}
        answers.append(answer)
    return answers


def text(answers, conditions):
    lines = []
    for answer in answers:
        if answer["found"]:
            values = ", ".join(f"{key} {value if isinstance(value, str) else format(value, '.6g')}"
                               for key, value in answer["values"].items())
            lines.append(f"{answer['input']}: {answer['tool']} {answer['setting']}".rstrip() +
                         f": {answer['file_bytes']} bytes ({answer['percent']:.4g} %), {values}")
        else:
            wanted = ", ".join(f"{name} {sign} {value:g}" for name, sign, value in conditions)
            lines.append(f"{answer['input']}: no setting has {wanted}")
    return "".join(line + "\n" for line in lines)
