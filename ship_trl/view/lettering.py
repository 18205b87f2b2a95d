"""Colours and letters of the pictures that carry text."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib
from PIL import ImageFont

PAPER = (15, 22, 34)
INK = (232, 238, 245)
FAINT = (140, 156, 178)
RULE = (52, 66, 88)
BAR = (88, 116, 158)
CHOSEN = (245, 178, 66)
OUTCOMES = {"goal": (74, 214, 110), "collision": (255, 98, 88), "timeout": (245, 178, 66)}


@cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans in `size` pixels. It comes with matplotlib, so every machine has the same."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


def fit(text: str, width: int, size: int, bold: bool = False) -> tuple[str, ImageFont.FreeTypeFont]:
    """Fit a text into `width` pixels: set up to 4 px smaller, then cut short; returns it and its font."""
    for smaller in range(size, size - 5, -1):
        letters = font(smaller, bold)
        if letters.getlength(text) <= width:
            return text, letters
    while text and letters.getlength(text + "…") > width:
        text = text[:-1]
    return text.rstrip() + "…", letters


def number(value: float, form: str) -> str:
    """Write a number in a format such as `.1f` or `g`, with a true minus sign and none before zero."""
    return format(value, f"z{form}").replace("-", "\N{MINUS SIGN}")
