"""Runs inside a windowed Blender: a script beside this file, in steps between which the window lives.

A script has what stands in NAMES as globals, and a generator steps() that yields the seconds to wait. Blender quits at its end;
the file result.txt then holds nothing, or what went wrong.
"""

import os
import subprocess
import sys
import time
import traceback

import bpy

HERE = os.environ["GSSMC_UI"]
FIRST_S = 1.0


def window():
    return bpy.context.window_manager.windows[0]


def view3d():
    """The 3D viewport: (window, area, region of the view, space, region of the sidebar)."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    regions = {region.type: region for region in area.regions}
    return window(), area, regions["WINDOW"], area.spaces.active, regions["UI"]


def sidebar(category):
    """Shows the sidebar's tab of that name."""
    _, _, _, space, region = view3d()
    space.show_region_ui = True
    region.active_panel_category = category


def move(x, y):
    """The mouse to a place in pixels of the window, from its lower left corner."""
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=int(x), y=int(y))


def press(key, x=None, y=None, **held):
    """A key, or mouse button, pressed and released; over the middle of the viewport unless a place is given."""
    _, _, region, _, _ = view3d()
    place = {
        "x": int(region.x + region.width / 2 if x is None else x),
        "y": int(region.y + region.height / 2 if y is None else y),
    }
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(type=key, value=value, **place, **held)


def click(x, y, button="LEFTMOUSE"):
    move(x, y)
    press(button, x, y)


def shot(name):
    """The screen as a PNG beside the script. The X server is asked: Blender's own screenshot is black under software OpenGL."""
    subprocess.run(["import", "-window", "root", os.path.join(HERE, name)], check=True)


class Steps:
    """A script's generator, driven by a timer; registered twice it still takes each step once, when its time has come."""

    def __init__(self, script):
        self._script, self._steps, self._due = script, None, time.monotonic()

    def tick(self):
        left = self._due - time.monotonic()
        if left > 0:
            return left
        try:
            if self._steps is None:
                self._steps = self._begin()
            pause = float(next(self._steps))
        except StopIteration:
            return self._end("")
        except BaseException:  # noqa: BLE001 - whatever it is, the run must end and say so
            return self._end(traceback.format_exc())
        self._due = time.monotonic() + pause
        return pause

    def _begin(self):
        path = os.path.join(HERE, self._script)
        names = {**NAMES, "tick": self.tick, "__file__": path, "__name__": "gssmc_window_script"}
        with open(path, encoding="utf-8") as file:
            exec(compile(file.read(), path, "exec"), names)
        return names["steps"]()

    def _end(self, error):
        sys.stdout.flush()
        if error:
            shot("failed.png")
        with open(os.path.join(HERE, "result.txt"), "w", encoding="utf-8") as file:
            file.write(error)
        bpy.ops.wm.quit_blender()


NAMES = {f.__name__: f for f in (view3d, sidebar, move, press, click, shot)}

bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(Steps(sys.argv[-1]).tick, first_interval=FIRST_S, persistent=True)
