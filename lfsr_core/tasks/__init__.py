"""Tasks that the add-on starts in a process of its own."""

import os
import sys

from lfsr_core.process.child import BLENDER_FOLDER

if sys.platform == "win32" and (_folder := os.environ.get(BLENDER_FOLDER)):
    # Outside Blender its OpenImageIO finds Blender's libraries only where their folder is added.
    if os.path.isdir(os.path.join(_folder, "blender.shared")):
        os.add_dll_directory(os.path.join(_folder, "blender.shared"))
