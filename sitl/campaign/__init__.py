"""Many flights: campaigns (Monte Carlo, sweeps) and data sets for learning, on one machine or several."""
