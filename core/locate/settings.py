"""Options of the map and of the search in it."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..errors import RefineError


@dataclass(frozen=True)
class MapSettings:
    """Every option of the making of a map. Each field's metadata holds its help, range and unit.

    Raises RefineError when a number is outside its range.
    """

    views: int = field(default=80, metadata={"help": "views of the whole map, known cameras included", "range": (1, 2000)})
    side_px: int = field(default=400, metadata={"help": "side of a view's square render", "range": (128, 2048), "unit": "px"})
    seed: int = field(default=0, metadata={"help": "of all draws; the same seed gives the same map", "range": (0, 2**31)})
    threads: int = field(default=1, metadata={"help": "threads that draw a view, 0 = all cores", "range": (0, 256)})

    def __post_init__(self) -> None:
        for name, option in self.__dataclass_fields__.items():
            low, high = option.metadata["range"]
            value = getattr(self, name)
            if not low <= value <= high:
                raise RefineError(f"The option {name} is {value}; give a value from {low:g} to {high:g}.")
