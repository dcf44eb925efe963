"""What the reports of a study and of an identification share: a page that needs no other file, and its drawings."""

import base64
import html
import io
import re
import xml.etree.ElementTree

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend has to be chosen first)

# Told apart by lightness alone, so in greyscale print and with colour blindness too. With the line styles they make 20
# pairs before any repeats.
COLOURS = ["#14213d", "#c8374f", "#2ba395", "#6a2380", "#e3b23c"]
LINE_STYLES = ["-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2))]
WIDTH_IN = 12.0
STYLE = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "brash_ice_rig",
}

CSS = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; color: #1a1a1a; background: #ffffff;
  max-width: 1080px; margin: 2rem auto 4rem; padding: 0 1.2rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 0.4rem; }
h2 { font-size: 1.3rem; margin: 2.4rem 0 0.7rem; padding-bottom: 0.2rem; border-bottom: 2px solid #14213d; }
p { margin: 0.5rem 0; max-width: 46rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.15rem 1.2rem; margin: 0.8rem 0; }
dt { font-weight: 600; }
dd { margin: 0; }
code { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: 0.9em; }
.scroll { overflow-x: auto; margin: 0.8rem 0; }
table { border-collapse: collapse; font-size: 0.88rem; }
p.note { font-size: 0.92rem; color: #333333; }
th, td { padding: 0.3rem 0.55rem; text-align: left; vertical-align: top; border-bottom: 1px solid #dddddd; }
thead th { border-bottom: 2px solid #888888; vertical-align: bottom; }
td.title { min-width: 9.5rem; }
.number { text-align: right; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
td.number small { color: #555555; }
figure { margin: 1.6rem 0 2.2rem; }
figure svg, figure img { display: block; max-width: 100%; height: auto; }
figure svg * { stroke-linejoin: round; stroke-linecap: butt; }
figcaption { font-size: 0.92rem; color: #333333; margin-top: 0.6rem; max-width: 50rem; }
.model { display: inline-block; margin: 0.3rem 0 0.5rem; padding: 0.25rem 0.8rem; border-radius: 0.3rem;
  background: #e8f2f9; border: 1px solid #2f7fb8; }
.failed, .missing { border-left: 4px solid #b00020; background: #fdecee; color: #8a0018; padding: 0.5rem 0.9rem; }
.failed ul { margin: 0.3rem 0; padding-left: 1.2rem; }
table.findings { table-layout: fixed; width: 100%; min-width: 52rem; }
table.findings th:nth-child(1) { width: 8%; }
table.findings th:nth-child(2) { width: 18%; }
table.findings th:nth-child(3) { width: 30%; }
table.findings th:nth-child(4) { width: 9%; }
.verdict { font-weight: 600; }
.agrees { color: #1b6e3c; }
.differs { color: #b00020; }
.open { color: #555555; font-weight: 400; }
@media print {
  body { max-width: none; margin: 0; font-size: 10.5pt; }
  figure, tr { break-inside: avoid; }
  h2, p.note { break-after: avoid; }
  thead { display: table-header-group; }
  .scroll { overflow: visible; }
  table { font-size: 8pt; }
  th, td { padding: 0.2rem 0.35rem; }
  table.findings, td.title { min-width: 0; }
}
"""

def escape(value):
    return html.escape(str(value))


def cell(text, kind=""):
    """A table cell; the text is markup."""
    return f'<td class="{kind}">{text}</td>' if kind else f"<td>{text}</td>"


def table(headings, rows, caption="", kind=""):
    """headings: (text, whether numbers stand below); rows: lists of cells."""
    # Long keys may break after a dot or an underscore.
    texts = [escape(text).replace(".", ".<wbr>").replace("_", "_<wbr>") for text, _ in headings]
    head = "".join(f'<th class="number">{text}</th>' if number else f"<th>{text}</th>"
                   for text, (_, number) in zip(texts, headings))
    body = "\n".join(f"<tr>{''.join(row)}</tr>" for row in rows)
    attribute = f' class="{kind}"' if kind else ""
    # Not as the table's caption: that would grow as wide as the table and scroll with it.
    note = f'<p class="note">{escape(caption)}</p>\n' if caption else ""
    return (f'{note}<div class="scroll"><table{attribute}><thead><tr>{head}</tr></thead>\n'
            f"<tbody>\n{body}\n</tbody></table></div>")


def number_text(value):
    """As short as it can be while it still reads back as the same number, if it is one."""
    try:
        return f"{float(value):.10g}"
    except (TypeError, ValueError):
        return str(value)


def html_page(title, body, css=""):
    """A whole page; title is text, body markup, css what this page has beside CSS."""
    # The empty icon keeps a browser from asking a server for one.
    return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(title)}</title>\n<link rel="icon" href="data:,">\n<style>{CSS}{css}</style>\n</head>\n'
            f"<body>\n{body}\n</body>\n</html>\n")


def to_svg(picture, name, description):
    """The picture as an svg element for a page with others: no prolog, no namespaces, ids of its own."""
    stream = io.StringIO()
    picture.savefig(stream, format="svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(picture)
    root = xml.etree.ElementTree.fromstring(stream.getvalue())
    for parent in root.iter():
        for child in list(parent):
            # The metadata holds only addresses, and a style would reach beyond its picture; the page has that rule.
            if local_name(child.tag) in ("metadata", "style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = local_name(element.tag)
        attributes = {local_name(key): value for key, value in element.attrib.items()}
        if "id" in attributes:
            attributes["id"] = f"{name}-{attributes['id']}"
        for key, value in attributes.items():
            if key == "href":
                attributes[key] = value.replace("#", f"#{name}-", 1)
            else:
                attributes[key] = re.sub(r"url\(#", f"url(#{name}-", value)
        element.attrib.clear()
        element.attrib.update(attributes)
    for key in ("version", "width", "height"):
        root.attrib.pop(key, None)
    # The view box is in points; the page may shrink the picture, not blow it up.
    points = float(root.get("viewBox").split()[2])
    root.set("style", f"width:{points * 4.0 / 3.0:.0f}px")
    root.set("role", "img")
    root.set("aria-label", description)
    return xml.etree.ElementTree.tostring(root, encoding="unicode")


def local_name(name):
    return name.rpartition("}")[2]


def to_png(picture, description):
    stream = io.BytesIO()
    picture.savefig(stream, format="png", metadata={"Software": None})
    plt.close(picture)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{html.escape(description)}">'
