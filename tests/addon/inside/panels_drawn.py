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

    def separator(self):
        pass

    def column(self, **_):
        return self

    row = box = column
