"""Displays as Bridge reports them: a plain monitor and units whose calibrations are known."""

from tests.calibration.test_visual_json import CELLS, NEW, OLD
from tests.support.bridge import device

MONITOR = device(0, "", "thirdparty", None)
PORTRAIT = device(1, "LKG-P1", "portrait", OLD, {"quiltX": 3360, "quiltY": 3360, "tileX": 8, "tileY": 6,
                                                 "quiltAspect": 0.75})
GEN3 = device(2, "LKG-J2", "16_gen3_landscape", NEW | {"CellPatternMode": 2, "subpixelCells": CELLS},
              {"quiltX": 7680, "quiltY": 4320, "tileX": 8, "tileY": 6, "quiltAspect": 1.77777})
DEVICES = [MONITOR, PORTRAIT, GEN3]
