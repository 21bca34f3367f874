"""The frame of every HTML page: one self-contained file that loads no script, style or font from elsewhere."""

from collections.abc import Iterable
from html import escape
from importlib.resources import files

Chapter = tuple[str, str, str]
"""Key, heading and markup of a chapter; a chapter without markup is left out."""

ZOOM = (
    '<button type="button" data-zoom="in" aria-label="Zoom in">+</button>'
    '<button type="button" data-zoom="out" aria-label="Zoom out">−</button>'
    '<button type="button" data-zoom="all">Whole run</button>'
    '<button type="button" data-zoom="none" aria-label="Remove the time cursor">&times;</button>'
)


def resource(package: str, name: str) -> str:
    """The text of a file that comes with a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def bar(stages: str = "") -> str:
    """The bar with time and zoom that stays visible while the page scrolls. stages: pictures that show the same time."""
    return (
        f'<aside class="bar" hidden aria-label="Time cursor and zoom">{stages}<output class="now" aria-live="off"></output>'
        f"{ZOOM}</aside>"
    )


def document(
    *,
    title: str,
    kicker: str,
    head: str,
    chapters: Iterable[Chapter],
    footer: str,
    aside: str = "",
    style: str = "",
) -> str:
    """The whole page.

    kicker: the line above the title; head: markup of the header below it; aside: markup of what stays in sight (`bar`), with the script that
    drives it; style: rules beyond those of style.css.
    """
    # an empty chapter would be a heading without content, and an entry in the contents that leads nowhere
    shown = [chapter for chapter in chapters if chapter[2]]
    contents = "".join(f'<a href="#{key}">{escape(name)}</a>' for key, name, _ in shown)
    body = "".join(
        f'<section class="chapter" id="{key}"><h2>{escape(name)}</h2>{markup}</section>'
        for key, name, markup in shown
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{resource('report.kit', 'style.css')}{style}</style></head><body>"
        f'<header><p class="kicker">{escape(kicker)}</p>{head}</header>'
        f'<nav aria-label="Contents">{contents}</nav><main>{body}</main>'
        f"<footer>{escape(footer)}</footer>{_with_script(aside)}</body></html>\n"
    )


def _with_script(aside: str) -> str:
    """The bar and its script; a page without a bar has no plots that the script could serve."""
    return f"{aside}<script>{resource('report.kit', 'page.js')}</script>" if aside else ""
