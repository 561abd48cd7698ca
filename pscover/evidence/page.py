"""All results as one HTML file that needs nothing else: tables with filters, pictures, and the raw data to take away.

The page loads nothing from anywhere: a content security policy forbids it, and lets only the page's own script run. It is
complete without the script, which adds the filters and the switch between light and dark.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from html import escape
from importlib import resources
from itertools import count

import pscover
from pscover.evidence.machine import this_machine
from pscover.evidence.markdown import Block, Code, Heading, Paragraph, Points, untitled
from pscover.evidence.results import KNOWN, File, Section, missing
from pscover.evidence.tables import Table
from pscover.report import filled

TEMPLATE = "page.html"
TITLE = "pscover: what was measured"
INLINE = re.compile(r"`([^`]+)`|\*\*([^*]+)\*\*|\[([^\]]+)\]\((https?://[^)\s]+)\)|!?\[([^\]]*)\]\([^)]*\)")
LEAD = (
    "Every table of the benchmarks, with its pictures and its raw data. Unless a table says otherwise seconds are CPU "
    "seconds of all threads and processes of what was measured, on one thread: other work on the machine changes them "
    "little, and they are those of the machine that the raw data name. What carries over to another machine are ratios "
    "within a row."
)


def render_page(found: Sequence[Section], plans: Sequence[File] = (), made: str = "") -> bytes:
    """The page, in UTF-8.

    Parameters
    ----------
    found
        What to show.
    plans
        Pictures of plans, by their names.
    made
        When, for the foot of the page.

    Examples
    --------
    >>> from pscover.evidence.tables import Table
    >>> table = Table(name="t", title="T", columns=("<who>",), rows=(("<me>",),))
    >>> page = render_page([Section(name="table2", title="Times", blocks=(table,))]).decode()
    >>> "&lt;me&gt;" in page, "<me>" in page, "bench groups" in page
    (True, False, True)
    """
    template = resources.files("pscover.evidence").joinpath(TEMPLATE).read_text("utf-8")
    gone = missing(found)
    links = [(section.name, section.name) for section in found]
    links += [("plans", "plans")] if plans else []
    links += [("missing", "not there")] if gone else []
    places = count(1)
    parts = {
        "title": escape(TITLE),
        "lead": escape(LEAD),
        "contents": "".join(f"<a href='#{escape(_anchor(name))}'>{escape(text)}</a>" for name, text in links),
        "sections": "".join(_section(section, places) for section in found) + _plans(plans) + _missing(gone),
        "version": escape(pscover.__version__),
        "made": escape(made or f"page made by Python {this_machine().python}"),
    }
    return filled(template, parts)


def _anchor(name: str) -> str:
    return re.sub(r"[^\w-]", "-", name)


def _section(section: Section, places: count[int]) -> str:
    body = "".join(_block(block, section.name, places) for block in untitled(section.blocks, section.title))
    return (
        f"<section class='panel' id='{escape(_anchor(section.name))}'><h2>{escape(section.title)}</h2>"
        f"{''.join(_figure(picture) for picture in section.pictures)}{body}{_raw(section)}</section>\n"
    )


def _block(block: Block, section: str, places: count[int]) -> str:
    match block:
        case Heading():
            return f"<h3>{_inline(block.text)}</h3>"
        case Paragraph():
            return f"<p class='text'>{_inline(block.text)}</p>"
        case Points():
            return f"<ul class='text'>{''.join(f'<li>{_inline(text)}</li>' for text in block.texts)}</ul>"
        case Code():
            # A fence without a command is but an empty box.
            return f"<pre tabindex='0'>{escape(block.text)}</pre>" if block.text.strip() else ""
        case Table():
            return _table(block, f"{section}-{next(places)}")


def _inline(text: str) -> str:
    """Code, bold and links; everything else as it stands."""
    out, last = [], 0
    for found in INLINE.finditer(text):
        out.append(escape(text[last : found.start()]))
        code, bold, label, address, other = found.groups()
        if code is not None:
            out.append(f"<code>{escape(code)}</code>")
        elif bold is not None:
            out.append(f"<b>{escape(bold)}</b>")
        elif address is not None:
            out.append(f"<a href='{escape(address)}' rel='noreferrer'>{escape(label)}</a>")
        else:
            # A link into a repository that is not here, or a picture that is shown anyway.
            out.append("" if found[0].startswith("!") else escape(other))
        last = found.end()
    return "".join([*out, escape(text[last:])])


def _table(table: Table, name: str) -> str:
    sides = ["" if column in table.text_columns else " class='n'" for column in table.columns]
    head = "".join(f"<th{side}>{_inline(column)}</th>" for column, side in zip(table.columns, sides, strict=True))
    rows = "".join(
        "<tr>" + "".join(f"<td{side}>{_inline(cell)}</td>" for cell, side in zip(row, sides, strict=True)) + "</tr>"
        for row in table.rows
    )
    chosen = " ".join(str(table.columns.index(column)) for column in table.filters)
    filters = f" data-filters='{chosen}'" if chosen else ""
    notes = "".join(f"<li>{_inline(note)}</li>" for note in table.notes)
    title = f"<h4>{_inline(table.title)}</h4>" if table.title else ""
    file = File(name=f"{name}.csv", media="text/csv", content=table.csv().encode())
    return (
        f"{title}<div class='scroll' tabindex='0' role='region' aria-label='{escape(table.title or name, quote=True)}'>"
        f"<table{filters}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        f"{f'<ul class=notes>{notes}</ul>' if notes else ''}<p class='take'>{_link(file, 'this table as CSV')}</p>"
    )


def _figure(picture: File) -> str:
    return (
        f"<figure><img alt='{escape(picture.name, quote=True)}' src='{_data(picture)}'>"
        f"<figcaption>{escape(picture.name)}</figcaption></figure>"
    )


def _raw(section: Section) -> str:
    links = "".join(_link(file, file.name) for file in section.raw)
    left_out = f"too large to be in this page: {', '.join(map(escape, section.left_out))}" if section.left_out else ""
    return f"<p class='take'>raw data: {links}{left_out}</p>" if links or left_out else ""


def _link(file: File, text: str) -> str:
    name = escape(file.name.replace("/", "-"), quote=True)
    return f"<a download='{name}' href='{_data(file)}'>{escape(text)} <small>{_size(len(file.content))}</small></a>"


def _size(length: int) -> str:
    return f"{length} B" if length < 1000 else f"{length / 1000:.0f} kB" if length < 1e6 else f"{length / 1e6:.1f} MB"


def _data(file: File) -> str:
    return f"data:{file.media};base64,{base64.b64encode(file.content).decode('ascii')}"


def _plans(plans: Sequence[File]) -> str:
    if not plans:
        return ""
    return (
        "<section class='panel' id='plans'><h2>Some plans</h2><p class='text'>Painted scenes as the benchmarks use them, "
        "segmented and planned when this page was made: grasps numbered in order of execution.</p>"
        f"<div class='plans'>{''.join(_figure(plan) for plan in plans)}</div></section>\n"
    )


def _missing(gone: Sequence[str]) -> str:
    if not gone:
        return ""
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(KNOWN[name][0])}</td><td><code>{escape(KNOWN[name][1])}</code></td></tr>"
        for name in gone
    )
    return (
        "<section class='panel' id='missing'><h2>Not there</h2><p class='text'>No results of these were found in the "
        "folders that this page was made of; the commands make them.</p><div class='scroll'><table class='gone'>"
        "<thead><tr><th>name</th><th>what</th><th>made by</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div></section>\n"
    )
