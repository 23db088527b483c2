"""A layout that writes down what a panel draws."""

from types import SimpleNamespace


class Layout:
    """`said`: texts of labels and progress bars, names of operators and properties, in order."""

    def __init__(self):
        self.said = []

    def label(self, text="", icon="NONE", translate=True, icon_value=0):
        self.said.append(text)

    def progress(self, factor=0.0, text=""):
        self.said.append(text)

    def operator(self, name, **_):
        self.said.append(name)
        return SimpleNamespace()

    def operator_menu_enum(self, name, _property, text="", **_):
        self.said.append(text)

    def prop(self, owner, name, **_):
        assert hasattr(owner, name)
        self.said.append(name)

    def prop_enum(self, owner, name, value, **_):
        assert value in owner.bl_rna.properties[name].enum_items
        self.said.append(value)

    def template_list(self, *_, **__):
        pass

    def separator(self):
        pass

    def column(self, **_):
        return self

    row = box = column


def drawn(bpy, extension, width=2000):
    """What the main panel says in a sidebar of this width, wide by default."""
    layout, context = Layout(), bpy.context
    seen = SimpleNamespace(
        scene=context.scene,
        window_manager=context.window_manager,
        space_data=SimpleNamespace(lock_camera=False),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1)),
        region=SimpleNamespace(width=width),
    )
    extension("gssmc_addon.refine.panel").GSSMC_PT_main.draw(SimpleNamespace(layout=layout), seen)
    return layout.said
