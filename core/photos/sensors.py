"""Sensor widths of common cameras, for photos whose EXIF has the real focal length but not the 35 mm equivalent.

Widths are the makers' published ones, or for phones pixel pitch times pixels; mm. Models are written as EXIF has them.
Phones with several lenses are left out unless their main one is meant: they state the equivalent themselves.
"""

from __future__ import annotations

import math

FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)

MODELS_BY_WIDTH_MM: dict[float, tuple[str, ...]] = {
    36.0: (
        "Canon EOS 5D Mark II",
        "Canon EOS 5D Mark III",
        "Canon EOS 5D Mark IV",
        "Canon EOS R",
        "Canon EOS R5",
        "Canon EOS-1D X",
    ),
    35.9: (
        "Canon EOS 6D Mark II",
        "Canon EOS R6",
        "NIKON D610",
        "NIKON D750",
        "NIKON D800",
        "NIKON D810",
        "NIKON D850",
        "NIKON Z 6",
        "NIKON Z 7",
        "ILCE-7RM2",
        "ILCE-7RM3",
    ),
    35.8: (
        "Canon EOS 6D",
        "ILCE-7",
        "ILCE-7M2",
    ),
    35.6: ("ILCE-7M3",),
    22.3: (
        "Canon EOS 550D",
        "Canon EOS 600D",
        "Canon EOS 650D",
        "Canon EOS 700D",
        "Canon EOS 7D",
        "Canon EOS 60D",
        "Canon EOS M50",
        "Canon EOS 1200D",
    ),
    22.5: (
        "Canon EOS 70D",
        "Canon EOS 80D",
    ),
    23.5: (
        "NIKON D3300",
        "NIKON D3400",
        "NIKON D3500",
        "NIKON D5300",
        "NIKON D5500",
        "NIKON D5600",
        "NIKON D7100",
        "NIKON D7200",
        "NIKON D7500",
        "NIKON D500",
        "ILCE-6000",
        "ILCE-6300",
        "ILCE-6400",
        "ILCE-6500",
        "X-T3",
        "X-T4",
    ),
    23.6: (
        "NIKON D90",
        "NIKON D7000",
        "X-T1",
        "X-T2",
        "X100F",
    ),
    17.3: (
        "E-M1",
        "E-M5MarkII",
        "E-M10",
        "DMC-GH4",
        "DC-GH5",
    ),
    13.2: (
        "DSC-RX100",
        "DSC-RX100M3",
        "FC6310",
        "L1D-20c",
    ),
    6.17: (
        "FC220",
        "FC300X",
        "FC330",
    ),
    4.57: (
        "iPhone 4S",
        "iPhone 5",
    ),
    4.9: (
        "iPhone 5s",
        "iPhone 6",
    ),
    4.92: (
        "iPhone 6s",
        "iPhone 7",
        "iPhone 8",
    ),
    5.95: ("SM-G900F",),
    5.65: (
        "SM-G930F",
        "Pixel 2",
    ),
    6.27: ("Pixel",),
}
WIDTH_MM = {model.lower(): width for width, models in MODELS_BY_WIDTH_MM.items() for model in models}


def focal_35mm_of(model: str, focal_mm: float, width: int, height: int) -> float | None:
    """The 35 mm equivalent (mm, over the diagonal) of a real focal length, for a photo of `width` x `height` pixels.

    The photo's long side is taken to span the sensor's width. None when the camera is not in the table.
    """
    sensor = WIDTH_MM.get(" ".join(model.split()).lower())
    if sensor is None:
        return None
    return focal_mm / sensor * max(width, height) / math.hypot(width, height) * FULL_FRAME_DIAGONAL_MM
