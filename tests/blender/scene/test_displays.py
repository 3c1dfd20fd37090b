"""The menu of displays comes from the profiles alone."""

import shutil

from blender_addon.scene import settings
from lfsr_core.optics import display


def test_a_profile_added_to_the_folder_is_in_the_menu(tmp_path, monkeypatch):
    folder = shutil.copytree(display.PROFILE_FOLDER, tmp_path / "displays")
    for name, title in (("desk", 'title = "9″ Desk"\n'), ("untitled", "")):
        text = (folder / "mini.toml").read_text(encoding="utf-8").replace('name = "mini"', f'name = "{name}"')
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("title"))
        (folder / f"{name}.toml").write_text(title + text, encoding="utf-8")
    monkeypatch.setattr(display, "PROFILE_FOLDER", folder)
    items = settings.profile_items()
    titles = {item[0]: item[1] for item in items}
    assert (titles["desk"], titles["untitled"]) == ("9″ Desk", "untitled")
    order = [item[0] for item in items]
    assert order.index("mini") < order.index("desk") < order.index("small") and order[-1] == settings.PROFILE_FILE
    assert len({item[4] for item in items}) == len(items), "each has a number of its own, whatever else is in the menu"
