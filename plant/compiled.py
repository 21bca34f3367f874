"""The compiler of the plant: numba, its code kept by the state of all sources of the plant and its effects."""

from pathlib import Path

from bus.cache_folder import ROOT, digest_of
from bus.machine_code import COUNTED, UNCOUNTED, code_folder, compiler, translatable, uncounting
from plant.effects.files import effect_files

FOLDER = Path(__file__).resolve().parent
# what is generated beside the machine code follows from these sources; counted in, every process would compile anew
SOURCES = {file for file in FOLDER.rglob("*.py") if "__pycache__" not in file.parts}
SOURCES |= set((ROOT / "bus" / "lanes").glob("*.py"))  # it makes machine code from the texts of the plant
DIGEST = digest_of(sorted({*SOURCES, *effect_files()}))
"""Of every source that machine code is made from, the effects of the user included."""

CODE = code_folder(FOLDER, "plant", DIGEST)

compiled = compiler(CODE, error_model="numpy", **COUNTED)

uncounted = uncounting(CODE, error_model="numpy")
"""For what runs in every step and allocates nothing: it counts no references to arrays (bus.machine_code)."""

inlined = uncounting(CODE, error_model="numpy", forceinline=True)
"""As `uncounted`, and copied into its caller: for what has one caller, because a call hands around two dozen arrays."""

ruled = translatable(error_model="numpy", **UNCOUNTED)
"""For the rules of driver, limits and actuators: Python where Python calls them, and compiled within `plant.unit.control`."""

released = compiler(CODE, error_model="numpy", nogil=True, **COUNTED)
"""For long work that may run beside other threads: it lets go of the interpreter while it runs."""
