"""Materials whose outline is drawn by alpha: leaves, petals, torn paper."""

from __future__ import annotations

import bpy
import numpy as np

from lfsr_lab.scenes.shared.graph import principled
from lfsr_lab.scenes.training.materials import photo, random_color
from lfsr_lab.scenes.training.stage import Stage

LEAF_PIXELS = 64


def leaf_material(stage: Stage) -> bpy.types.Material:
    """Translucent leaf drawn on the whole texture square, its outline in the alpha channel."""
    material, graph, shader = principled("leaf")
    uv = graph.node("ShaderNodeTexCoord").outputs["UV"]
    texture = graph.node("ShaderNodeTexImage", {"Vector": uv}, image=_leaf_image(stage))
    color, alpha = texture.outputs["Color"], texture.outputs["Alpha"]
    graph.set(shader, {"Base Color": color, "Alpha": alpha, "Roughness": float(stage.rng.uniform(0.3, 0.9))})
    # Light passes through the sheet where it is not cut away.
    amount = graph.node("ShaderNodeMath", {0: alpha, 1: float(stage.rng.uniform(0, 0.5))}, operation="MULTIPLY")
    through = graph.node("ShaderNodeBsdfTranslucent", {"Color": color})
    mix = graph.node("ShaderNodeMixShader", {0: amount.outputs[0], 1: shader.outputs[0], 2: through.outputs[0]})
    graph.feed(graph.only("OUTPUT_MATERIAL").inputs["Surface"], mix.outputs[0])
    stage.note("material", kind="leaf")
    return material


def _leaf_image(stage: Stage) -> bpy.types.Image:
    """Outline with lobes, veins and blotches, RGBA."""
    rng = stage.rng
    x, y = np.meshgrid(*[np.linspace(-1, 1, LEAF_PIXELS)] * 2)
    angle, reach = np.arctan2(x, -y), np.hypot(x / rng.uniform(0.45, 0.95), y)
    lobes = 0.8 + rng.uniform(0, 0.35) * np.cos(rng.integers(3, 9) * angle)
    veins = np.abs(np.sin(rng.uniform(5, 12) * (y + rng.uniform(0.3, 1) * np.abs(x)))) < 0.15
    first, second = (np.array(random_color(stage, 0.1, 0.7)[:3]) for _ in range(2))
    blend = np.clip(0.5 + 0.5 * np.sin(7 * x + rng.uniform(0, 6)) * np.cos(6 * y), 0, 1)[..., None]
    color = np.where((veins | (np.abs(x) < 0.04))[..., None], 0.6 * second, first * blend + second * (1 - blend))
    pixels = np.concatenate([color, (reach < lobes)[..., None]], -1).astype(np.float32)
    image = bpy.data.images.new("leaf", LEAF_PIXELS, LEAF_PIXELS, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def paper_material(stage: Stage, cut: bool) -> bpy.types.Material:
    """A photograph (or plain paper) on a sheet; ``cut`` tears holes into it."""
    material, graph, shader = principled("paper")
    uv, rng = graph.node("ShaderNodeTexCoord").outputs["UV"], stage.rng
    zoom = stage.log_uniform(0.2, 2)
    spot = graph.node("ShaderNodeMapping", {"Vector": uv, "Scale": (zoom,) * 3,
                                            "Location": tuple(rng.uniform(0, 1, 3))}).outputs["Vector"]
    color = photo(stage, graph, spot, box=False).outputs["Color"] if stage.textures else random_color(stage)
    graph.set(shader, {"Base Color": color, "Roughness": float(rng.uniform(0.2, 1))})
    if cut:
        noise = graph.node("ShaderNodeTexNoise", {"Vector": spot, "Scale": stage.log_uniform(2, 20) / zoom})
        hole = graph.node("ShaderNodeMath", {0: noise.outputs[0], 1: float(rng.uniform(0.4, 0.55))},
                          operation="GREATER_THAN")
        graph.feed(shader.inputs["Alpha"], hole.outputs[0])
    stage.note("material", kind="paper", cut=cut)
    return material
