"""Few values that stand for many: codebooks of 256 numbers, and palettes of up to 65536 vectors (k-means)."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from ..scene import Float32Array

Bytes = NDArray[np.uint8]

ENTRIES = 256
ITERATIONS, BINS = 30, 128
# A codebook is found from so many of the numbers, spread over all.
SAMPLE = 1 << 20
LARGEST_PALETTE = 1 << 16
# So many vectors begin the palette, as the centres of groups that have a share of it each.
GROUPS, GROUP_SAMPLE = 256, 1 << 15
GROUP_ITERATIONS = 8


def codebook(values: Float32Array) -> tuple[Float32Array, Bytes]:
    """256 ascending numbers, and for each of `values` (any shape) the index of the nearest one. All of them finite.

    Lloyd's algorithm in one dimension: on sorted numbers a cell's mean is a difference of running sums. It starts with entries
    as dense as the cube root of the numbers' density, which is best where there are many of both (Panter and Dite, 1951).
    """
    flat = values.ravel()
    ordered = np.sort(flat[:: max(1, len(flat) // SAMPLE)]).astype(np.float64)
    sums = np.concatenate([[0.0], np.cumsum(ordered)])
    density, edges = np.histogram(ordered, BINS)
    wanted = np.concatenate([[0.0], np.cumsum(np.cbrt(density))])
    book = np.interp((np.arange(ENTRIES) + 0.5) / ENTRIES * wanted[-1], wanted, edges)
    # The ends are kept, so that no number is far from all entries.
    book[0], book[-1] = flat.min(), flat.max()
    for _ in range(ITERATIONS):
        ends = np.concatenate([[0], np.searchsorted(ordered, (book[1:] + book[:-1]) / 2), [len(ordered)]])
        counts = np.diff(ends)
        means = (sums[ends[1:]] - sums[ends[:-1]]) / np.maximum(counts, 1)
        book[1:-1] = np.where(counts > 0, means, book)[1:-1]
        book.sort()
    found: Float32Array = book.astype(np.float32)
    nearest = np.searchsorted((found[1:] + found[:-1]) / 2, flat)
    return found, nearest.astype(np.uint8).reshape(values.shape)


def palette(vectors: Float32Array) -> tuple[Float32Array, NDArray[np.uint16]]:
    """At most 65536 vectors (entries, D), and for each of `vectors` (N, D) the number of the one that stands for it (N,).

    As many as there are vectors where that is few enough. Else k-means twice: all vectors are put into groups, and each group
    has a share of the palette by its size, because one k-means over all entries would take hours.
    """
    if len(vectors) <= LARGEST_PALETTE:
        return vectors, np.arange(len(vectors), dtype=np.uint16)
    sample = vectors[:: max(1, len(vectors) // GROUP_SAMPLE)]
    centres = _centres(sample, sample[np.linspace(0, len(sample) - 1, GROUPS).astype(np.intp)], GROUP_ITERATIONS)
    group = _nearest(vectors, centres)
    entries: list[Float32Array] = []
    labels = np.zeros(len(vectors), np.uint16)
    filled = 0
    for number in range(GROUPS):
        own = np.flatnonzero(group == number)
        if len(own) == 0:
            continue
        found, label = _share(vectors[own], max(1, len(own) * (LARGEST_PALETTE - GROUPS) // len(vectors)))
        entries.append(found)
        labels[own] = label + filled
        filled += len(found)
    return np.concatenate(entries), labels


def _share(vectors: Float32Array, count: int) -> tuple[Float32Array, NDArray[np.intp]]:
    """`count` vectors for those of one group, and which of them each has."""
    if count >= len(vectors):
        return vectors, np.arange(len(vectors))
    start = vectors[np.linspace(0, len(vectors) - 1, count).astype(np.intp)]
    found = _centres(vectors, start, 1)
    return found, _nearest(vectors, found)


def _nearest(vectors: Float32Array, centres: Float32Array) -> NDArray[np.intp]:
    """Which of the centres (M, D) is nearest to each of the vectors (N, D)."""
    # SciPy's part is imported here, because every command imports this module and only a conversion makes palettes.
    from scipy.cluster.vq import vq

    return np.asarray(vq(vectors, centres)[0], np.intp)


def _centres(vectors: Float32Array, start: Float32Array, iterations: int) -> Float32Array:
    """K-means from `start`. A centre that nothing is nearest to stays where it is, of which SciPy warns."""
    from scipy.cluster.vq import kmeans2

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found, _ = kmeans2(vectors, start, iter=iterations, minit="matrix")
    return np.asarray(found, np.float32)
