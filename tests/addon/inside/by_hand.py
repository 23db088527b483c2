"""The window's way of an operator, gone by hand: Blender in the background runs every operator blocking."""

import inspect
import types
from types import SimpleNamespace


class Manager:
    """The window manager, but that an operator which Blender did not make has no handler to be added."""

    def __init__(self, real):
        self._real, self.followed = real, 0

    def modal_handler_add(self, operator):
        self.followed += 1

    def __getattr__(self, name):
        return getattr(self._real, name)


class Context:
    """Blender's context with that window manager."""

    def __init__(self, bpy):
        self._real, self.window_manager = bpy.context, Manager(bpy.context.window_manager)

    def __getattr__(self, name):
        return getattr(self._real, name)


def operator(bpy, cls, **properties):
    """An operator of the class `cls` as it is before anything ran: its own code and that of its mixins, its properties as
    given, and `said`, the (level, message) of its reports.
    """
    cell = types.CellType()
    own = {name: value for name, value in vars(cls).items() if not name.startswith(("__", "bl_rna"))}
    body = {name: _moved(value, cell) if inspect.isfunction(value) else value for name, value in own.items()}
    bases = tuple(base for base in cls.__bases__ if not issubclass(base, bpy.types.Operator))
    cell.cell_contents = made = type("ByHand", bases, body)
    hand = made()
    hand.said = []
    hand.report = lambda level, message: hand.said.append((next(iter(level)), message))
    hand.properties = SimpleNamespace(is_property_set=lambda name: name in properties, model="", matcher_model="")
    vars(hand).update(properties)
    return hand


def _moved(function, cell):
    """The function, in which super() refers to the class in `cell`."""
    names, old = function.__code__.co_freevars, function.__closure__ or ()
    cells = tuple(cell if name == "__class__" else value for name, value in zip(names, old, strict=True))
    return types.FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__, cells)


def event(kind="TIMER", value="NOTHING"):
    return SimpleNamespace(type=kind, value=value)


def tick_to_end(hand, context, count=3000):
    """What the operator gives when its job has ended; the timer's ticks, waiting a little for its thread before each."""
    for _ in range(count):
        if hand._job:
            hand._job.join(0.01)
        result = hand.modal(context, event())
        if result != {"PASS_THROUGH"}:
            return result
    raise AssertionError("the job did not end")
