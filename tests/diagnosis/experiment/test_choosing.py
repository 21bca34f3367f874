"""Which manoeuvre is chosen."""

from diagnosis.experiment.choosing import PLENTY, Expected, Manoeuvre, Outlook, best
from discrepancy import gates


def outlook(name: str, duration_s: float, *differences: float) -> Outlook:
    manoeuvre = Manoeuvre(name=name, sentence="", duration_s=duration_s)
    pairs = [Expected(one="a", other=str(k), difference=d) for k, d in enumerate(differences)]
    return Outlook(manoeuvre=manoeuvre, expected=pairs)


def chosen(*found: Outlook) -> str | None:
    one = best(found)
    return one.manoeuvre.name if one is not None else None


ENOUGH = gates.MANOEUVRE_DECIDES.threshold


def test_nothing_is_chosen_that_distinguishes_no_pair() -> None:
    assert chosen(outlook("a", 10.0, 0.9 * ENOUGH), outlook("b", 10.0, 0.0)) is None
    assert chosen() is None


def test_the_one_that_shows_more_is_chosen() -> None:
    assert chosen(outlook("little", 5.0, 1.1 * ENOUGH), outlook("much", 50.0, 5.0 * ENOUGH)) == "much"


def test_beyond_doubt_the_shorter_one_is_chosen() -> None:
    assert chosen(outlook("long", 50.0, 100.0 * PLENTY), outlook("short", 5.0, PLENTY)) == "short"


def test_two_pairs_are_worth_more_than_one_beyond_doubt() -> None:
    one, both = outlook("one", 5.0, 50.0 * PLENTY, 0.0), outlook("both", 50.0, 0.6 * PLENTY, 0.6 * PLENTY)
    assert chosen(one, both) == "both"
