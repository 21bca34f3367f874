"""The README's rates of wrong names are those of the pages of the proof and of the wild arms."""

import re
from pathlib import Path

import pytest
from scipy.stats import beta

from bench.proof.stamps import KINDS

ROOT = Path(__file__).parents[2]
NULLS, CLEAR = "false findings on nulls", "a further, false name beside the truth"


def counted(row: str) -> tuple[int, int]:
    """Wrong names and recordings in all tables of both pages."""
    pages = (ROOT / "docs" / "results" / name for name in ("proof.md", "proof-loader.md"))
    page = "\n".join(file.read_text(encoding="utf-8") for file in pages)
    found = re.findall(
        rf"^\| (?:stamps [^|:]*: )?{re.escape(row)} \|.*?\| (\d+) of (\d+) ", page, re.MULTILINE
    )
    # straight, ball, car, loader, loader by MuJoCo; and the first three with two kinds of stamps beside the grid
    assert len(found) == 5 + 3 * len(KINDS)
    return sum(int(wrong) for wrong, _ in found), sum(int(count) for _, count in found)


@pytest.mark.parametrize(("row", "said"), [(NULLS, "with nothing hidden"), (CLEAR, "with a clear effect")])
def test_the_readme_says_what_the_pages_count(row, said):
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    wrong, count = counted(row)
    bound = beta.ppf(0.95, wrong + 1, count - wrong)  # Clopper and Pearson, one-sided
    [(share, at_most)] = re.findall(
        rf"{wrong} of {count} (?:simulated recordings )?{said} \(([\d.]+) %, (?:95 % )?bound ([\d.]+) %\)", readme
    )
    assert (float(share), float(at_most)) == (round(100 * wrong / count, 1), round(100 * bound, 1))


def of_bodies(row: str, page: str = "wild.md", bodies: int = 3) -> tuple[int, int]:
    """Hits and recordings of all bodies on a page of wild arms."""
    text = (ROOT / "docs" / "results" / page).read_text(encoding="utf-8")
    [line] = re.findall(rf"^\| {re.escape(row)} \|(.*)$", text, re.MULTILINE)
    found = re.findall(r"(\d+) of (\d+) \(", line)
    assert len(found) == bodies
    return sum(int(hits) for hits, _ in found), sum(int(count) for _, count in found)


def test_the_readme_says_what_the_wild_arms_count():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    named, clear = of_bodies("one effect hidden, lambda >= 50: in a named group")
    shown = []
    for row, said in (
        ("nothing hidden: a wrong name", "with nothing hidden"),
        ("recordings with a false name beside it", "with a clear effect"),
    ):
        wrong, count = of_bodies(row)
        bound = beta.ppf(0.95, wrong + 1, count - wrong)
        shown.append(f"{wrong} of {count} {said} ({100 * wrong / count:.1f} %, bound {100 * bound:.1f} %)")
    assert count == clear
    assert f"{shown[0]}, and {shown[1]}, of which {named} are named" in readme
    found, visible = of_bodies("of those with lambda >= 50 beside the differences too: in a named group")
    assert f"of the {visible} that are clear beside those laws too, {found}." in readme


def test_the_readme_says_what_the_wild_arms_of_the_loader_count():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    nulls, beside, named = (
        of_bodies(row, "wild-loader.md", bodies=1)
        for row in (
            "nothing hidden: a wrong name",
            "recordings with a false name beside it",
            "one effect hidden, lambda >= 50: in a named group",
        )
    )
    assert named[1] == beside[1]
    assert (
        f"{nulls[0]} of {nulls[1]} with nothing hidden, {beside[0]} of {beside[1]} with a clear effect, of which {named[0]} are named;"
        in readme
    )
