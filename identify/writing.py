"""Recordings of the generators as files: CSV, Parquet or MATLAB .mat, as the user's systems write them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.io import savemat

Array = NDArray[np.float64]

FORMATS = ("parquet", "csv", "mat")


def write_columns(path: Path, columns: Mapping[str, Array]) -> None:
    """Columns by heading ('V_cyl [m/s]'), all (n,); the kind of file is that of the name. NaN is an empty cell of CSV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        pq.write_table(pa.table({name: pa.array(v, from_pandas=True) for name, v in columns.items()}), path)
    elif path.suffix == ".mat":
        savemat(path, {name.partition(" [")[0]: v for name, v in columns.items()})
    else:
        text = [",".join(columns)]
        rows = np.stack(list(columns.values()), axis=1).tolist()
        text += [",".join("" if v != v else repr(v) for v in row) for row in rows]
        path.write_text("\n".join(text) + "\n", encoding="utf-8")
