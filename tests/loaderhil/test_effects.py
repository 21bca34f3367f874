"""`loaderhil effects`."""

from typer.testing import CliRunner

from loaderhil import effects as command
from plant.effects import effects


def run(*arguments):
    import typer

    app = typer.Typer()
    command.register(app)
    return CliRunner().invoke(app, ["effects", *arguments])


def test_it_lists_every_effect_with_its_sentence():
    lines = run().output.splitlines()
    assert [line.split()[0] for line in lines] == list(effects())
    for line, item in zip(lines, effects().values(), strict=True):
        assert line.endswith(item.sentence)


def test_it_finds_by_where_it_is_felt():
    found = {line.split()[0] for line in run("--felt-in", "lift pressure").output.splitlines()}
    assert "payload_mass" in found
    assert "rolling_resistance" not in found


def test_one_effect_in_full():
    shown = run("steering_play").output
    item = effects()["steering_play"]
    for text in (item.sentence, item.equation, item.signature, "[effects.steering_play]", "play_deg = 0.3"):
        assert text in shown


def test_a_wrong_name_gets_a_hint():
    problem = run("steering_pla").exception
    assert "did you mean steering_play" in str(problem)
