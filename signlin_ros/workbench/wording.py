"""What the command line says, in the words of the page: buttons and fields in place of options."""

from __future__ import annotations

import re

TIME = "in the row time below"
STEP_HINT = f"; choose its column {TIME}, or write there how many s are from row to row"
PAGE_WORDS = (
    (r"(; |, )?(name it|map one) with --signal t=.*$", STEP_HINT),
    (r"(; |, )?(state it|or say): --signal 't = .*$", f"; choose its unit {TIME}"),
    (r"state its unit, e\.g\. .*$", f"choose its unit {TIME}"),
    (r"Then say --signal 't = .*$", f"Choose its unit {TIME}, or press the button."),
    (r"([;,]) or say --dt .*$", rf"\1 or write {TIME} how many s are from row to row"),
    (r"map the time's column with --signal t=COLUMN", f"choose the column of the time {TIME}"),
    (r"--dt says by how much", f"write {TIME} by how much"),
    (r"; map it with --signal .*$", "; choose a column for it below, or write 0.0 as its formula"),
    (r"; say what it is: --signal .*$", "; choose its unit below, or write a formula"),
    (r"; or call the columns c1 to (c\d+): --signal NAME=c2", r"; or call the columns c1 to \1 in formulas"),
    (r", as --signal \"([^\"]*)\"", r", as the formula \1"),
    (r"; --signal (\S+)=COLUMN says it otherwise", r"; choose another column for \1 below"),
    (r"; give --validation", "; drop a second record"),
    (r",? ?`signlin check` may tell\.?", " The check may tell."),
    (r"`signlin add learned_force` learns it as a curve", "the button “Learn it as a curve”, in Add, does that"),
    (r"; --cure none: the record is taken as it is", "; or take the records as they are, in Check"),
    (r"--cure (\w+): ", r"\1, in Check: "),
    (r"plan for two by themselves with --between", "choose two of them below, and plan for those"),
    (r"; --between A,B names others", "; choose two below"),
    (r"; --between names which", "; choose two below"),
    (r"^--(between|limit|duration|spare): ", ""),
    (r"^--dt: ", "time between samples: "),
)
"""What the command line says, and what the page says instead."""


def on_page(text: str) -> str:
    """Return a sentence of the command line as the page says it."""
    for pattern, words in PAGE_WORDS:
        text = re.sub(pattern, words, text)
    return text


__all__ = ["on_page"]
