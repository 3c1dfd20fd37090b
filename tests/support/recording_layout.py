"""A stand-in for UILayout that refuses what the real one would not draw.

Every call is checked against UILayout's own RNA: names of functions, arguments, icons, properties and operators.
"""

from typing import Any

import bpy

LAYOUT = bpy.types.UILayout.bl_rna
ICONS = set(LAYOUT.functions["label"].parameters["icon"].enum_items.keys())
CONTAINERS = {"row", "column", "split", "box", "column_flow", "grid_flow"}


class RecordingLayout:
    """Calls are kept in ``drawn`` as (function, arguments), what is set as ("set", it); containers share it."""

    def __init__(self, drawn: list[tuple[str, dict[str, Any]]] | None = None) -> None:
        self.__dict__["drawn"] = [] if drawn is None else drawn

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in LAYOUT.properties, f"UILayout has no property {name!r}"
        item = LAYOUT.properties[name]
        if item.type == "ENUM":
            assert value in item.enum_items, f"{name} cannot be {value!r}"
        self.drawn.append(("set", {name: value}))

    def __getattr__(self, name: str) -> Any:
        if name in LAYOUT.properties:
            return LAYOUT.properties[name].default
        assert name in LAYOUT.functions, f"UILayout has no function {name!r}"
        return lambda *arguments, **named: self._call(name, arguments, named)

    def _call(self, name: str, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        parameters = [item for item in LAYOUT.functions[name].parameters if not item.is_output]
        for argument, parameter in zip(arguments, parameters, strict=False):
            named[parameter.identifier] = argument
        names = {item.identifier for item in parameters}
        assert set(named) <= names, f"{name} has no arguments {set(named) - names}"
        missing = {item.identifier for item in parameters if item.is_required} - set(named)
        assert not missing, f"{name} needs {missing}"
        assert named.get("icon", "NONE") in ICONS, f"there is no icon {named['icon']!r}"
        for key in ("text", "heading"):
            assert isinstance(named.get(key, ""), str), f"{key} of {name} is {named[key]!r}"
        self.drawn.append((name, named))
        if name in CONTAINERS:
            return RecordingLayout(self.drawn)
        checks = {"prop": _check_property, "operator": _operator, "popover": lambda kw: getattr(bpy.types, kw["panel"])}
        return checks[name](named) if name in checks else None


class OperatorProperties:
    """What a button hands to its operator: only properties it has, of the right type."""

    def __init__(self, rna: bpy.types.Struct) -> None:
        self.__dict__["_rna"] = rna

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in self._rna.properties, f"{self._rna.identifier} has no property {name!r}"
        kind = {"STRING": str, "INT": int, "FLOAT": float, "BOOLEAN": bool}.get(self._rna.properties[name].type)
        assert kind is None or isinstance(value, kind)


def _check_property(named: dict[str, Any]) -> None:
    data, name = named["data"], named["property"]
    assert name in data.bl_rna.properties, f"{data.bl_rna.identifier} has no property {name!r}"
    getattr(data, name)


def _operator(named: dict[str, Any]) -> OperatorProperties:
    module, name = named["operator"].split(".")
    # KeyError if there is no such operator.
    return OperatorProperties(getattr(getattr(bpy.ops, module), name).get_rna_type())
