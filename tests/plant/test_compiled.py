"""The machine-code cache is emptied when any compiled source changes, and only then."""

from plant.compiled import SOURCES, _forget_stale_code


def test_a_changed_source_empties_the_cache(tmp_path):
    (tmp_path / "effects").mkdir()
    for name in SOURCES:
        (tmp_path / name).write_text("x = 1\n", encoding="utf-8")
    _forget_stale_code(tmp_path)
    cached = tmp_path / "__pycache__" / "dynamics.advance-123.py311.1.nbc"
    other = tmp_path / "__pycache__" / "dynamics.cpython-311.pyc"
    cached.touch()
    other.touch()
    _forget_stale_code(tmp_path)
    assert cached.exists()
    (tmp_path / "tyre.py").write_text("x = 2\n", encoding="utf-8")
    _forget_stale_code(tmp_path)
    assert not cached.exists()
    assert other.exists()


def test_a_folder_that_cannot_be_written_to_is_left_alone(tmp_path):
    (tmp_path / "effects").mkdir()
    for name in SOURCES:
        (tmp_path / name).write_text("x = 1\n", encoding="utf-8")
    (tmp_path / "__pycache__").write_text("a file where the cache's folder should be", encoding="utf-8")
    _forget_stale_code(tmp_path)
