"""Errors of observables: by the solver, the grid and the times."""
