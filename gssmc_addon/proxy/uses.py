"""What a proxy is for; kept on the object as the word, and worn by Blender's own switches."""

from __future__ import annotations

USES = (
    ("SHADOW_CATCHER", "Shadow Catcher", "CG is hidden behind it and casts shadows on it; the rest of it shows the photo"),
    ("HOLDOUT", "Holdout", "CG is hidden behind it; it takes no shadows"),
    ("COLLISION", "Collision", "Things fall on it in simulations; it is not rendered"),
    ("SNAP", "Snap", "A surface to snap and model on in the viewport; it is not rendered"),
)
NONE = "NONE"  # of an object that is no proxy
ITEMS = ((NONE, "None", "The object is no proxy"), *USES)
