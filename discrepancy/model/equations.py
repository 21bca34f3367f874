"""An equation that was found outside the library, as an effect of a model: a user's file holds the terms, this puts them in.

Terms act at a port of the model, or on the reading of an output; their signals are the inputs, and the outputs as simulated without
the terms and without sight of measured outputs, as they were when the equation was found.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from discrepancy.model.description import Effect, Model, Window
from discrepancy.signals.recording import Array

READING = "reading of "  # before the name of an output: a term that is added to what its sensor says

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
        signals = driven(model, [window], lambda blind: [inner(w, values, {}) for w in blind])[0]
        added = {place: term(signals, values, window.step_s) for place, term in terms.items()}
        pushed = {name: extra.get(name, 0.0) + more for name, more in added.items() if name in ports}
        outputs = inner(window, values, {**extra, **pushed})
        read = {place.removeprefix(READING): more for place, more in added.items() if place not in ports}
        return {name: true + read[name] if name in read else true for name, true in outputs.items()}

    return replace(model, effects=(*model.effects, effect), simulate=simulate)


def driven(
    model: Model,
    windows: Sequence[Window],
    simulated: Callable[[Sequence[Window]], Sequence[Mapping[str, Array]]],
) -> list[dict[str, Array]]:
    """Signals to build functions of, in every window: inputs, and outputs simulated without sight of the measured ones.

    A measured output used as regressor would explain itself.
    """
    names = (*model.inputs, *model.optional)
    inputs = [{n: window[n] for n in names if window.has(n)} for window in windows]
    try:
        motions = simulated([replace(w, known=known) for w, known in zip(windows, inputs, strict=True)])
    except KeyError:  # the model is driven by a measured output
        return inputs
    return [
        {**known, **{n: y for n, y in true.items() if n in model.outputs}}
        for known, true in zip(inputs, motions, strict=True)
    ]
