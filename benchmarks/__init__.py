"""What the simulator is measured by: a script per figure, `python -m benchmarks` for all of them.

Every figure is measured several times and told as a median with its spread, next to what is required of it or next to
something simpler measured in the same run. Nothing in here passes or fails: a machine shared with others moves every
number, and what to make of one is for whoever reads the table.
"""
