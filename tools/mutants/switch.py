"""Writes many mutants of a C file into one text, each chosen when the program starts.

An expression with a mutant becomes `(hx_mutant == 7 ? (changed) : (original))`, where 7 is the
mutant's number, so that one build contains all mutants. The environment variable HX_MUTANT chooses
one (HEADER reads it); without it the program computes what the original computes. Constants of
static tables and lengths of arrays cannot be written so: they do not compile and are built alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from tools.mutants.sample import Mutant

# the compiler includes this before every file
HEADER = """\
#ifndef HX_MUTANT_SWITCH
#define HX_MUTANT_SWITCH
extern char *getenv(const char *name);
extern int atoi(const char *text);
static int hx_mutant __attribute__((unused));
__attribute__((constructor)) static void hx_read_mutant(void) {
  const char *text = getenv("HX_MUTANT");
  hx_mutant = text ? atoi(text) : 0;
}
#endif
"""
TOKEN = re.compile(
    r"""(?P<skip>/\*.*?\*/|//[^\n]*|^[ \t]*\#(?:[^\n\\]|\\\n)*|\s+)
    |(?P<text>"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')
    |(?P<number>\.?\d(?:[eEpP][+-]|[\w.])*)
    |(?P<name>[A-Za-z_]\w*)
    |(?P<mark><<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
LEVELS = ("||", "&&", "|", "^", "&", "== !=", "< <= > >=", "<< >>", "+ -", "* / %")
PRECEDENCE = {mark: level for level, marks in enumerate(LEVELS) for mark in marks.split()}
OPENERS, CLOSERS = frozenset("([{"), frozenset(")]}")  # brackets
ASSIGNMENTS = ("=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>=")
ENDS = frozenset((",", ";", "?", ":", *ASSIGNMENTS, "return", "case", "else", "do"))
HEADS = frozenset(("if", "for", "while", "switch"))


@dataclass(frozen=True)
class Token:
    """A name, number, text or mark, from begin to end of the file's text."""

    text: str
    begin: int
    end: int
    spaced: bool  # white space on both sides: a binary operator is written so


@dataclass(frozen=True)
class Place:
    """A mutant's expression, from begin to end of the file's text, and its change."""

    number: int
    mutant: Mutant
    at: int  # of the change
    begin: int
    end: int


def switched(text: str, mutants: Iterable[tuple[int, Mutant]]) -> str:
    """Returns the text of a file with numbered mutants, each behind its condition.

    Lines keep their numbers. Raises ValueError for a change that is in no expression.
    """
    starts = [0, *(match.end() for match in re.finditer("\n", text))]
    tokens = tokens_of(text)
    places = []
    for number, mutant in mutants:
        at = starts[mutant.line - 1] + mutant.column
        begin, end = expression(tokens, at, mutant)
        places.append(Place(number, mutant, at, begin, end))
    places.sort(key=lambda place: (place.begin, -place.end))
    return _written(text, places, 0, len(text))


def tokens_of(text: str) -> list[Token]:
    """Returns the tokens of C, without comments, white space and lines of the preprocessor."""
    found = [match for match in TOKEN.finditer(text) if match.lastgroup != "skip"]
    return [
        Token(
            one[0],
            one.start(),
            one.end(),
            text[one.start() - 1 : one.start()].isspace()
            and text[one.end() : one.end() + 1].isspace(),
        )
        for one in found
    ]


def expression(tokens: list[Token], at: int, mutant: Mutant) -> tuple[int, int]:
    """Returns begin and end of the smallest expression whose operator or constant is changed."""
    index = next((i for i, token in enumerate(tokens) if token.begin == at), None)
    if index is None or not tokens[index].text.startswith(mutant.old):
        raise ValueError(f"no token at {mutant.file}:{mutant.line}:{mutant.column}")
    token = tokens[index]
    if token.text[0].isdigit():
        return token.begin, token.end
    if not mutant.new:  # a sign
        return token.begin, tokens[_after_operand(tokens, index + 1) - 1].end
    return tokens[_first(tokens, index)].begin, tokens[_last(tokens, index)].end


def _first(tokens: list[Token], index: int) -> int:
    """Returns the index of the first token of a binary operator's left operand."""
    level, i = PRECEDENCE[tokens[index].text], index - 1
    while i >= 0:
        mark = tokens[i].text
        if mark in CLOSERS and mark != "}":
            i = _partner(tokens, i)
            if i > 0 and tokens[i - 1].text in HEADS:
                raise ValueError(f"a statement before the operator: {tokens[i - 1].text}")
        elif mark in OPENERS or mark == "}" or mark in ENDS or _level(tokens[i], level) < level:
            break
        i -= 1
    return i + 1


def _last(tokens: list[Token], index: int) -> int:
    """Returns the index of the last token of a binary operator's right operand."""
    level, i = PRECEDENCE[tokens[index].text], index + 1
    while i < len(tokens):
        mark = tokens[i].text
        if mark in OPENERS:
            i = _partner(tokens, i)
        elif mark in CLOSERS or mark in ENDS or _level(tokens[i], level + 1) <= level:
            break
        i += 1
    return i - 1


def _level(token: Token, otherwise: int) -> int:
    """Returns the precedence of a binary operator, a given one of other tokens."""
    return PRECEDENCE.get(token.text, otherwise) if token.spaced else otherwise


def _after_operand(tokens: list[Token], i: int) -> int:
    """Returns the index after a name, number or group, its members, elements and arguments."""
    cast = False
    while i < len(tokens):
        mark = tokens[i].text
        if mark in ("(", "["):
            cast = mark == "(" and not cast
            i = _partner(tokens, i) + 1
        elif mark in (".", "->") or re.match(r"[\w.]", mark):
            i, cast = i + 1, False
        else:
            break
    return i


def _partner(tokens: list[Token], i: int) -> int:
    """Returns the index of the bracket that closes or opens the group of the bracket i."""
    step, depth = (1 if tokens[i].text in OPENERS else -1), 0
    while True:
        depth += (tokens[i].text in OPENERS) - (tokens[i].text in CLOSERS)
        if depth == 0:
            return i
        i += step


def _written(text: str, places: list[Place], begin: int, end: int) -> str:
    """Returns a part of the text with the conditions of the places in it, outer ones first."""
    parts, at = [], begin
    while places:
        outer = places[0]
        inner = [one for one in places[1:] if one.begin < outer.end]
        places = places[1 + len(inner) :]
        change = outer.at + len(outer.mutant.old)
        new = text[outer.begin : outer.at] + outer.mutant.new + text[change : outer.end]
        old = _written(text, inner, outer.begin, outer.end)
        parts += [text[at : outer.begin], f"(hx_mutant == {outer.number} ? "]
        parts += [f"({' '.join(new.split())}) : ({old}))"]
        at = outer.end
    return "".join([*parts, text[at:end]])
