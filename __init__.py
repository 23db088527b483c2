"""GS-SMC: the exact camera of a photograph inside a 3D Gaussian Splatting scan.

Blender calls register() and unregister(). Nothing is imported here before that, so that this folder may lie on sys.path
of a plain Python, for which it is only the home of `core`.
"""


def register() -> None:
    from . import gssmc_addon

    gssmc_addon.register()


def unregister() -> None:
    from . import gssmc_addon

    gssmc_addon.unregister()
