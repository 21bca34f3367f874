"""Code blocks and commands of Markdown pages, for tests that run or parse them as printed."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(loaderhil [^`\n]+)`")
ENDS = {"|", "&", "&&", ";", ">", "2>", "<"}
"""Tokens of a shell at which a command's own words end."""


@dataclass(frozen=True, slots=True)
class Fence:
    """One fenced block of a page."""

    language: str
    text: str
    line: int  # of its first line in the page, from 1


@dataclass(frozen=True, slots=True)
class Command:
    """One printed call of `loaderhil`."""

    words: tuple[str, ...]  # without `loaderhil`
    line: int


def pages() -> list[Path]:
    """All pages for readers: README, CHANGELOG and docs."""
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


def fences(page: str) -> list[Fence]:
    """All fenced blocks of a page's text, in order."""
    return [Fence(m[1], m[2], page.count("\n", 0, m.start(2)) + 1) for m in FENCED.finditer(page)]


def commands(page: str) -> Iterator[Command]:
    """Calls of `loaderhil` in indented or fenced lines and between backticks, with their line; none with a `...` in it."""
    lines = page.splitlines()
    for index, line in enumerate(lines):
        texts = INLINE.findall(line)
        found = re.match(r"(?:\s{4,}|\$ )(?:\$ )?(?:.*\| )?(loaderhil [^`]*)$", line)
        if found is not None:
            text = found[1]
            for following in lines[index + 1 :]:
                if not text.endswith("\\"):
                    break
                text = text[:-1] + following.strip()
            texts = [text]
        for text in texts:
            words = shlex.split(text, comments=True)
            ends = [i for i, word in enumerate(words) if word in ENDS or word.endswith(";")]
            own = words[1 : min(ends, default=len(words))]
            if not any("..." in word for word in own):
                yield Command(tuple(own), index + 1)
