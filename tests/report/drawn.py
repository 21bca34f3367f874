"""Reads the report back: the page's outline, its tables, and the curves from the drawn paths."""

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "img", "hr", "link", "input"}
FURNITURE = ("grid", "zero", "mark")  # classes of paths that are no curves


class Outline(HTMLParser):
    """Checks nesting, keeps text, tables by the heading before them, figures by title, and what would be fetched."""

    def __init__(self):
        super().__init__()
        self.open, self.seen, self.text, self.fetched = [], [], [], []
        self.tables = {}  # section id -> rows of cells, header included
        self.plots = {}  # title -> [{"t", "y", "paths": [(class, d)], "legend": [names]}, ...]
        self._section, self._title = "", ""

    @classmethod
    def of(cls, text):
        parser = cls()
        parser.feed(text)
        parser.close()
        return parser

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.seen.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "section":
            self._section = found["id"]
        elif tag == "tr":
            self.tables.setdefault(self._section, []).append([])
        elif tag in ("td", "th"):
            self.tables[self._section][-1].append("")
        elif tag == "figcaption":
            self._title = ""
        elif tag == "div" and "data-y" in found:
            low, high = map(float, found["data-y"].split())
            start, end = map(float, found["data-t"].split())
            plot = {"t": (start, end), "y": (low, high), "paths": [], "legend": []}
            self.plots.setdefault(self._title, []).append(plot)
        elif tag == "path" and self._title in self.plots and found["class"].split()[0] not in FURNITURE:
            self.plots[self._title][-1]["paths"].append((found["class"], found["d"]))
        for name, value in attrs:
            if name in ("src", "href", "srcset", "data", "poster", "action") and not value.startswith(
                ("data:", "#")
            ):
                self.fetched.append(value)

    def handle_startendtag(self, tag, attrs):
        if tag == "path":
            self.handle_starttag(tag, attrs)
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without a start"
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("style", "script"):
            return
        self.text.append(data)
        if self.open and self.open[-1] in ("td", "th"):
            self.tables[self._section][-1][-1] += data
        if self.open and self.open[-1] == "figcaption":
            self._title += data.strip()
        if self.open and self.open[-1] == "li" and self._title in self.plots and data.strip():
            self.plots[self._title][-1]["legend"].append(data.strip())


def points_of(path):
    """The stretches of a drawn path: lists of (x, y) in units of the drawing."""
    found, x, y = [], 0, 0
    for letter, rest in re.findall(r"([Mlhv])([^Mlhv]*)", re.search(r' d="([^"]+)"', path)[1]):
        values = [int(v) for v in rest.split()]
        if letter == "M":
            x, y = values
            found.append([(x, y)])
        elif letter == "h":
            x += values[0]
            found[-1].append((x, y))
        elif letter == "v":
            y += values[0]
            found[-1].append((x, y))
        else:
            for dx, dy in zip(values[::2], values[1::2], strict=True):
                x, y = x + dx, y + dy
                found[-1].append((x, y))
    return found
