"""Property tests draw the same examples on every run, so that a suite that passed passes again.

HYPOTHESIS_PROFILE=explore draws new ones: the way to look for what nobody has thought of.

A shell makes what it starts in the background deaf to Ctrl-C, and the programs under test would inherit that.
"""

import os
import signal

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

signal.signal(signal.SIGINT, signal.default_int_handler)
