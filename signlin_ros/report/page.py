"""What a report is made of: sections of blocks, turned into one HTML text and the bytes of its pictures.

Every text is escaped here and nowhere else. Pictures are inside the HTML as data, styles too: nothing is loaded.
"""

from __future__ import annotations

import base64
import functools
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

DPI = 130
"""Dots per inch of the pictures."""


@dataclass(frozen=True)
class Text:
    """A paragraph; ``kind`` is a class of the style sheet."""

    text: str
    kind: str = ""


@dataclass(frozen=True)
class Items:
    """A list; each item may begin with a term in bold."""

    items: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class ReportTable:
    """Rows of cells under a head; columns of ``right`` are set flush right."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Sequence[int] = ()


@dataclass(frozen=True)
class Code:
    """Text to be copied as it is."""

    text: str


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure with a caption; ``name`` is that of its file, ``alt`` says what is in it."""

    name: str
    figure: Any
    caption: str
    alt: str


@dataclass(frozen=True)
class Formula:
    """A formula as SVG, with the same as text for who cannot see it; without SVG the text stands alone."""

    svg: bytes | None
    text: str


@dataclass(frozen=True)
class Fold:
    """Blocks that are shown when asked for."""

    summary: str
    blocks: Sequence[Block]


Block = Text | Items | ReportTable | Code | Picture | Formula | Fold


@dataclass(frozen=True)
class Section:
    """A heading and what is under it."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """A report: title, badge (a class of the style sheet and its words), lead, sections, last line."""

    title: str
    badge: tuple[str, str]
    lead: str
    sections: Sequence[Section]
    foot: str


def png(figure: Any) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()


def rendered(page: Page) -> tuple[str, dict[str, bytes]]:
    """Return the HTML of a report, and its pictures by file name."""
    pictures: dict[str, bytes] = {}
    parts = [_section(section, pictures) for section in page.sections if section.blocks]
    links = "".join(f'<a href="#{_anchor(s.title)}">{html.escape(s.title)}</a>' for s in page.sections if s.blocks)
    text = _PAGE.format(
        title=html.escape(page.title),
        style=_STYLE,
        badge=f'<span class="badge {page.badge[0]}">{html.escape(page.badge[1])}</span>' if page.badge[1] else "",
        lead=html.escape(page.lead),
        links=links,
        body="\n".join(parts),
        foot=html.escape(page.foot),
    )
    return text, pictures


def _anchor(title: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in title.lower())


def _section(section: Section, pictures: dict[str, bytes]) -> str:
    blocks = "\n".join(_block(b, pictures) for b in section.blocks)
    return f'<section id="{_anchor(section.title)}">\n<h2>{html.escape(section.title)}</h2>\n{blocks}\n</section>'


@functools.singledispatch
def _block(block: Any, pictures: dict[str, bytes]) -> str:
    raise TypeError(f"no block: {block!r}")


@_block.register
def _(block: Text, pictures: dict[str, bytes]) -> str:
    kind = f' class="{block.kind}"' if block.kind else ""
    return f"<p{kind}>{html.escape(block.text)}</p>"


@_block.register
def _(block: Items, pictures: dict[str, bytes]) -> str:
    def item(term: str, text: str) -> str:
        head = f"<b>{html.escape(term)}</b>: " if term else ""
        return f"<li>{head}{html.escape(text)}</li>"

    return "<ul>" + "".join(item(*pair) for pair in block.items) + "</ul>"


@_block.register
def _(block: ReportTable, pictures: dict[str, bytes]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        places = (f'<{tag} class="r">' if i in block.right else f"<{tag}>" for i in range(len(cells)))
        return "<tr>" + "".join(f"{p}{html.escape(c)}</{tag}>" for p, c in zip(places, cells, strict=True)) + "</tr>"

    body = "\n".join(row(cells, "td") for cells in block.rows)
    return f'<div class="wide"><table><thead>{row(block.head, "th")}</thead>\n<tbody>{body}</tbody></table></div>'


@_block.register
def _(block: Code, pictures: dict[str, bytes]) -> str:
    return f"<pre>{html.escape(block.text)}</pre>"


@_block.register
def _(block: Picture, pictures: dict[str, bytes]) -> str:
    data = pictures[f"{block.name}.png"] = png(block.figure)
    width = round(96 * float(block.figure.get_figwidth()))
    source = f"data:image/png;base64,{base64.b64encode(data).decode()}"
    return (
        f'<figure><img src="{source}" width="{width}" alt="{html.escape(block.alt)}">'
        f"<figcaption>{html.escape(block.caption)}</figcaption></figure>"
    )


@_block.register
def _(block: Formula, pictures: dict[str, bytes]) -> str:
    if block.svg is None:
        return f'<p class="formula"><code>{html.escape(block.text)}</code></p>'
    source = f"data:image/svg+xml;base64,{base64.b64encode(block.svg).decode()}"
    return f'<p class="formula"><img src="{source}" alt="{html.escape(block.text)}"></p>'


@_block.register
def _(block: Fold, pictures: dict[str, bytes]) -> str:
    inner = "\n".join(_block(b, pictures) for b in block.blocks)
    return f"<details><summary>{html.escape(block.summary)}</summary>\n{inner}\n</details>"


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
<header>
<h1>{title}</h1>
<p class="verdict">{badge}{lead}</p>
<nav>{links}</nav>
</header>
<main>
{body}
</main>
<footer>{foot}</footer>
</body>
</html>
"""

_STYLE = """
:root { color-scheme: light; --ink: #1a1a1a; --soft: #5c5c5c; --line: #d8d8d8; --wash: #f6f6f4; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.6rem 1.4rem 3rem; max-width: 70rem; color: var(--ink); background: #fff;
  font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", Arial, sans-serif; }
h1 { margin: 0 0 .6rem; font-size: 1.05rem; font-weight: 600; color: var(--soft); }
h2 { margin: 2.2rem 0 .6rem; padding-bottom: .25rem; font-size: 1.2rem; border-bottom: 1px solid var(--line); }
p { margin: .5rem 0; max-width: 62rem; }
.verdict { margin: 0 0 .8rem; font-size: 1.4rem; line-height: 1.4; font-weight: 500; }
.badge { display: inline-block; margin-right: .6rem; padding: .05rem .6rem; border-radius: .3rem; color: #fff;
  font-size: 1rem; vertical-align: .15rem; background: #5c5c5c; }
.badge.missing { background: #0072B2; } .badge.adequate { background: #00734f; }
.badge.unexplained { background: #a8480a; }
nav { font-size: .88rem; } nav a { margin-right: 1.1rem; color: #00507d; }
h3, .head { margin: 1.4rem 0 .3rem; font-size: 1rem; font-weight: 600; }
.note { color: var(--soft); font-size: .92rem; }
ul { margin: .5rem 0; padding-left: 1.3rem; max-width: 62rem; } li { margin: .2rem 0; }
.wide { overflow-x: auto; }
table { margin: .6rem 0; border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem .9rem .22rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
th { font-weight: 600; color: var(--soft); border-bottom-color: #999; }
td.r { white-space: nowrap; } .r { text-align: right; }
figure { margin: .8rem 0 1.2rem; }
img { max-width: 100%; height: auto; }
figcaption { max-width: 62rem; color: var(--soft); font-size: .9rem; }
.formula { margin: .7rem 0 .7rem 1.2rem; overflow-x: auto; }
pre { padding: .7rem .9rem; overflow-x: auto; font: .85rem/1.45 ui-monospace, "DejaVu Sans Mono", Consolas, monospace;
  background: var(--wash); border: 1px solid var(--line); border-radius: .3rem; }
details { margin: .6rem 0; } summary { cursor: pointer; color: #00507d; }
footer { margin-top: 2.5rem; color: var(--soft); font-size: .85rem; }
@page { margin: 15mm; }
@media print {
  body { padding: 0; max-width: none; font-size: 10pt; } nav { display: none; }
  h2, .head { break-after: avoid; } figure, tr, .formula { break-inside: avoid; }
  pre { white-space: pre-wrap; border: 0; padding: .3rem 0; background: none; }
  table { font-size: 8.5pt; } figcaption, .note { font-size: 8.5pt; } .verdict { font-size: 1.25rem; }
}
""".strip()


__all__ = ["Block", "Code", "Fold", "Formula", "Items", "Page", "Picture", "ReportTable", "Section", "Text", "rendered"]
