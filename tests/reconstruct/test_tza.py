import hypothesis.extra.numpy as npst
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct import denoiser
from lfsr_core.reconstruct.denoiser import read_tza, write_tza
from tests.support.told import refuses

NAMES = st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), min_size=1, max_size=30)


def shapes():
    return st.one_of(st.tuples(st.integers(1, 40)), st.tuples(*[st.integers(1, 6)] * 4))


@given(st.dictionaries(NAMES, npst.arrays(np.float16, shapes(), elements=st.floats(-9, 9, width=16)), max_size=6),
       st.booleans())
def test_what_is_written_is_read(tmp_path_factory, tensors, half):
    path = tmp_path_factory.mktemp("tza") / "some.tza"
    write_tza(path, tensors, half=half)
    found = read_tza(path)
    assert list(found) == list(tensors)
    for name, tensor in tensors.items():
        assert found[name].dtype == (np.float16 if half else np.float32)
        np.testing.assert_array_equal(found[name], tensor)
    table = denoiser.HEADER.unpack_from(path.read_bytes())[3]
    assert len(tensors) == int.from_bytes(path.read_bytes()[table:table + 4], "little")


def network(widths=(2,) * 15 + (3,), inputs=3):
    draw = np.random.default_rng(0)
    return {name: draw.normal(0, 0.1, shape).astype(np.float32)
            for name, shape in denoiser.network_shapes(widths, inputs).items()}


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    path = tmp_path_factory.mktemp("tza") / "network.tza"
    write_tza(path, network())
    return path.read_bytes()


def check_damaged(damaged):
    """One sentence, or a network all the same, such as after another value."""
    try:
        denoiser.check_network(denoiser.parse_tza(damaged, "x.tza"), "x.tza")
    except LfsrError as error:
        assert str(error).startswith("x.tza ") and "\n" not in str(error)
        return True
    return False


def test_a_cut_file_is_one_sentence(content):
    for length in [*range(0, 200), *range(200, len(content), 61), len(content) - 1]:
        assert check_damaged(content[:length]), length


@pytest.mark.parametrize(("place", "value", "message"), [
    (0, 0, "begins with 0x4100 version 2"), (2, 3, "begins with 0x41d7 version 3"), (11, 255, "its table is at byte"),
    (64, 255, None), (65, 255, "'enc_conv0.weight' has values that are not finite")])
def test_damage_is_named(content, place, value, message):
    damaged = bytearray(content)
    damaged[place] = value
    if message is None:
        assert not check_damaged(bytes(damaged))
        return
    refuses(rf"x.tza cannot be read as TZA weights \(.*{message}.*get it again",
            denoiser.parse_tza, bytes(damaged), "x.tza")


@pytest.mark.parametrize("tensor", [np.full(3, np.nan), np.full(3, 1e5), np.ones((2, 2))])
def test_what_cannot_be_stored_leaves_no_file(tmp_path, tensor):
    refuses("'a' of shape", write_tza, tmp_path / "a.tza", {"a": tensor})
    assert not list(tmp_path.iterdir())


def test_a_large_value_needs_single_floats(tmp_path):
    write_tza(tmp_path / "a.tza", {"a": np.full(3, 1e5)}, half=False)
    np.testing.assert_array_equal(read_tza(tmp_path / "a.tza")["a"], np.float32(1e5))


def test_too_large_files_are_neither_written_nor_read(tmp_path):
    refuses("use a smaller network", write_tza, tmp_path / "a.tza", {"a": np.zeros(denoiser.MOST_BYTES // 2)})
    (tmp_path / "b.tza").write_bytes(bytes(denoiser.MOST_BYTES + 1))
    refuses("more than 8000000 bytes", read_tza, tmp_path / "b.tza")
