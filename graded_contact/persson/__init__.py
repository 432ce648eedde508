"""Persson's multiscale mean-field theory of contact and friction, for any stack."""
