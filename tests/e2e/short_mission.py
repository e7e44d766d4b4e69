"""The mission that thousands of flights are tried with: up, a little north, down."""

HOP = """\
name: hop
kind: waypoints
duration_s: 6
waypoints:
  - {t_s: 0, at_m: [0, 0, 0]}
  - {t_s: 2.5, at_m: [0, 0, -1]}
  - {t_s: 5, at_m: [0.3, 0, 0]}
"""
