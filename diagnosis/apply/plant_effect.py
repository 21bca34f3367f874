"""Writes an equation found in the loader's accelerations as an effect of the plant in one file (docs/howto/add-an-effect.md).

A missing term of specific force is a missing force on the machine, divided by its mass. The plant has no port for other readings and for
functions with a memory; an equation with these stays an effect of the diagnosis.
"""

import json
import re
from collections.abc import Sequence

from diagnosis.apply.functions import NoEffect, read_function
from discrepancy.model.equations import READING
from discrepancy.signals.findings import Findings, OpenTerm
from plant.unit.signals import WHEELS

# index of the axis for each place where an equation may act
PLACES = {f"{READING}specific_force_{axis}": i for i, axis in enumerate("xyz")}
SIGNALS = {
    **{f"wheel_torque_{wheel}": f"work.tree.effort[WHEEL + {i}]" for i, wheel in enumerate(WHEELS)},
    **{f"wheel_speed_{wheel}": f"state[JOINT_RATE + WHEEL + {i}]" for i, wheel in enumerate(WHEELS)},
    "articulation_angle": "state[JOINT + FRONT_FRAME]",
    "articulation_rate": "state[JOINT_RATE + FRONT_FRAME]",
    "lift_arm_angle": "state[JOINT + LIFT_ARM]",
    "tilt_angle": "state[JOINT + BUCKET]",
    "roll_rate": "state[ANGULAR]",
    "pitch_rate": "state[ANGULAR + 1]",
    "yaw_rate": "state[ANGULAR + 2]",
}
"""The plant's variable for each signal of the loader's model, as available in the port `bodies`."""


def forces(terms: Sequence[OpenTerm]) -> bool:
    """Whether every term is a force on the machine that the plant can compute."""
    return all(term.place in PLACES and _has_numbers(term) for term in terms)


def _has_numbers(term: OpenTerm) -> bool:
    function = read_function(term.function)
    return bool(function.numbers) and all(signal in SIGNALS for signal in function.signals)


def plant_file(result: Findings, terms: Sequence[OpenTerm], name: str) -> str:
    """Text of the effect's file. Raises NoEffect for a name that cannot be a key of a machine file."""
    if not name.isidentifier():
        raise NoEffect(
            f"--name '{name}': a name in machine files may have only letters, digits and _, such as {_identifier(name)}"
        )
    functions = [read_function(term.function) for term in terms]
    signals = dict.fromkeys(signal for function in functions for signal in function.signals)
    along = [
        " + ".join(
            f"q[{i}] * {function.numbers}"
            for i, (term, function) in enumerate(zip(terms, functions, strict=True))
            if PLACES[term.place] == axis
        )
        or "0.0"  # no term along this axis
        for axis in range(3)
    ]
    # names of the state's layout that the expressions above use; the generated file imports exactly these
    constants = sorted({word for s in signals for word in re.findall("[A-Z_]+", SIGNALS[s])} | {"REAR_FRAME"})
    depends = ", ".join(result.open_ended.depends_on) if result.open_ended else ""
    equation = "; ".join(f"a_{'xyz'[PLACES[t.place]]} += c{i} {t.function}" for i, t in enumerate(terms, 1))
    rows = [
        # bounds of ten times the found coefficient, either sign: room for what another recording may show
        f'        Parameter("c{i}", "{term.unit}", {term.coefficient!r}, {-most!r}, {most!r}, "c{i}"),'
        for i, term in enumerate(terms, 1)
        for most in (10.0 * abs(term.coefficient),)
    ]
    return "\n".join(
        [
            f'"""Found by `loaderhil diagnose` in {", ".join(result.recordings)}: {equation}."""',
            "",
            "from plant.compiled import compiled",
            "from plant.effects.effect import Array, Effect, Parameter",
            "from plant.effects.ports import push",
            f"from plant.physics.state import {', '.join(constants)}",
            "from plant.physics.workspace import Workspace",
            "",
            "",
            "@compiled",
            "def bodies(q: Array, x: int, state: Array, p: Array, work: Workspace) -> None:",
            '    """A force on the centre of gravity, along the axes of the rear frame."""',
            *(f"    {signal} = {SIGNALS[signal]}" for signal in signals),
            "    mass = work.whole[0]",
            *(f"    f{axis} = mass * ({text})" for axis, text in zip("xyz", along, strict=True)),
            "    push(work, REAR_FRAME, work.whole[1], work.whole[2], work.whole[3], fx, fy, fz)",
            "",
            "",
            "EFFECT = Effect(",
            f"    name={json.dumps(name)},",
            f"    sentence={json.dumps(f'Something pushes the machine, depending on {depends}.', ensure_ascii=False)},",
            f"    equation={json.dumps(equation, ensure_ascii=False)},",
            "    parameters=(",
            *rows,
            "    ),",
            '    acts_on="acceleration, speed",',
            f"    signature={json.dumps(f'An acceleration that depends on {depends}.', ensure_ascii=False)},",
            f"    excited_by={json.dumps(f'large changes of {depends}', ensure_ascii=False)},",
            '    source="found in a recording, cause unknown",',
            ")",
            "",
        ]
    )


def _identifier(name: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in name).strip("_") or "found"
