"""`gcs watch`: what vehicles tell of themselves, live: a dashboard on a terminal, a line a second elsewhere.

station, seen      who is heard, and what is asked of them
instruments, traffic, traces      what they told, worked up: pure, the caller's clock is handed in
layout, blocks, gauges, track_map      the picture of that as lines of text: pure
screen, keys, run  the terminal
plain              the line a second
"""
