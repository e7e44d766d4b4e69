"""What counts as lifting off, touching down and lying on the ground, for the onboard logic and for who waits for it."""

LIFT_M, LIFT_M_S = 0.03, 0.001  # a reference this far above the ground, or rising so fast, means to fly
TOUCH_M = 0.02  # a reference no higher than this, and not rising, means to stand
NEAR_GROUND_M = 0.6
TIPPED = -0.5  # nose's down component above which the vehicle is 60° or more from upright
