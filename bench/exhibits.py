"""Published recordings with a small model each, for the gallery and the proof: files, what is known, how the verdict compares."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bench import plaza
from diagnosis.models import find_model
from diagnosis.reading.reading import ReadOptions, read_all
from discrepancy.model.description import Model
from discrepancy.signals.recording import Recording

MODELS = Path("discrepancy/models/gallery")


@dataclass(frozen=True, slots=True)
class Exhibit:
    """One published recording."""

    name: str  # of its model and its folder
    files: tuple[str, ...]
    story: str
    known: str  # what is known of the truth, and from where
    judgement: str  # how the verdict compares with it
    average: bool = False  # --average of the command
    prepare: Callable[[Path, Path], None] | None = (
        None  # makes the table of `files` from the folder of published ones
    )


EXHIBITS = (
    Exhibit(
        "pneumatic_cylinder",
        tuple(f"o_ring_{bar}bar.csv.gz" for bar in (1, 3, 5, 7)),
        "A printed cylinder at four pressures. The model: force is pressure times area.",
        "Friction of the seals from both stroke directions at constant area: 3.9, 5.4, 6.9, 7.8 N at 1, 3, 5, 7 bar, about 3.3 N + 0.66 N/bar.",
        "Right: both parts of the seals' friction are named, and their sizes agree with the known ones. The lag of the force sensor beside them is not "
        "confirmed by anything known; a seal that bends before it slides looks alike.",
    ),
    Exhibit(
        "cascaded_tanks",
        ("estimation.csv", "validation.csv"),
        "Two tanks, one above the other. The model: Torricelli's law.",
        "The upper tank overflows, partly into the lower one, and the reading of the level ends at 10 V (52 and 43 of 1024 samples).",
        "Honest, without a name: the simulation is wrong by a third of the movement, most where the level is high, which is where the tank overflows. "
        "The noise model still takes the slow error for noise with memory, so no effect passes; the saturated reading could not be judged.",
    ),
    Exhibit(
        "emps",
        ("estimation.csv.gz",),
        "A linear drive with a ball screw, 500 Hz. The model: a mass that a motor's force pushes.",
        "Published: viscous friction 203.5 N s/m, dry friction 20.4 N, offset of the force -3.2 N, mass 95.1 kg.",
        "Right: viscous and dry friction are named, as is the offset, and all three intervals hold the published sizes; friction is also right at 250 Hz and on the second recording of the drive. "
        "Until every value of the force counted over its own 2 ms, not every second one over 4, the reading seemed to come 1.4 ms early. Without `--average` viscous friction is 254 N s/m by single samples, and its interval of 192 to 273 holds the 221 by means of 16 as well (another processor: 260, 190 to 279): the drive moves far slower than it is sampled.",
        average=True,
    ),
    Exhibit(
        "silverbox",
        ("arrow.csv.gz", "multisine.csv.gz"),
        "An electronic mass on a spring, 610 Hz, driven weakly and strongly. The model: a linear spring and a linear damper.",
        "The spring stiffens with the cube of its travel, with a small even term beside it. Published models with the cubic term simulate the multisine "
        "to 1.06 mV.",
        "Right: the stiffening spring is the one cause that is named, and the simulation comes down to a twenty-fifth. The spring that differs by direction, "
        "the small even term, stays a best proxy. A first version of the model held the force over each of its steps; the tool then "
        "called the reading 0.405 ms early, half a step.",
    ),
    Exhibit(
        "plaza_ranging",
        ("plaza1.csv",),
        "A lawn mower measures its distance to four radio beacons; satellites give its place. The model: geometry.",
        "Against the reference every distance is 1.069 to 1.070 times too large, plus 0 to 0.03 m; each beacon alone gives 1.068 to 1.071.",
        "Right, and alone among twelve effects: neither the offset, the height of the antennas nor one beacon's own scale is taken for it.",
        prepare=plaza.write_table,
    ),
    Exhibit(
        "double_pendulum",
        ("trajectory_0.csv.gz", "trajectory_1.csv.gz"),
        "Two arms driven at both joints, 500 Hz. The model: rigid arms on frictionless joints, with the masses known to a tenth.",
        "Identified by its makers: dry friction of 0.093 N m at the shoulder and 0.078 N m at the elbow, viscous friction of 0.001 N m s/rad "
        "at both; another of their models has 0.186 N m at the elbow.",
        "Half right: the dry friction of both joints is named, and the shoulder's interval holds the published size. "
        "The elbow's is a fifth too small with an interval that misses the makers' 0.078 N m, beside a viscous "
        "friction of 0.008 N m s/rad that nothing published confirms: the two share one resistance. An equation of the torques is left, so that the verdict is in part.",
    ),
    Exhibit(
        "qube_pendulum",
        ("run.csv.gz",),
        "The arm of a rotary pendulum that a controller keeps upright, 250 Hz. The model: a motor with linear damping and the pendulum's pull.",
        "Nearly nothing: a linear model explains all but 8.7 % of the arm's acceleration, and dry friction takes that to 8.4 %.",
        "Honest: no cause is named. What is left is small and depends on the voltage; a dead zone of the motor, dry friction and a delay are only the most similar effects. "
        "A first version of the model left out that the pendulum's inertia moves the arm; the tool answered with that equation, a part of the "
        "pendulum's angle in the arm's.",
    ),
)


def model_file(exhibit: Exhibit) -> Path:
    """The model of an exhibit, from the root of the checkout."""
    return MODELS / f"{exhibit.name}.py"


def model_and_recordings(exhibit: Exhibit, data: Path) -> tuple[Model, list[Recording]]:
    """As the command line reads them; data: the folder of all recordings. Raises ValueError for a file that cannot be used."""
    choice = find_model(str(Path(__file__).resolve().parents[1] / model_file(exhibit)))
    with TemporaryDirectory() as made:
        folder = data / exhibit.name
        if exhibit.prepare:
            exhibit.prepare(folder, Path(made) / exhibit.files[0])
            folder = Path(made)
        options = ReadOptions(paths=[folder / file for file in exhibit.files])
        read = read_all(choice, options, lambda _: None)
    if fatal := [c.described for c in read.complaints if c.fatal]:
        raise ValueError("; ".join(fatal))
    return choice.build(read.recordings), list(read.recordings)
