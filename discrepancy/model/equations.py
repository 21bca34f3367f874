"""Adds an open-ended equation to a model as an effect, for the files that `loaderhil effects add` writes.

Terms act at a port of the model, or on the reading of an output. Their signals are the inputs and the simulated outputs. Outputs are
simulated without the terms and without measured outputs, exactly as when the equation was found.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from discrepancy.model.description import Effect, Model, Window
from discrepancy.signals.recording import Array

READING = (
    "reading of "  # prefix of an output's name: the place of a term that is added to the sensor's reading
)

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
