"""The least a process with compiled kernels does: import numba (and numpy with it) and end."""

import numba

__all__ = ["numba"]
