"""Parts of long renders: recognised when they are whole and of the same inputs, else removed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.frames.folder import FrameFolder
from lfsr_core.images.exr import write_layers
from lfsr_core.pipeline.parts import ImageParts, Part, gaps, remove_others
from lfsr_core.pipeline.staging import has_parts, staging_folder

INPUTS = {"settings": "abc", "scene file": "def"}


@pytest.fixture
def parts(tmp_path):
    return ImageParts(FrameFolder(tmp_path / "frame").parts, "lr_eia", INPUTS)


def put(parts, first, last, seconds=1.5):
    """Store rows ``first`` to ``last``."""
    written = parts.folder.with_name("band.exr")
    write_layers(written, {"color": np.full((last - first, 4, 4), float(first), np.float32)})
    return parts.store(written, Part(first, last, seconds))


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 9))), st.integers(1, 50))
def test_parts_and_gaps_are_the_image(ranges, count):
    kept = [Part(first, min(first + size, count)) for first, size in ranges if first < count]
    covered = {row for part in kept for row in range(part.first, part.last)}
    missing = [row for part in gaps(count, kept) for row in range(part.first, part.last)]
    assert missing == sorted(set(range(count)) - covered)


def test_stored_parts_come_back_with_their_seconds(parts):
    paths = [put(parts, 7, 9), put(parts, 0, 4, 0.25)]
    assert parts.stored(9) == [(Part(0, 4, 0.25), paths[1]), (Part(7, 9, 1.5), paths[0])]
    assert not parts.folder.with_name("band.exr").exists()


def test_parts_of_another_image_or_other_inputs_are_not_taken(parts):
    put(parts, 0, 4)
    put(parts, 4, 12)
    assert len(parts.stored(9)) == 1, "a part beyond the image is of another"
    assert dataclasses.replace(parts, name="reference_a").stored(9) == []
    assert dataclasses.replace(parts, inputs=INPUTS | {"settings": "x"}).stored(9) == []


def test_a_damaged_part_goes(parts):
    whole, damaged = put(parts, 0, 4), put(parts, 4, 9)
    damaged.write_bytes(damaged.read_bytes()[:-20])
    assert [path for _, path in parts.stored(9)] == [whole]
    assert not damaged.exists()


def test_other_inputs_remove_the_old_parts_and_say_what_is_other(parts):
    put(parts, 0, 4)
    assert remove_others(parts.folder, INPUTS) == ""
    assert len(parts.stored(9)) == 1
    sentence = remove_others(parts.folder, INPUTS | {"scene file": "new"})
    assert "other scene file:" in sentence and "starts from the beginning" in sentence
    assert not parts.folder.exists()
    assert remove_others(parts.folder, INPUTS) == ""


@pytest.mark.parametrize("content", ["", "[1]", "{\"settings\": [[]]}"])
def test_parts_without_readable_inputs_go(parts, content):
    put(parts, 0, 4)
    (parts.folder / "inputs.json").write_text(content)
    assert "starts from the beginning" in remove_others(parts.folder, INPUTS)
    assert not parts.folder.exists()


def test_it_is_told_where_parts_are_until_the_render_is_published(parts, tmp_path):
    assert not has_parts(parts.folder)
    put(parts, 0, 4)
    assert has_parts(parts.folder)
    with staging_folder(tmp_path / "frame") as staged:
        assert parts.folder.exists(), "a dead run's staging folder goes, parts stay"
        (staged / "frame").mkdir()
        FrameFolder(tmp_path / "frame").publish(staged / "frame")
    assert [path.name for path in tmp_path.iterdir()] == ["frame"]
