"""The paper's evaluation again, measured: flights, ablations, loop analysis, and a report of it all."""
