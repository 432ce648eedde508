"""The observables of a contact."""
