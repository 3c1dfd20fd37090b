"""The cache of gather maps."""

import numpy as np
import pytest

from lfsr_core.optics.panel import weave
from tests.support.panels import lenticular


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("LFSR_CACHE", str(tmp_path))
    monkeypatch.setattr(weave, "MIN_SUBPIXELS", 0)
    return tmp_path / "weave"


def same(first, second):
    np.testing.assert_array_equal(first.first, second.first)
    assert [axis.stride for axis in first.axes] == [axis.stride for axis in second.axes]
    for one, two in zip(first.axes, second.axes, strict=True):
        np.testing.assert_array_equal(one.weights, two.weights)


def test_a_map_is_computed_once(cache, monkeypatch):
    first = weave.cached_gather_map(lenticular())
    monkeypatch.setattr(weave, "gather_map", lambda *_: pytest.fail("it is on disk"))
    same(weave.cached_gather_map(lenticular(description="another text")), first)


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), lambda path: path.write_bytes(b"x"),
                                    lambda path: path.write_bytes(path.read_bytes()[:-100])])
@pytest.mark.parametrize("name", ["first.npy", "axis0.npy", "map.json"])
def test_a_damaged_map_is_made_again(cache, name, damage):
    first = weave.cached_gather_map(lenticular())
    (path,) = cache.glob(f"*/{name}")
    damage(path)
    same(weave.cached_gather_map(lenticular()), first)


def test_only_the_last_few_stay(cache):
    for number in range(weave.MAX_MAPS + 2):
        weave.cached_gather_map(lenticular(viewing_distance_mm=300.0 + number))
    assert len(list(cache.iterdir())) == weave.MAX_MAPS
    assert (cache / weave.digest(lenticular(viewing_distance_mm=304.0))).is_dir()


def test_without_a_place_to_write_it_is_only_slower(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("LFSR_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr(weave, "MIN_SUBPIXELS", 0)
    assert weave.cached_gather_map(lenticular()).axes
