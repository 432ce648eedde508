"""Least squares of Prony series on logarithms: search, optimum, derivative and uncertainty."""
