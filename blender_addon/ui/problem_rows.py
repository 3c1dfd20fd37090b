"""Rows of the scene check, in the panel and in the dialog before a render."""

from __future__ import annotations

import bpy

from ..check import last
from ..check.fixes import OPERATORS
from ..check.problem import MOST_ROWS
from .drawing import sentence

ICONS = {"ERROR": "CANCEL", "WARNING": "ERROR", "INFO": "INFO"}
MOST_NAMES = 8  # of an expanded row


def draw_problems(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the worst rows, and the others where the artist asks for them."""
    state = context.window_manager.lfsr
    rows = list(state.problems)
    for row in rows if state.all_problems else rows[:MOST_ROWS]:
        _draw(layout, row, context)
    if len(rows) > MOST_ROWS:
        text = "Fewer" if state.all_problems else f"{len(rows) - MOST_ROWS} More"
        icon = "DISCLOSURE_TRI_DOWN" if state.all_problems else "DISCLOSURE_TRI_RIGHT"
        layout.prop(state, "all_problems", text=text, icon=icon, emboss=False)


def _draw(layout: bpy.types.UILayout, row: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    box = layout.box().column()
    head = box.row(align=True)
    if row.count > 1:
        icon = "DISCLOSURE_TRI_DOWN" if row.expanded else "DISCLOSURE_TRI_RIGHT"
        head.prop(row, "expanded", text="", icon=icon, emboss=False)
    title = head.row()
    title.alert = row.severity == "ERROR"
    title.label(text=row.title, icon=ICONS[row.severity])
    if row.is_object:
        _select_button(head, row.code, row.target)
    sentence(box, row.reason, "NONE", context)
    if row.expanded:
        problems, column = last.problems(row.code), box.column(align=True)
        for problem in problems[:MOST_NAMES]:
            line = column.row(align=True)
            line.label(text=problem.target)
            if problem.is_object:
                _select_button(line, row.code, problem.target)
        if len(problems) > MOST_NAMES:
            column.label(text=f"and {len(problems) - MOST_NAMES:,} more")
    if row.fix and row.code in OPERATORS:
        name, settings = OPERATORS[row.code]
        asking = box.row()
        asking.operator_context = "INVOKE_DEFAULT"
        button = asking.operator(name, text=row.fix)
        for key, value in settings.items():
            setattr(button, key, value)
    elif row.fix:
        button = box.operator("lfsr.check_fix", text=row.fix)
        button.code, button.target = row.code, row.target


def _select_button(layout: bpy.types.UILayout, code: str, target: str) -> None:
    button = layout.operator("lfsr.check_select", text="", icon="RESTRICT_SELECT_OFF")
    button.code, button.target = code, target
