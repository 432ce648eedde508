"""Linear viscoelastic materials: complex modulus and Poisson's ratio against frequency."""
