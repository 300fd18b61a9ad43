"""The letters of a text file: UTF-8, UTF-16, or what a logger in Japan, China, Korea, Russia or Europe writes.

Which of the older encodings it is, no file says. It is the one in which the names are there that are asked for; else
the first one in which every word of the lines in front is of one script and, if that is Chinese or Japanese, made of
the commonest signs: bytes of another encoding give seldom ones, and words of mixed scripts.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

from signlin_ros.errors import RecordError
from signlin_ros.records.notes import Note

LFS_POINTER = "version https://git-lfs"
"""What a file begins with that Git LFS keeps elsewhere."""
LEGACY = {"euc_kr": "EUC-KR", "gb18030": "GB 18030", "cp932": "Shift-JIS", "big5": "Big5", "cp1251": "Windows-1251"}
"""Encodings that are tried before that of western Europe: Python's name, and the one in words. Korean syllables come
first: they take half of what Chinese signs do."""
SCRIPTS = {
    "euc_kr": {"HANGUL"},
    "gb18030": {"JAPANESE"},
    "cp932": {"JAPANESE"},
    "big5": {"JAPANESE"},
    "cp1251": {"CYRILLIC"},
}
"""The script that each is for: that of Japan holds the Chinese signs."""
WESTERN = "cp1252"
LINES_LOOKED = 50
"""Lines in front that tell: names, units and a preamble."""
COMMON = {"gb2312": (0xB0, 0xD7), "cp932": (0x88, 0x97)}
"""First bytes of the signs of the first level [GB 2312-80; JIS X 0208]: the commonest 3755 and 2965."""
_WORD = re.compile(r"[^\W\d_]+")
_HIGH = re.compile(rb"[\x80-\xff]")


def decoded(raw: bytes, source: str, asked: Iterable[str] = ()) -> tuple[str, tuple[Note, ...]]:
    """Return a text with line feeds between its lines, and what is said of how it was read.

    asked : what the columns are called by whoever reads them.
    """
    notes: tuple[Note, ...] = ()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = raw.decode("utf-16", errors="replace")
    else:
        whole = len(raw)
        raw = raw.rstrip(b"\0")
        if len(raw) < whole:
            notes = (Note("zeros at the end of the file, which a crash leaves, are left out", "truncated"),)
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            name = _encoding(raw, [spec for spec in asked if not spec.isascii()])
            text = raw.decode(name, errors="replace")
            if name in LEGACY:
                notes = (*notes, Note(f"the text is read as {LEGACY[name]}", "format"))
    if "\0" in text:
        raise RecordError(f"{source}: this is no text file")
    if text.startswith(LFS_POINTER):
        raise RecordError(f"{source}: this is a pointer of Git LFS, not the file itself; get that with: git lfs pull")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text, notes


def _encoding(raw: bytes, asked: Sequence[str]) -> str:
    """Return the encoding of a text that is no UTF-8."""
    lines = [line for line in re.split(rb"[\r\n]+", raw[: 1 << 16])[:LINES_LOOKED] if _HIGH.search(line)]
    texts = {name: b"\n".join(lines).decode(name, errors="replace") for name in (*LEGACY, WESTERN)}
    found = {name: text for name, text in texts.items() if "\ufffd" not in text}
    words = {word for spec in asked for word in _WORD.findall(spec) if not word.isascii()}
    for name, text in found.items():
        if words and all(word in text for word in words):
            return name
    return next((name for name, text in found.items() if name in LEGACY and _sensible(name, text)), WESTERN)


def _sensible(encoding: str, text: str) -> bool:
    """Tell whether the words of a text that are not ASCII are of its encoding's script, of common signs, and some of
    them more than a letter.
    """
    words = [word for word in _WORD.findall(text) if not word.isascii()]
    return any(len(word) > 1 for word in words) and all(
        _scripts(word) == SCRIPTS[encoding] and _is_common(encoding, word) for word in words
    )


def _scripts(word: str) -> set[str]:
    """Return the scripts of a word's letters, by their names in Unicode; those of Japan are one."""
    names = {unicodedata.name(letter, "?").split()[0].split("-")[0] for letter in word}
    return {"JAPANESE" if name in ("HIRAGANA", "KATAKANA", "CJK") else name for name in names}


def _is_common(encoding: str, word: str) -> bool:
    """Tell whether all Chinese signs of a word are of the first level of its encoding."""
    table = {"gb18030": "gb2312"}.get(encoding, encoding)
    if table not in COMMON:
        return True
    signs = [letter for letter in word if "CJK" in unicodedata.name(letter, "?")]
    low, high = COMMON[table]
    return all(low <= (letter.encode(table, errors="ignore") or b"\0")[0] <= high for letter in signs)


__all__ = ["decoded"]
