"""Generates the detection matrix in docs/reference/faults.md, a page that is otherwise written by hand."""

from studies.soak.detection_matrix import markdown, try_all

BEGIN = "<!-- written by scripts/fault-docs -->\n"
END = "<!-- end -->\n"


def renewed(page: str) -> str:
    """The page with a new table, from running every fault. Raises ValueError if the page lacks the marks around the table."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page has no lines {BEGIN.strip()!r} and {END.strip()!r} around its table")
    return f"{before}{begin}\n{markdown(try_all())}\n{end}{after}"
