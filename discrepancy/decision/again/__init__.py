"""Second searches: beside an equation, without an effect, with finer windows, with one effect in the place of two."""
