"""The page docs/reference/faults.md: written by hand, but for the table of what detects which fault."""

from studies.soak.detection_matrix import markdown, try_all

BEGIN = "<!-- written by scripts/fault-docs -->\n"
END = "<!-- end -->\n"


def renewed(page: str) -> str:
    """The page with its table made anew, by running every fault. ValueError if it has no place for it."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page has no lines {BEGIN.strip()!r} and {END.strip()!r} around its table")
    return f"{before}{begin}\n{markdown(try_all())}\n{end}{after}"
