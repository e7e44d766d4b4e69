"""A flight's report from its log: read, measured, told in tables and figures."""
