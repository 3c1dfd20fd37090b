"""EXR and PNG files: lossless, whole, and refused where they are damaged."""

import itertools
import os
import re
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.images import image_files
from tests.support.small_disk import on_a_small_disk
from tests.support.told import refuses

OPEN = Path("/proc/self/fd")
RANDOM = np.random.default_rng(0)


def some_layers(height=6, width=9):
    channels = {"color": 4, "albedo": 3, "normal": 3, "position": 3, "index": 1, "environment": 3}
    return {name: RANDOM.normal(size=(height, width, count)).astype(np.float32) for name, count in channels.items()}


def write_exr(path, parts):
    """parts: list of (channel names, pixels) -> a multi-part file like Blender 5's."""
    specs = []
    for names, pixels in parts:
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], len(names), "float")
        spec.channelnames = names
        spec.full_height, spec.full_width = parts[0][1].shape[:2]  # which all parts share
        specs.append(spec)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), specs) if len(specs) > 1 else output.open(str(path), specs[0])
    for index, (_, pixels) in enumerate(parts):
        if index:
            assert output.open(str(path), specs[index], "AppendSubimage")
        assert output.write_image(pixels)
    assert output.close()


def test_layers_come_back_as_written_half_floats_near_and_colour_without_alpha_opaque(tmp_path):
    layers = some_layers()
    image_files.write_layers(tmp_path / "a.exr", layers)
    back = image_files.read_layers(tmp_path / "a.exr")
    assert back.keys() == layers.keys()
    for name, pixels in layers.items():
        np.testing.assert_array_equal(back[name], pixels, err_msg=name)
    image_files.write_layers(tmp_path / "a.exr", {"color": np.array([[[0.1, 1e6, -2.0, 1.0]]], np.float32)}, half=True)
    np.testing.assert_allclose(image_files.read_layers(tmp_path / "a.exr")["color"], [[[0.1, 65504, -2, 1]]], rtol=1e-3)
    image_files.write_layers(tmp_path / "a.exr", {"color": np.full((2, 3, 3), 0.5, np.float32)})
    assert image_files.read_layers(tmp_path / "a.exr")["color"].shape == (2, 3, 4)
    assert (image_files.read_layers(tmp_path / "a.exr")["color"][..., 3] == 1).all()


def test_reads_the_names_of_blender_4_and_the_parts_of_5(tmp_path):
    names = ["Combined.R", "Combined.G", "Combined.B", "Combined.A", "Denoising Albedo.R", "Denoising Albedo.G",
             "Denoising Albedo.B", "Denoising Depth.Z", "Denoising Normal.X", "Denoising Normal.Y",
             "Denoising Normal.Z", "Env.R", "Env.G", "Env.B", "IndexOB.X", "Position.X", "Position.Y", "Position.Z"]
    pixels = RANDOM.normal(size=(4, 5, len(names))).astype(np.float32)
    write_exr(tmp_path / "a.exr", [([f"ViewLayer.{name}" for name in names], pixels)])
    layers = image_files.read_layers(tmp_path / "a.exr")
    expected = {"color": slice(0, 4), "albedo": slice(4, 7), "path": slice(7, 8), "normal": slice(8, 11),
                "environment": slice(11, 14), "index": slice(14, 15), "position": slice(15, 18)}
    assert layers.keys() == expected.keys()
    for name, columns in expected.items():
        np.testing.assert_array_equal(layers[name], pixels[..., columns], err_msg=name)
    layers = some_layers()
    parts = [([f"ViewLayer.Combined.{c}" for c in "RGBA"], layers["color"]),
             (["ViewLayer.Depth.Z"], layers["index"] + 9), (["ViewLayer.Object Index.X"], layers["index"]),
             ([f"ViewLayer.Denoising Normal.{c}" for c in "XYZ"], layers["normal"])]
    write_exr(tmp_path / "a.exr", parts)
    back = image_files.read_layers(tmp_path / "a.exr")
    assert back.keys() == {"color", "index", "normal"}
    assert image_files.read_layers(tmp_path / "a.exr", without=("normal",)).keys() == {"color", "index"}
    for name, pixels in back.items():
        np.testing.assert_array_equal(pixels, layers[name], err_msg=name)


def test_missing_and_unreadable_files_and_layers(tmp_path):
    refuses("does not exist", image_files.read_layers, tmp_path / "none.exr")
    image_files.write_layers(tmp_path / "a.exr", {"albedo": np.zeros((2, 2, 3), np.float32)})
    refuses("no colour layer", image_files.read_layers, tmp_path / "a.exr")
    write_exr(tmp_path / "a.exr", [([*"RGBA", "normal.X", "normal.Z"], np.ones((2, 3, 6), np.float32))])
    refuses("its layer normal has the channels X, Z instead of X, Y, Z", image_files.read_layers, tmp_path / "a.exr")
    image_files.write_layers(tmp_path / "a.exr", some_layers())
    (tmp_path / "a.exr").write_bytes((tmp_path / "a.exr").read_bytes().replace(b"albedo", b"alb\xff\xfeo"))
    refuses("cannot be read", image_files.read_layers, tmp_path / "a.exr")
    (tmp_path / "a.png").write_bytes(b"not an image")
    refuses("not a readable", image_files.read_png, tmp_path / "a.png")
    refuses("does not exist, expected a PNG image", image_files.read_mask, tmp_path / "b.png")
    for width, height in [(60_000, 60_000), (2**31 - 1, 1), (70_000, 6), (9, 2**30)]:
        image_files.write_layers(tmp_path / "a.exr", some_layers())
        data = (tmp_path / "a.exr").read_bytes()
        for name in (b"dataWindow", b"displayWindow"):
            at = data.index(name + b"\0box2i\0") + len(name) + 7 + 4
            data = data[:at] + struct.pack("<4i", 0, 0, width - 1, height - 1) + data[at + 16:]
        (tmp_path / "a.exr").write_bytes(data)
        refuses("cannot be read", image_files.read_layers, tmp_path / "a.exr")
    for keep in [0, 50, 0.5, 0.95]:
        image_files.write_layers(tmp_path / "a.exr", some_layers(200, 200))
        data = (tmp_path / "a.exr").read_bytes()
        (tmp_path / "a.exr").write_bytes(data[:keep if isinstance(keep, int) else int(keep * len(data))])
        refuses(r"a\.exr cannot be read .*render it again", image_files.read_layers, tmp_path / "a.exr")
    for names, named in [("GBA", "A, B, G"), ("XYZ", "X, Y, Z"), ("abcd", "a, b, c, d"), ("RGA", "A, G, R"),
                         ("RGBQ", "B, G, Q, R"), ("R", "R")]:
        write_exr(tmp_path / "a.exr", [(list(names), np.ones((2, 3, len(names)), np.float32))])
        refuses(f"layer color has the channels {named} instead of R, G, B", image_files.read_layers, tmp_path / "a.exr")
    for names, shape in [
        (["ViewLayer.Denoising Albedo.R", "ViewLayer.Denoising Albedo.G", "ViewLayer.Denoising Albedo.B"], (2, 9, 3)),
        (["ViewLayer.Denoising Normal.X", "ViewLayer.Denoising Normal.Y"], (6, 9, 2))]:
        write_exr(tmp_path / "a.exr", [([f"ViewLayer.Combined.{c}" for c in "RGBA"], some_layers()["color"]),
                                       (names, np.zeros(shape, np.float32))])
        refuses("its layer (albedo has 9×|normal has the channels X, Y instead)", image_files.read_layers,
                tmp_path / "a.exr")
    for other in [{"color": (2, 6, 4)}, {"color": (2, 5, 4), "index": (2, 5, 1)}]:
        image_files.write_layers(tmp_path / "a.exr", {"color": np.zeros((2, 5, 4), np.float32)})
        zeros = {name: np.zeros(shape, np.float32) for name, shape in other.items()}
        image_files.write_layers(tmp_path / "b.exr", zeros)
        with pytest.raises(LfsrError, match="b.exr cannot be read .*other layers or another width"):
            image_files.join_rows([tmp_path / "a.exr", tmp_path / "b.exr"], tmp_path / "joined.exr")
        assert not (tmp_path / "joined.exr").exists()


@pytest.mark.parametrize(("before", "after"), [
    (b"A\0\2\0\0\0", b"a\0\2\0\0\0"), (b"A\0\2\0\0\0", b"b\0\2\0\0\0"), (b"G\0\2\0\0\0", b"g\0\2\0\0\0"),
    (b"R\0\2\0\0\0", b"R\0\0\0\0\0"), (b"compression\0\1\0\0\0\3", b"compression\0\1\0\0\0\5")])
def test_a_damaged_header_never_changes_the_picture_without_a_word(tmp_path, before, after):
    image_files.write_layers(tmp_path / "a.exr", {"color": some_layers(48, 64)["color"]})
    data = (tmp_path / "a.exr").read_bytes()
    assert data.count(before) == 1
    (tmp_path / "a.exr").write_bytes(data.replace(before, after))
    refuses(r"a\.exr cannot be read .*(instead of|expected one without loss)", image_files.read_layers,
            tmp_path / "a.exr")


@pytest.mark.parametrize(("broken", "value", "said"), [(1, np.nan, 0), (2, np.inf, 1), (50, -np.inf, 1)])
def test_many_pixels_that_are_not_finite_are_said_and_more_than_half_refused(tmp_path, broken, value, said):
    path, color = tmp_path / "a.exr", np.ones((10, 10, 4), np.float32)
    color.reshape(-1, 4)[:51, 1] = value
    image_files.write_layers(path, {"color": color})
    refuses(r"a\.exr has 51 of 100 pixels that are not finite.*render it again", image_files.read_finite, path)
    color.reshape(-1, 4)[broken:, 1] = 1
    image_files.write_layers(path, {"color": color})
    layers, replaced = image_files.read_finite(path)
    assert replaced == broken and np.isfinite(layers["color"]).all()
    expected = [Notice("pixels-replaced", {"replaced": broken, "pixels": 100})] * said
    assert image_files.replaced_notices(replaced, 100) == expected


def test_clean_counts_pixels_not_values_and_keeps_the_rest():
    layers = {"color": np.ones((3, 4, 4), np.float32), "normal": np.ones((3, 4, 3), np.float32)}
    layers["color"][0, 0, :2] = np.nan
    layers["color"][1, 1, 3] = np.inf
    layers["normal"][0, 0] = -np.inf
    layers["normal"][2, 3, 2] = np.nan
    cleaned, count = image_files.clean(layers)
    assert count == 3 and all(np.isfinite(pixels).all() for pixels in cleaned.values())
    np.testing.assert_array_equal(cleaned["color"][0, 0], [0, 0, 1, 1])
    assert np.isnan(layers["color"][0, 0, 0]), "the input stays as it was"
    assert image_files.clean({"color": np.array([[[np.inf, -np.inf, 0, 1]]], np.float32)})[1] == 1


def test_png_whose_size_lies_a_pipe_and_black_images_that_compress_strongly(tmp_path):
    image_files.write_mask(tmp_path / "m.png", np.zeros((8, 8), bool))
    data = (tmp_path / "m.png").read_bytes()
    header = data[:16] + struct.pack(">II", 60_000, 60_000) + data[24:29]
    (tmp_path / "m.png").write_bytes(header + struct.pack(">I", zlib.crc32(header[12:])) + data[33:])
    refuses("not a readable", image_files.read_mask, tmp_path / "m.png")
    os.mkfifo(tmp_path / "pipe")
    for read in (image_files.read_mask, image_files.read_layers, image_files.size, image_files.check_complete):
        refuses("not a regular file", read, tmp_path / "pipe")
    image_files.write_layers(tmp_path / "a.exr", {"color": np.zeros((3000, 4000, 4), np.float32)}, half=True)
    assert not image_files.read_layers(tmp_path / "a.exr")["color"].any()


WRITE = """import numpy as np
from lfsr_core.images import image_files
noise = np.random.default_rng(0).random((400, 400, 3))
if sys.argv[2].endswith(".png"):
    image_files.write_png(sys.argv[2], (noise * 255).astype(np.uint8))
else:
    image_files.write_layers(sys.argv[2], {"color": noise.astype(np.float32)})"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_full_disk_leaves_no_half_written_file(tmp_path, name):
    path = tmp_path / name
    assert on_a_small_disk(10**9, WRITE, path) == ""
    size = path.stat().st_size
    path.unlink()
    for most in (20_000, size - 1000, size - 1):
        said = on_a_small_disk(most, WRITE, path)
        assert re.search(rf"{name} (cannot be written|was not written completely) .*free some space", said), said
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("half", [False, True])
def test_rows_joined_are_the_image(tmp_path, half):
    random = np.random.default_rng(4)
    layers = {"color": random.random((37, 5, 4), np.float32), "index": random.random((37, 5, 1), np.float32)}
    image_files.write_layers(tmp_path / "whole.exr", layers, half)
    cuts, paths = (0, 1, 17, 20, 37), []
    for first, last in itertools.pairwise(cuts):
        paths.append(tmp_path / f"{first}.exr")
        image_files.write_layers(paths[-1], {name: pixels[first:last] for name, pixels in layers.items()}, half)
    image_files.join_rows(paths, tmp_path / "joined.exr", half)
    assert (tmp_path / "joined.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()


@pytest.mark.skipif(not OPEN.is_dir(), reason="looks into /proc")
@pytest.mark.parametrize("read", [image_files.check_complete, image_files.read_layers, image_files.size])
def test_no_file_stays_open_while_its_error_is_handled(tmp_path, read):
    """Windows removes and replaces no open file."""
    path = tmp_path / "a.exr"
    image_files.write_layers(path, some_layers())
    os.truncate(path, path.stat().st_size - 100)
    try:
        read(path)
    except LfsrError:
        assert str(path) not in {os.path.realpath(file) for file in OPEN.iterdir()}
    assert str(path) not in {os.path.realpath(file) for file in OPEN.iterdir()}


@pytest.mark.parametrize("shape", [(1, 1, 3), (63, 5, 3), (64, 7, 3), (65, 6, 3), (200, 33, 3), (54, 96)])
def test_png_is_lossless_and_readable_by_another_library(tmp_path, shape):
    pixels = RANDOM.integers(0, 256, shape, dtype=np.uint8)
    image_files.write_png(tmp_path / "a.png", pixels)
    with Image.open(tmp_path / "a.png") as image:
        image.verify()  # checks every chunk's checksum
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)
    if len(shape) == 3:
        np.testing.assert_array_equal(image_files.read_png(tmp_path / "a.png"), pixels)


def test_masks_flat_images_and_the_checksum_of_a_png(tmp_path):
    mask = RANDOM.random((54, 96)) > 0.5
    image_files.write_mask(tmp_path / "m.png", mask)
    np.testing.assert_array_equal(image_files.read_mask(tmp_path / "m.png", (96, 54)), mask)
    refuses("has 96×54 pixels, but the display has 54×96 lenses", image_files.read_mask, tmp_path / "m.png", (54, 96))
    for wrong in (np.zeros((4, 4, 4), np.uint8), np.full((4, 4, 3), 300, np.uint16), np.zeros((4, 4))):
        refuses("convert them", image_files.encode_png, wrong)
    assert sum(len(part) for part in image_files.encode_png(np.full((1000, 1000, 3), 77, np.uint8))) < 60_000
    parts = image_files.encode_png(RANDOM.integers(0, 256, (300, 21, 3), dtype=np.uint8))
    stream = b"".join(part[8:-4] for part in parts if part[4:8] == b"IDAT")
    assert len(zlib.decompress(stream)) == 300 * (21 * 3 + 1)  # raises where the checksum is wrong
