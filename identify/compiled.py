"""The compiler of the identification: numba, its code kept by the state of all sources that it is made from."""

from pathlib import Path

from bus.cache_folder import digest_of
from bus.machine_code import code_folder, compiler
from plant.compiled import DIGEST as OF_PLANT

FOLDER = Path(__file__).resolve().parent
SOURCES = ("tyre/curve.py", "tyre/transient.py", "signals/kalman.py", "make/drum.py")
"""Files that hold compiled functions."""

DIGEST = digest_of(FOLDER / name for name in SOURCES)

compiled = compiler(code_folder(FOLDER, "identify", f"{DIGEST}-{OF_PLANT}"), error_model="numpy")
