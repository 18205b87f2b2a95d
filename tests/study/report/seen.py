"""What can be seen in a figure, as numbers and words."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.lines import Line2D
from numpy.typing import NDArray


def across(line: Line2D) -> NDArray[Any]:
    """Where a line goes, from left to right."""
    return np.asarray(line.get_xdata())


def heights(line: Line2D) -> NDArray[Any]:
    """How high it is there."""
    return np.asarray(line.get_ydata())


def outline(filled: Collection) -> NDArray[Any]:
    """The corners of a filled area: [N, 2]."""
    return np.asarray(filled.get_paths()[0].vertices)


def named(axis: Axes) -> list[str]:
    """What a panel's legend names."""
    legend = axis.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.texts]
