"""Published recordings with a small model each, for the gallery and the proof: files, what is known, how the verdict compares."""

from dataclasses import dataclass
from pathlib import Path

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
        "Right: viscous and dry friction are named, and as is the offset, and all three intervals hold the published sizes; friction is also right at 250 Hz and on the second recording of the drive. "
        "The reading comes 1.4 ms early, which nothing known confirms; a force that is held over the 2 ms of its samples looks alike. Before samples were averaged to the model's bandwidth, viscous friction had twice its size.",
    ),
)


def model_file(exhibit: Exhibit) -> Path:
    """The model of an exhibit, from the root of the checkout."""
    return MODELS / f"{exhibit.name}.py"


def model_and_recordings(exhibit: Exhibit, data: Path) -> tuple[Model, list[Recording]]:
    """As the command line reads them; data: the folder of all recordings. Raises ValueError for a file that cannot be used."""
    choice = find_model(str(Path(__file__).resolve().parents[1] / model_file(exhibit)))
    read = read_all(
        choice, ReadOptions(paths=[data / exhibit.name / file for file in exhibit.files]), lambda _: None
    )
    if fatal := [c.described for c in read.complaints if c.fatal]:
        raise ValueError("; ".join(fatal))
    return choice.build(read.recordings), list(read.recordings)
