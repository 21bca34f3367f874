"""The README's rates of wrong names are those of the proof's page."""

import re
from pathlib import Path

import pytest
from scipy.stats import beta

ROOT = Path(__file__).parents[2]
NULLS, CLEAR = "false findings on nulls", "a further, false name beside the truth"


def counted(row: str) -> tuple[int, int]:
    """Wrong names and recordings in all tables of the page."""
    page = (ROOT / "docs" / "results" / "proof.md").read_text(encoding="utf-8")
    found = re.findall(rf"^\| {re.escape(row)} \|.*?\| (\d+) of (\d+) ", page, re.MULTILINE)
    assert len(found) == 5  # straight, ball, car, loader, loader by MuJoCo
    return sum(int(wrong) for wrong, _ in found), sum(int(count) for _, count in found)


@pytest.mark.parametrize(("row", "said"), [(NULLS, "with nothing hidden"), (CLEAR, "with a clear effect")])
def test_the_readme_says_what_the_page_counts(row, said):
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    wrong, count = counted(row)
    bound = beta.ppf(0.95, wrong + 1, count - wrong)  # Clopper and Pearson, one-sided
    [(share, at_most)] = re.findall(
        rf"{wrong} of {count} (?:simulated recordings )?{said} \(([\d.]+) %, (?:95 % )?bound ([\d.]+) %\)", readme
    )
    assert (float(share), float(at_most)) == (round(100 * wrong / count, 1), round(100 * bound, 1))
