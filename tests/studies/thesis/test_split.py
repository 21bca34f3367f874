"""Plant and estimators are changed alike, whatever the split: standing loads agree with each other and with statics."""

import math

import pytest

from plant.unit.scenario import Start
from plant.unit.script import Script
from studies.thesis.drive import drive_case, driven, estimated, line
from studies.thesis.split import SHEET, SPLITS, Split, machine_of, parameters_of

CORNERS = [split for split in SPLITS if split.forward and split.higher]


def stood(split, angle=0.3):
    return driven(drive_case(0.1, start=Start(articulation_angle=angle), script=Script()), split)


def test_the_sheet_is_first_and_every_other_split_differs():
    assert SPLITS[0] == SHEET
    assert len(set(SPLITS)) == len(SPLITS)
    assert len(CORNERS) == 4


@pytest.mark.parametrize("split", [SHEET, *CORNERS], ids=str)
def test_standing_articulated_the_corrected_estimator_knows_the_machine(split):
    truth = stood(split)
    estimate = estimated(truth, split, "corrected")["normal_force"]
    assert estimate[0] == pytest.approx(truth["normal_force"][0], rel=0.01)


def test_mass_moved_forward_loads_the_front_by_its_lever():
    """Statics of the straight machine: moved from the rear frame's centre to the front frame's, over the wheelbase."""
    moved, machine = 500.0, machine_of(SHEET)
    before, after = stood(SHEET, 0.0)["normal_force"][0], stood(Split(forward=moved), 0.0)["normal_force"][0]
    arm = machine.front_frame.x - machine.rear_frame.x
    gain = moved * 9.81 * arm / (machine.geometry.front_axle_x - machine.geometry.rear_axle_x)
    assert (after - before)[:2].sum() == pytest.approx(gain, rel=0.01)
    assert after.sum() == pytest.approx(before.sum(), rel=1e-4)


def test_a_higher_centre_changes_no_load_on_level_ground_but_the_transfer_on_a_bank():
    from plant.physics.surface import Surface

    bank = Surface(bank=math.radians(5.0))

    def right_minus_left(split):
        case = drive_case(0.1, start=Start(), script=Script(), surface=bank)
        force = driven(case, split)["normal_force"][0]
        return force[1] + force[3] - force[0] - force[2]

    raised = 0.12
    rear = parameters_of(SHEET).rear.mass
    more = right_minus_left(Split(higher=raised)) - right_minus_left(SHEET)
    track = parameters_of(SHEET).geometry.front_track
    rigid = 2 * rear * 9.81 * math.sin(math.radians(5.0)) * raised / track
    assert rigid < more < 1.2 * rigid  # on its tyres it leans a little further
    assert stood(Split(higher=raised))["normal_force"][0] == pytest.approx(
        stood(SHEET)["normal_force"][0], rel=2e-3
    )


@pytest.mark.parametrize("form", ["printed", "corrected"])
def test_both_forms_see_the_simulations_own_slope(form):
    """No sensor has leaned it, so nothing is to be taken off it: neither in a turn nor while it gets faster."""
    speed, angle = line((0.0, 2.0), (3.0, 4.0)), line((0.5, 0.0), (2.0, 0.3))
    truth = driven(
        drive_case(3.0, start=Start(speed=2.0), script=Script(speed=speed, articulation_angle=angle)), SHEET
    )
    seen = estimated(truth, SHEET, form)
    assert seen["slope_pitch"] == pytest.approx(truth["pitch"], abs=1e-9)
    assert seen["slope_roll"] == pytest.approx(truth["roll"], abs=1e-9)
