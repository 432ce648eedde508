"""Algorithms that find a contact on a grid."""
