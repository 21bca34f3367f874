"""MATLAB files: the same vectors as SciPy's reader gives for sound files, and one error for every damage."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from identify import matlab
from identify.matlab import COMPRESSED, HEADER, MATRIX, Damaged, Newer, vectors
from identify.reading import BadRecording, read_channels

KINDS = ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]
OF_MATLAB = Path(scipy.io.__path__[0]) / "matlab" / "tests" / "data"
"""Files that MATLAB 4.2 to 7.4 wrote on several machines, of both byte orders; SciPy brings them for its own tests."""


def by_scipy(file):
    """The same selection from SciPy's reader."""
    content = scipy.io.loadmat(file, squeeze_me=True)
    return {
        name: np.asarray(v, float)
        for name, v in content.items()
        if not name.startswith("__") and np.ndim(v) == 1 and np.asarray(v).dtype.kind in "fiu"
    }


def assert_same(found, expected):
    assert list(found) == list(expected)
    for name, column in expected.items():
        np.testing.assert_array_equal(found[name], column)


def many():
    """Vectors of every type beside everything that is passed over."""
    edges = {k: [np.iinfo(k).min, 3, np.iinfo(k).max] for k in KINDS if k[0] != "f"}
    edges |= {"f8": [-1e308, np.nan, np.inf], "f4": [-1e38, np.nan, -np.inf]}
    return {f"of_{k}": np.array(v, k) for k, v in edges.items()} | {
        "column": np.arange(7.0)[:, None],
        "row": np.arange(300.0)[None, :],
        "logical": np.array([True, False, True]),
        "none": np.zeros((1, 0)),
        "number": 3.0,
        "matrix": np.ones((3, 4)),
        "complex": np.array([1j, 2.0]),
        "sparse": scipy.sparse.csc_array(np.eye(3)),
        "text": "words of some length",
        "structure": {"a": np.arange(4.0), "b": "x"},
        "cell": np.array([np.arange(3.0), "x"], object),
        "last": np.arange(5.0),
    }


@pytest.mark.parametrize("compressed", [False, True])
def test_vectors_of_version_5_are_those_of_scipy(tmp_path, compressed):
    scipy.io.savemat(tmp_path / "a.mat", many(), do_compression=compressed)
    found = vectors(tmp_path / "a.mat")
    assert_same(found, by_scipy(tmp_path / "a.mat"))
    assert {"of_u8", "column", "row", "logical", "last"} <= found.keys()
    assert not {"number", "matrix", "complex", "text", "structure", "cell", "sparse"} & found.keys()


def test_vectors_of_version_4_are_those_of_scipy(tmp_path):
    kept = ("f8", "f4", "i2", "u2", "i4", "u1")
    old = {
        n: v
        for n, v in many().items()
        if n not in ("structure", "cell", "logical") and (n[:3] != "of_" or n[3:] in kept)
    }
    scipy.io.savemat(tmp_path / "a.mat", old, format="4")
    found = vectors(tmp_path / "a.mat")
    assert_same(found, by_scipy(tmp_path / "a.mat"))
    assert {f"of_{k}" for k in kept} | {"column", "row", "last"} <= found.keys()


def test_files_that_matlab_wrote_are_read_as_scipy_reads_them():
    files = sorted(OF_MATLAB.glob("test*_SOL2.mat")) + sorted(OF_MATLAB.glob("test*_GLNX86.mat"))
    files = [file for file in files if "hdf5" not in file.name]
    assert len(files) > 50
    found = {file.name: vectors(file) for file in files}
    for file in files:
        assert_same(found[file.name], by_scipy(file))
    # of both byte orders, old and new
    for name in ("testdouble_4.2c_SOL2.mat", "testdouble_6.1_SOL2.mat", "testdouble_7.4_GLNX86.mat"):
        assert found[name]["testdouble"].size == 9


def test_a_file_of_matlab_7_3_is_named_as_such():
    with pytest.raises(Newer):
        vectors(OF_MATLAB / "testhdf5_7.4_GLNX86.mat")


@pytest.fixture(params=["stored", "compressed", "old"])
def sound(request, tmp_path):
    file = tmp_path / "a.mat"
    columns = {"t": np.arange(8.0), "v": np.arange(8.0) ** 2, "note": "text", "u": np.arange(8, dtype="i2")}
    if request.param == "old":
        scipy.io.savemat(file, columns, format="4")
    else:
        scipy.io.savemat(file, columns, do_compression=request.param == "compressed")
    return file


def test_a_file_cut_anywhere_gives_whole_variables_or_an_error(sound):
    whole, content = vectors(sound), sound.read_bytes()
    read = 0
    for length in range(len(content)):
        sound.write_bytes(content[:length])
        try:
            found = vectors(sound)
        except Damaged:
            continue
        read += 1
        assert_same(found, dict(list(whole.items())[: len(found)]))
    assert read <= len(whole) + 1  # only where a variable ends


@pytest.mark.parametrize("byte", [0x00, 0x01, 0x14, 0x6E, 0x7F, 0x80, 0xFF])
def test_any_byte_replaced_ends_in_an_error_or_is_read(sound, byte):
    content = sound.read_bytes()
    for at in range(len(content)):
        sound.write_bytes(content[:at] + bytes([byte]) + content[at + 1 :])
        try:
            found = vectors(sound)
        except (Damaged, Newer) as error:
            assert "\n" not in str(error)  # noqa: PT017 - a file that is read is as good
        else:
            assert all(v.dtype == np.float64 and v.ndim == 1 for v in found.values())


def written(file, *, extents=(3, 1), kind=9, values=bytes(24), name=b"speed", pack=False, more=b""):
    """A file of one variable of class double, as the keywords say."""

    def element(kind, content):
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    body = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack(f"<{len(extents)}i", *extents))
    body += element(1, name) + element(kind, values) + more
    body = struct.pack("<II", MATRIX, len(body)) + body
    if pack:
        packed = zlib.compress(body)
        body = struct.pack("<II", COMPRESSED, len(packed)) + packed
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    file.write_bytes(header + body)
    return file


def test_every_unknown_type_of_values_is_an_error(tmp_path):
    read = []
    for kind in range(300):
        try:
            read += [kind] * len(vectors(written(tmp_path / "a.mat", kind=kind, values=bytes(24))))
        except Damaged as error:
            assert "'speed' has" in str(error)  # noqa: PT017 - a type of eight bytes is read
    assert read == [9, 12, 13]


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ({"extents": (4, 1)}, "has 4 values of 8 bytes in 24 bytes"),
        ({"extents": (-3, 1)}, "a dimension is negative"),
        ({"extents": (1,) * 40 + (3,)}, "164 bytes where 128 are the most"),
        ({"name": b"a\nb"}, "cannot be printed"),
        ({"name": b"x" * 5000}, "5000 bytes where 4096"),
        ({"pack": True, "more": bytes(16)}, "bytes behind its end"),
    ],
)
def test_a_damaged_variable_is_refused_with_place_and_reason(tmp_path, how, reason):
    file = written(tmp_path / "a.mat", **how)
    with pytest.raises(Damaged, match=f"the variable at byte {HEADER}: .*{reason}"):
        vectors(file)


@pytest.mark.parametrize("chunk", [1, matlab.CHUNK])
def test_a_wrong_checksum_of_compressed_data_is_an_error(tmp_path, monkeypatch, chunk):
    monkeypatch.setattr(matlab, "CHUNK", chunk)
    file = written(tmp_path / "a.mat", pack=True)
    assert vectors(file)["speed"].tolist() == [0.0, 0.0, 0.0]
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    with pytest.raises(Damaged, match="compressed data are damaged"):
        vectors(file)


def test_claimed_sizes_are_refused_before_memory_is_taken(tmp_path, monkeypatch):
    with pytest.raises(Damaged, match="more values than"):
        vectors(written(tmp_path / "a.mat", extents=(2**31 - 1, 1), pack=True))
    bomb = written(tmp_path / "b.mat", extents=(2**20, 1), kind=2, values=bytes(2**20), pack=True)
    assert vectors(bomb)["speed"].size == 2**20
    monkeypatch.setattr(matlab, "FREE", 2**22)
    with pytest.raises(Damaged, match="more values than"):
        vectors(bomb)


def test_a_reader_of_channels_names_file_and_reason(tmp_path):
    file = written(tmp_path / "a.mat", kind=110)
    with pytest.raises(BadRecording) as caught:
        read_channels(file, {"v": "speed"}, {"v": "m/s"})
    assert str(file) in str(caught.value)
    assert "unknown type 110" in str(caught.value)
