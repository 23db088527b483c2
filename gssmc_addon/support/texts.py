"""Texts that are put together at run time, in the user's language.

Names, labels and descriptions of what is registered, and plain texts of a layout, Blender looks up by itself. A sentence with
values in it it cannot know: here its template is looked up, and filled in afterwards. The functions have the names by which
Blender's own extractor of messages finds templates in scripts. They belong to the main thread, but for `n_`, which only marks
a text that is looked up later.

The engine (core) knows no Blender and no language: its sentences are English wherever they show.
"""

from __future__ import annotations

from bpy.app import translations

from ...core.errors import GssmcError

n_ = translations.pgettext_n


def iface_(template: str, /, **values: object) -> str:
    """A text of a panel, dialog or status bar, its {names} filled with `values`."""
    return _filled(translations.pgettext_iface(template), template, values)


def rpt_(template: str, /, **values: object) -> str:
    """A sentence of a report or an error, its {names} filled with `values`."""
    return _filled(translations.pgettext_rpt(template), template, values)


def tip_(template: str, /, **values: object) -> str:
    """A tooltip that is made when it shows, its {names} filled with `values`."""
    return _filled(translations.pgettext_tip(template), template, values)


def sentence(error: Exception) -> str:
    """Why the work of a thread broke off, for the user: one sentence, which the thread itself could not look up."""
    if isinstance(error, GssmcError):
        return rpt_(str(error))
    if isinstance(error, MemoryError):
        return rpt_("There is not enough memory for this splat; close other files or use a smaller scan.")
    if isinstance(error, OSError) and error.strerror:
        values = {"reason": error.strerror, "file": error.filename or ""}
        named = rpt_("The work broke off, for '{file}' cannot be used ({reason}).", **values)
        return named if error.filename else rpt_("The work broke off ({reason}).", **values)
    return rpt_("The work broke off through a fault of the extension; the system console has the details.")


def _filled(found: str, template: str, values: dict[str, object]) -> str:
    if not values:
        return found
    try:
        return found.format(**values)
    except (LookupError, ValueError, TypeError, AttributeError):  # A mistake in a translation must not cost the user's work.
        return template.format(**values)
