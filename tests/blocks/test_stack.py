import graded_contact as gc


def test_slices_of_a_graded_layer_converge_to_it_two_orders_better_when_extrapolated():
    profile = gc.Blend(gc.tyre_tread(), gc.Elastic(5e7, 0.3))
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(5e8, 0.3), 1e-5), gc.GradedLayer(profile, 1e-3)),
        base=gc.Rigid(),
    )
    q, omega = 2e3, -40.0
    expected = gc.surface_compliance(stack, q, omega, rtol=1e-11)
    few, many = (
        gc.surface_compliance_matrix(gc.response.sliced(stack, n), q, 0.0, omega)[2, 2]
        for n in (8, 16)
    )
    assert 1e-3 < abs(few / expected - 1) < 1e-2
    assert abs(many - expected) < abs(few - expected) / 3.5
    assert abs((4 * many - few) / 3 - expected) < abs(many - expected) / 8
