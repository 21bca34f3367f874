"""What can be made again lies where it can be written to, apart for each state of the sources, and old states go."""

import os

import pytest

import bus.cache_folder as cache_folder_module
from bus.cache_folder import KEPT_S, NoCacheFolderError, cache_folder, digest_of


def test_the_digest_changes_when_content_moves_between_files(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text("x")
    second.write_text("yz")
    before = digest_of([first, second])
    first.write_text("xy")
    second.write_text("z")
    assert digest_of([first, second]) != before


def test_our_sources_are_named_from_our_folder_and_others_by_their_path(tmp_path, monkeypatch):
    digests = []
    for place in ("here", "there"):
        (tmp_path / place / "plant").mkdir(parents=True)
        for file in (tmp_path / place / "plant" / "tyre.py", tmp_path / place / "other.py"):
            file.write_text("x")
        monkeypatch.setattr(cache_folder_module, "ROOT", tmp_path / place / "plant")
        digests.append([digest_of([tmp_path / place / name]) for name in ("plant/tyre.py", "other.py")])
    (ours, others), (ours_there, others_there) = digests
    assert ours == ours_there
    assert others != others_there


def test_code_of_long_ago_is_removed_and_that_of_today_stays(tmp_path):
    old, recent, other = (tmp_path / name for name in ("plant-old", "plant-recent", "estimators-old"))
    for folder in (old, recent, other):
        folder.mkdir()
        (folder / "code.nbc").touch()
    now = recent.stat().st_mtime
    for folder in (old, other):
        os.utime(folder, (now - 2 * KEPT_S, now - 2 * KEPT_S))
    made = cache_folder(tmp_path, "plant", "new", str(tmp_path))
    assert made == tmp_path / "plant-new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimators-old", "plant-new", "plant-recent"]


def test_code_that_was_made_long_ago_and_is_still_used_stays(tmp_path):
    """A process with other effects has other code, and ends no process that uses this."""
    used = cache_folder(tmp_path, "plant", "used", str(tmp_path))
    long_ago = used.stat().st_mtime - 2 * KEPT_S
    os.utime(used, (long_ago, long_ago))
    cache_folder(tmp_path, "plant", "used", str(tmp_path))
    cache_folder(tmp_path, "plant", "other effects", str(tmp_path))
    assert used.is_dir()


def test_where_the_package_cannot_be_written_to_the_users_cache_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    package = tmp_path / "a file"
    package.touch()
    assert cache_folder(package, "plant", "0") == tmp_path / "cache" / "loaderhil" / "plant-0"


def test_without_any_place_the_error_names_them_all(tmp_path, monkeypatch):
    nowhere = tmp_path / "a file"
    nowhere.touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere / "cache"))
    with pytest.raises(NoCacheFolderError, match=r"chosen.*a file.*cache.*permissions"):
        cache_folder(nowhere, "plant", "0", str(nowhere / "chosen"))
