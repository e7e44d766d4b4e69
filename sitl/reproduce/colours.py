"""Which colour stands for which set-up, the same in every figure of the report."""

from sitl.drawing import BLUE, GREEN, PURPLE, VERMILION

FEEDBACK, FEEDFORWARD, EXACT, TUNED = VERMILION, BLUE, PURPLE, GREEN
COLOURS = {"feedback": FEEDBACK, "feedforward": FEEDFORWARD, "printed": FEEDFORWARD, "exact": EXACT, "tuned": TUNED}
