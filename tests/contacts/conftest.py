"""Small contact scenes shared by the tests: compiling them is most of the time."""

import graded_contact as gc

RUBBER = gc.Prony(0.75, [0.75 * 9], [1.0], 0.5)  # reduced modulus 1 Pa at rest, 10 Pa at speed
BODIES = {
    "elastic": gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75, 0.5))),
    "bare": gc.Stack(base=gc.HalfSpace(RUBBER)),
    "coated": gc.Stack(layers=(gc.Layer(gc.Elastic(0.75, 0.5), 0.01),), base=gc.HalfSpace(RUBBER)),
    "three layers": gc.Stack(
        layers=(
            gc.Layer(gc.Elastic(2.0, 0.3), 0.003),
            gc.Layer(gc.Prony(0.5, [3.0], [0.1], 0.4), 0.02),
            gc.Layer(gc.Elastic(0.4, 0.45), 0.05),
        ),
        base=gc.Rigid(),
    ),
}
LAWS = {
    "hard": gc.HardWall(),
    "hardness": gc.HardWall(hardness=0.3),
    "repulsive": gc.RepulsiveLJ(1e-3, 0.05),
    "adhesive": gc.AdhesiveLJ(2e-3, 4e-5),
    "exponential": gc.contacts.ExponentialAdhesion(2e-3, 4e-5),
}
SPEED = 0.1  # m/s, with a cell of 1 m and a relaxation time of 1 s: near the peak of loss
