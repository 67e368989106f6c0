"""Colours that the colour-blind tell apart, and what they stand for; a word stands beside each."""

from __future__ import annotations

from shm.values import Verdict

INK = "#1d2330"
GRID = "#d5d9e0"
BLUE = "#0072b2"
ORANGE = "#d55e00"
GREEN = "#009e73"
PURPLE = "#9b4f96"
RED = "#b00020"
QUIET = "#565f70"
# Okabe and Ito (2008), darkened where small marks need it; names are the page's CSS variables.
PALETTE = {
    "ink": INK,
    "grid": GRID,
    "blue": BLUE,
    "orange": ORANGE,
    "green": GREEN,
    "purple": PURPLE,
    "red": RED,
    "quiet": QUIET,
}
STATUS_COLOURS = {
    "alert": RED,
    "watch": ORANGE,
    "check": ORANGE,
    "unclear": ORANGE,
    "steady": GREEN,
    "first": BLUE,
}
"""By the page's style of a state."""
VERDICT_COLOURS: dict[Verdict, str] = {
    "good": GREEN,
    "warning": ORANGE,
    "refused": RED,
    "unknown": QUIET,
}
VERDICT_STYLES: dict[Verdict, str] = {
    "good": "steady",
    "warning": "watch",
    "refused": "alert",
    "unknown": "first",
}
"""The page's style of a whole test's verdict."""
