"""References read from their folders, and what they may be compared with."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import REFERENCE_FILES, write_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.color import srgb_encode
from lfsr_core.optics.display import load_display
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.optics.rays import CameraArray
from tests.support.synthetic import MINI, frame_of, light_field, write_reference
from tests.support.told import refuses

LISTED = tuple((row, column) for row in range(1, 9) for column in (2, 7, 8))[:23]


def test_a_whole_reference_holds_every_lens(tmp_path):
    reference = Reference.read(write_reference(tmp_path, noise=1e-6))
    sx, sy = reference.frame.display.lenses
    field = light_field()
    assert reference.folder == tmp_path and reference.lens_list is None
    np.testing.assert_allclose(reference.half_a, field[..., :3], atol=1e-4)
    np.testing.assert_allclose(reference.half_b, field[..., :3], atol=1e-4)
    assert reference.lenses.tolist() == [[row, column] for row in range(sy) for column in range(sx)]
    hits = to_elemental_images(field[..., 3:], (sx, sy)).any((2, 3, 4))
    assert 0 < hits.sum() < hits.size and np.array_equal(reference.hits, hits)
    assert np.array_equal(reference.foreground.reshape(sy, sx), hits)
    other = np.zeros_like(hits)
    assert reference.foreground_mask(other) is reference.hits


def test_a_reference_of_listed_lenses_holds_those_without_spare_tiles(tmp_path):
    listed = Reference.read(write_reference(tmp_path / "listed", noise=1e-6, lens_list=LISTED))
    whole = Reference.read(write_reference(tmp_path / "whole", noise=1e-6))
    places = [row * whole.hits.shape[1] + column for row, column in LISTED]
    assert listed.lens_list == LISTED and listed.lenses.tolist() == [list(lens) for lens in LISTED]
    assert listed.hits.size > len(LISTED)  # a square of tiles
    assert np.array_equal(listed.foreground, whole.foreground[places])
    for ours, theirs in zip(listed.linear_images(), whole.linear_images(), strict=True):
        np.testing.assert_allclose(ours, theirs[places], atol=1e-4)
    assert np.array_equal(listed.elemental_images()[0], srgb_encode(listed.linear_images()[0]))
    mask = np.zeros((3, 3), bool)
    assert listed.foreground_mask(mask) is mask


def test_halves_stay_apart(tmp_path):
    reference = Reference.read(write_reference(tmp_path, noise=0.1))
    assert not np.array_equal(reference.half_a, reference.half_b)


def test_a_reference_that_is_not_whole_or_has_one_image_twice_is_refused(tmp_path):
    folder = write_reference(tmp_path)
    write_frame(folder, frame_of(1, lens_list=LISTED))
    refuses("but frame.json says", Reference.read, folder)
    write_frame(folder, frame_of(1))
    first, second = (folder / name for name in REFERENCE_FILES)
    second.write_bytes(first.read_bytes())
    refuses("both halves in .* are the same image", Reference.read, folder)
    second.unlink()
    refuses(REFERENCE_FILES[1], Reference.read, folder)


REFERENCE = frame_of(1)
SHIFTED = tuple(tuple(value + 0.3 * (column == 3) for column, value in enumerate(row))
                for row in REFERENCE.matrix_world[:3]) + REFERENCE.matrix_world[3:]


def test_matching_references_pass_and_others_are_refused():
    nudged = tuple(tuple(value + 1e-7 for value in row) for row in REFERENCE.matrix_world)
    check_reference(frame_of(4), dataclasses.replace(REFERENCE, matrix_world=nudged, samples=512, seed=9))
    check_reference(frame_of(4), dataclasses.replace(REFERENCE, lens_list=((0, 0), (3, 4))))
    with pytest.raises(LfsrError, match="with light own, but the frame with light city"):
        check_reference(frame_of(4, light="city"), frame_of(1, light="own"))
    check_reference(frame_of(4, light="city"), frame_of(1))
    check_reference(frame_of(4), frame_of(1, light="own"))
    refuses("other lenses", check_reference, frame_of(4, lens_list=((0, 0),)), frame_of(1, lens_list=((0, 1),)))
    for changes, message in [
        ({"scale": 2}, "has scale 2"),
        ({"display": dataclasses.replace(load_display("mini"), name="other")}, "display other"),
        ({"frame": 7}, "frame number 7"),
        ({"world_visible": True}, "with visible world, but the frame with no visible world"),
        ({"array": dataclasses.replace(REFERENCE.array, distance=9.0)}, "cameras"),
        ({"array": dataclasses.replace(REFERENCE.array, spacing=REFERENCE.array.spacing * 1.01)}, "cameras"),
        ({"matrix_world": SHIFTED}, "cameras")]:
        refuses(message, check_reference, frame_of(4), dataclasses.replace(REFERENCE, **changes))


def test_reference_of_another_place_or_scene_is_told_in_words():
    frame = dataclasses.replace(frame_of(2), scene="one.blend")
    nearer = dataclasses.replace(frame_of(1), scene="one.blend", array=CameraArray.for_display(MINI, 0.8))
    refuses(r"its display plane is [\d.]+ from the cameras, the frame's [\d.]+\. ", check_reference, frame, nearer)
    with pytest.raises(LfsrError, match=r"shows another scene, two\.glb, but the frame one\.blend"):
        check_reference(frame, dataclasses.replace(nearer, scene="two.glb"))
    matrix = ((1.0, 0.0, 0.0, 0.5), *frame.matrix_world[1:])
    with pytest.raises(LfsrError, match="stand or face elsewhere"):
        check_reference(frame, dataclasses.replace(frame_of(1), scene="one.blend", matrix_world=matrix))
