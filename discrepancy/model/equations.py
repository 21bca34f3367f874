"""Adds an open-ended equation to a model as an effect, for the files that `loaderhil effects add` writes.

Terms act at a port of the model, or on the reading of an output. Their signals are the inputs and the outputs that are simulated with the
terms, without measured outputs. The equation was found with outputs that were simulated without it: to first order that is the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from discrepancy.model.description import Effect, Model, Window
from discrepancy.signals.recording import Array

READING = (
    "reading of "  # prefix of an output's name: the place of a term that is added to the sensor's reading
)

ROUNDS = 4
"""Simulations by which a term that feeds back on its own signals is settled. A leak that adds a quarter to a tank's own outflow is then right to
0.5 %, which is the error of the grid (19 % after one). The number is fixed, because one that depends on the values would put steps into derivatives."""

Signals = Mapping[str, Array]
Term = Callable[[Signals, Mapping[str, float], float], Array]
"""Signals on the grid, all parameters by name, step [s] -> what is added at a place, in the place's unit."""


def with_effect(model: Model, effect: Effect, terms: Mapping[str, Term]) -> Model:
    """The model with one more effect in its library. terms: by port, or by 'reading of OUTPUT'.

    Raises ValueError for a place that the model does not have.
    """
    ports = {port.name for port in model.ports}
    places = {*ports, *(f"{READING}{output}" for output in model.outputs)}
    if strange := sorted(set(terms) - places):
        raise ValueError(
            f"effect {effect.name}: {model.name} has no place {strange[0]!r}; it has {', '.join(sorted(places))}"
        )
    inner = model.simulate

    def simulate(
        window: Window, values: Mapping[str, float], extra: Mapping[str, Array]
    ) -> Mapping[str, Array]:
        if not any(values.get(name, 0.0) for name in effect.names):
            return inner(window, values, extra)
        pushed: dict[str, Array] = {}

        def pushed_motions(blind: Sequence[Window]) -> list[Mapping[str, Array]]:
            return [inner(w, values, pushed) for w in blind]

        # What acts at a port changes the outputs on which it depends. Each round carries that change one order further.
        for _ in range(ROUNDS if ports.intersection(terms) else 1):
            signals = driven(model, [window], pushed_motions)[0]
            added = {place: term(signals, values, window.step_s) for place, term in terms.items()}
            pushed = {name: more for name, more in added.items() if name in ports}
        outputs = inner(
            window, values, {**extra, **{name: extra.get(name, 0.0) + more for name, more in pushed.items()}}
        )
        read = {place.removeprefix(READING): more for place, more in added.items() if place not in ports}
        return {name: true + read[name] if name in read else true for name, true in outputs.items()}

    return replace(model, effects=(*model.effects, effect), simulate=simulate)


def driven(
    model: Model,
    windows: Sequence[Window],
    simulated: Callable[[Sequence[Window]], Sequence[Mapping[str, Array]]],
) -> list[dict[str, Array]]:
    """Signals of which functions are built, for every window: inputs, and outputs simulated without measured outputs."""
    # a measured output as regressor would explain its own error
    names = (*model.inputs, *model.optional)
    inputs = [{n: window[n] for n in names if window.has(n)} for window in windows]
    try:
        motions = simulated([replace(w, known=known) for w, known in zip(windows, inputs, strict=True)])
    except KeyError:  # the model needs a measured output to run: only inputs are left as signals
        return inputs
    return [
        {**known, **{n: y for n, y in true.items() if n in model.outputs}}
        for known, true in zip(inputs, motions, strict=True)
    ]
