"""Small faults, one a line of C or Python: what tools/mutants.py puts into a source.

A rule is a pattern and what takes its place. It is tried at every place of a line where the pattern begins. Comments,
texts, declarations of types and lines of the preprocessor are left alone.
"""

import ast
import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass

COMMON = [
    # limits: one more, one less, and the other side
    (r" <= ", " < "),
    (r" >= ", " > "),
    (r" < ", " <= "),
    (r" > ", " >= "),
    (r" <=? ", " > "),
    (r" >=? ", " < "),
    (r" == ", " != "),
    (r" != ", " == "),
    # arithmetic
    (r" \+ ", " - "),
    (r" - ", " + "),
    (r" \* ", " / "),
    (r" / ", " * "),
    (r" \+= ", " -= "),
    (r" -= ", " += "),
    (r"(?<=[(\[,=] )-(?=[\w(])", ""),
    (r"(?<=[(\[])-(?=[\w(])", ""),
    (r"(?<=return )-(?=[\w(])", ""),
    # components
    (r"\.x\b(?!\()", ".y"),
    (r"\.y\b(?!\()", ".z"),
    (r"\.z\b(?!\()", ".x"),
    (r"\[0u?\]", "[1]"),
    (r"\[1u?\]", "[0]"),
]
C = [
    *COMMON,
    (r" && ", " || "),
    (r" \|\| ", " && "),
    (r" && (!?[\w.>-]+(\([^()]*\))?|\([^()]*\))(?=[ ;)])", ""),
    (r"(?<=[( ])(!?[\w.>-]+(\([^()]*\))?|\([^()]*\)) && ", ""),
    (r" \|\| (!?[\w.>-]+(\([^()]*\))?|\([^()]*\))(?=[ ;)])", ""),
    (r"(?<=[( ])(!?[\w.>-]+(\([^()]*\))?|\([^()]*\)) \|\| ", ""),
    (r"!(?=[\w(])", ""),
    (r"\bif \((.*)\)$", r"if (!(\1))"),
    (r" \? (.+?) : (.+?)(?=[;,)])", r" ? \2 : \1"),
    (r"\btrue\b", "false"),
    (r"\bfalse\b", "true"),
    (r"\+\+", "--"),
    (r"\b0\.0f\b", "1.0f"),
    (r"\b(?!0\.0f)(\d+\.\d+(e-?\d+)?f)\b", r"(2.0f * \1)"),
    (r"(?<![\w.])(\d+)(u?)(?![\w.])", r"(\1\2 + 1\2)"),
    # a statement that is not done
    (r"^\s+[\w.>\[\]-]+ [|&+-]?= .*;$", ";"),
    (r"^\s+(\(void\))?(?!return\b)\w+\(.*\);$", ";"),
    (r"^(\s+)return (?!false;|true;)(.+);$", r"\1return !(\2);"),
]
PYTHON = [
    *COMMON,
    (r" and ", " or "),
    (r" or ", " and "),
    (r" and (not )?[\w.]+(\([^()]*\))?(?=[ :)]|$)", ""),
    (r"(?<=[( ])(not )?[\w.]+(\([^()]*\))? and ", ""),
    (r" or (not )?[\w.]+(\([^()]*\))?(?=[ :)]|$)", ""),
    (r"(?<=[( ])(not )?[\w.]+(\([^()]*\))? or ", ""),
    (r"\bnot ", ""),
    (r"\bis not (?=None)", "is "),
    (r"\bis (?=None)", "is not "),
    (r"^(\s+)(el)?if (.*):$", r"\1\2if not (\3):"),
    (r"\bTrue\b", "False"),
    (r"\bFalse\b", "True"),
    (r"\b0\.0\b", "1.0"),
    (r"\b(?!0\.0\b)(\d+\.\d+(e-?\d+)?|\d+e-?\d+)\b", r"(2.0 * \1)"),
    (r"(?<![\w.])(\d+)(?![\w.])", r"(\1 + 1)"),
    (r"\bmin\(", "max("),
    (r"\bmax\(", "min("),
    (r"^(\s+)(self\.)?[\w.\[\]]+ [|&+*-]?= .*[^\[({,]$", r"\1pass"),
    (r"^(\s+)[\w.]+\(.*\)$", r"\1pass"),
    (r"^(\s+)return (.+[^\[({,])$", r"\1return None"),
    (r"^(\s+)raise .*\)$", r"\1pass"),
]
LEFT_ALONE = {
    ".c": re.compile(r"^\s*(#|//|/\*|\*|_Static_assert|typedef|extern|})|^\s*static const char|^[{}]"),
    ".py": re.compile(r"^\s*(#|import |from |@|def |class |\"\"\")"),
}
COMMENT = {".c": re.compile(r"\s*(//|/\*).*$"), ".py": re.compile(r"\s+# .*$")}
TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


@dataclass(frozen=True)
class Mutant:
    """A source with one small fault.

    Attributes:
        path: The source, from the root of the repository.
        line: Line number, from 1.
        before: The line without its indentation.
        after: The line with the fault.
        text: The whole source with the fault.
    """

    path: str
    line: int
    before: str
    after: str
    text: str

    def __str__(self) -> str:
        """One line for people."""
        return f"{self.path}:{self.line}: {self.before}  ->  {self.after}"


def mutants(path: str, source: str) -> list[Mutant]:
    """Every small fault that the rules know for a source, in the order of its lines; none twice."""
    kind = path[path.rindex(".") :]
    lines = source.splitlines()
    found: dict[tuple[int, str], Mutant] = {}
    for number, line in enumerate(lines, 1):
        if not LEFT_ALONE[kind].search(line):
            for after in _changed(line, kind):
                text = "\n".join([*lines[: number - 1], after, *lines[number:]]) + "\n"
                found.setdefault((number, after), Mutant(path, number, line.strip(), after.strip(), text))
    return list(found.values())


def _changed(line: str, kind: str) -> Iterator[str]:
    """The line with each fault; comments stay, texts are not searched."""
    cut = COMMENT[kind].search(line)
    code, rest = (line[: cut.start()], line[cut.start() :]) if cut else (line, "")
    hidden = TEXT.sub(lambda text: '"' + "\0" * (len(text[0]) - 2) + '"', code)
    for pattern, instead in C if kind == ".c" else PYTHON:
        for match in re.finditer(pattern, hidden):
            groups = match.re.search(hidden, match.start())
            if groups is not None and "\0" not in match[0]:
                yield code[: match.start()] + match.expand(instead) + code[match.end() :] + rest


def is_other_program(source: str, text: str) -> bool:
    """Whether Python reads another program in a changed source: it compiles, and not texts alone are different."""
    try:
        return _program(source) != _program(text)
    except (SyntaxError, ValueError):
        return False


@functools.lru_cache(maxsize=4)
def _program(source: str) -> str:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree)
