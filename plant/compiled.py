"""The compiler of the plant: numba, its code kept by the state of all sources of the plant and its effects."""

from pathlib import Path

from bus.machine_code import code_folder, compiler, digest_of
from plant.effects.files import effect_files

FOLDER = Path(__file__).resolve().parent
# what is generated beside the machine code follows from these sources; counted in, every process would compile anew
SOURCES = {file for file in FOLDER.rglob("*.py") if "__pycache__" not in file.parts}
DIGEST = digest_of(sorted({*SOURCES, *effect_files()}))
"""Of every source that machine code is made from, the effects of the user included."""

CODE = code_folder(FOLDER, "plant", DIGEST)

compiled = compiler(CODE, error_model="numpy")

released = compiler(CODE, error_model="numpy", nogil=True)
"""For long work that may run beside other threads: it lets go of the interpreter while it runs."""
