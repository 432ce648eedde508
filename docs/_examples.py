"""An example of each main name, for the reference. `gc` is `graded_contact`; JAX is in float64."""

EXAMPLES = {
    "slide": """
s = gc.slide(block, road, pressure=4e5, velocity=0.1)
print(s.friction, s.friction_error, s.contact_area)
""",
    "Sliding": """
s = gc.slide(block, road, pressure=4e5, velocity=0.1)
print(s)  # all numbers, their errors and warnings
""",
    "solve_contact": """
kernel = gc.stack_kernel(block, road.grid)
gap = gc.solve_contact(kernel, road.heights, 4e5).gap
""",
    "HardWall": """
gc.slide(block, road, pressure=4e5, velocity=0.1, law=gc.HardWall(hardness=5e6))
""",
    "AdhesiveLJ": """
law = gc.AdhesiveLJ(range=1e-8, work=0.05)  # m, J/m²
""",
    "mean_field_friction": """
m = gc.mean_field_friction(block, spectrum, pressure=4e5, velocity=0.1)
print(m.friction, m.contact_area)
""",
    "Elastic": """
coat = gc.Layer(gc.Elastic(6.5e6, 0.49), thickness=50e-6)
""",
    "Prony": """
rubber = gc.Prony(2e6, [3e6, 5e6], [1e-2, 1e-4], poisson=0.49)
loss = rubber.modulus(1e3).imag  # Pa, at 1000 rad/s
""",
    "BulkShear": """
rubber = gc.BulkShear(bulk=gc.Elastic(2e9), shear=gc.Prony(1e6, [1e8], [1e-6]))
nu = rubber.poisson_ratio(1e5)
""",
    "Tabulated": """
rubber = gc.Tabulated(omega, storage + 1j * loss, poisson=0.49)
""",
    "tyre_tread": """
cold = gc.tyre_tread().at(273.15)  # K
""",
    "WLF": """
shift = gc.WLF(c1=8.86, c2=101.6, reference=293.15)
""",
    "Stack": """
block = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
""",
    "GradedLayer": """
skin = gc.Elastic(2e7, 0.49)
profile = gc.Blend(gc.tyre_tread(), skin, gc.shapes.Linear())  # from the bottom to the top
layer = gc.GradedLayer(profile, thickness=1e-4)
""",
    "surface_compliance": """
q = jnp.logspace(2, 7, 50)
m = gc.surface_compliance(block, q, omega=q * 0.1)  # m/Pa, sliding at 0.1 m/s
""",
    "effective_modulus": """
e = gc.effective_modulus(block, q=1e5, omega=1e4)
tangent = e.imag / e.real
""",
    "stack_kernel": """
kernel = gc.stack_kernel(block, gc.Grid((256, 256), 8e-3), velocity=0.1)
""",
    "Grid": """
grid = gc.Grid((256, 256), 8e-3)  # points, edge [m]
profile = gc.Grid((1024,), 8e-3)
""",
    "SelfAffine": """
q0 = 2 * jnp.pi / 8e-3
spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=32 * q0)
""",
    "random_surface": """
road = gc.random_surface(spectrum, gc.Grid((256, 256), 8e-3), jax.random.key(0))
""",
    "read_surface": """
road = gc.read_surface("road.al3d")
print("\\n".join(road.history))  # what was corrected
""",
    "read_moduli": """
measured = gc.read_moduli("dma.csv")
print(measured.history)
""",
    "fit_prony": """
fit = gc.fit_prony(omega, modulus)
print(fit.report())
""",
    "master_curve": """
fit = gc.master_curve(gc.read_moduli(["20C.csv", "60C.csv"]))
rubber = fit.exported()
""",
    "sweep": """
def friction(point):
    return gc.slide(block, road, pressure=4e5, velocity=point["velocity"]).friction

results = gc.sweep(friction, {"velocity": [0.01, 0.1, 1.0]}, store="study")
""",
    "minimise": """
def objective(d):
    changed = gc.with_values(block, {"layers[0].thickness": d})
    return -gc.slide(changed, road, pressure=4e5, velocity=0.1).friction

best = gc.minimise(objective, 1e-5, 1e-3)
""",
    "with_values": """
thicker = gc.with_values(block, {"layers[0].thickness": 1e-4})
""",
    "propagate": """
p = gc.propagate(lambda b: gc.slide(b, road, pressure=4e5, velocity=0.1).friction,
                 {"layers[0].thickness": 5e-6}, block)
""",
    "run_scene": """
results = gc.run_scene(gc.read_scene("scene.toml"))
results.friction.sel(velocity=0.1, method="nearest")
""",
    "read_results": """
results = gc.read_results("result.h5")
results.friction.to_pandas()
""",
    "explore": """
gc.explore()  # opens a page with sliders in the browser
""",
}
