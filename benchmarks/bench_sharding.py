"""The cost of one contact over several devices: time, memory of each device, bytes exchanged.

    python benchmarks/bench_sharding.py [--sizes 1024 2048] [--devices 1 2 4] [--processes 2 4]

A tread under an elastic coat, bench_contact's rough surface on N x N points (H = 0.8, roll-off
4 q0, cut-off N/8 q0, rms slope 0.1), pressure 0.4 MPa at 0.1 m/s, rtol = 1e-6. Virtual devices of
one process, and processes with one device each (`jax.distributed`, gloo), share the cores of one
machine: they show the bytes exchanged and stored, not the speed of more machines. `seconds` and the
CPU time of all processes are the smallest of some solves, without compilation. `arguments`,
`outputs` and `temporaries` belong to the compiled solve, in units of the share of a device in a
field of N x N numbers; their sum follows. The peak is the largest resident set of a process. `sent`
is what a device sends for each FFT pair, `else` the largest exchange besides transforms. `pressure`
and `friction` are relative differences from one device, the former root mean square.
"""

import json
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np
from rows import keep, run, show

import graded_contact as gc
from graded_contact.fields.grid import to_field, to_spectrum

CELL = 8e-3  # m
PRESSURE, SPEED = 4e5, 0.1  # Pa, m/s
KINDS = "all-gather|all-to-all|all-reduce|collective-permute|reduce-scatter"
SIZES = {"pred": 1, "s32": 4, "f32": 4, "c64": 8, "s64": 8, "u64": 8, "f64": 8, "c128": 16}


def exchanged(program):
    """The kind of each collective operation of a compiled program, and the bytes of its result."""
    found = []
    for result, kind in re.findall(rf"= (.*?) ({KINDS})(?:-start)?\(", program.as_text()):
        total = 0
        for dtype, shape in re.findall(r"(\w+)\[([\d,]*)\]", result):
            count = 1
            for n in filter(None, shape.split(",")):
                count *= int(n)
            total += SIZES[dtype] * count
        found.append((kind, total))
    return found


def measure(size, repeat, file, process):
    """Runs in a process of its own, on all its devices; `file` has the pressure of one device."""
    if process:
        address, count, rank = process
        jax.distributed.initialize(address, int(count), int(rank))
    devices = jax.devices()
    grid, first = gc.Grid((size, size), CELL, devices), 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=0.1, hurst=0.8, q_low=first, q_roll=4 * first, q_high=size / 8 * first
    )
    surface = gc.random_surface(spectrum, grid, jax.random.key(0))
    coat = gc.Layer(gc.Elastic(6.5e6, 0.49), 50e-6)
    stack = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
    kernel = gc.stack_kernel(stack, grid, SPEED)

    def compiled(function):
        return jax.jit(function).lower(kernel, surface.heights).compile()

    solve = compiled(lambda k, h: gc.solve_contact(k, h, PRESSURE, rtol=1e-6, throw=False))
    pair = compiled(lambda k, h: to_field(to_spectrum(h), h.shape))
    seconds = []
    for _ in range(repeat):
        begun = time.perf_counter(), time.process_time()
        contact = jax.block_until_ready(solve(kernel, surface.heights))
        seconds.append((time.perf_counter() - begun[0], time.process_time() - begun[1]))
    if len(devices) == 1:
        np.save(file, np.asarray(contact.pressure))
    known = np.load(file, mmap_mode="r")
    shards = contact.pressure.addressable_shards
    wrong = sum(np.sum((np.asarray(s.data) - known[s.index]) ** 2) for s in shards)
    memory = solve.memory_analysis()
    field = 8 * size * size / len(devices)
    sent = sum(total for kind, total in exchanged(pair) if kind == "all-to-all")
    others = [total for kind, total in exchanged(solve) if kind != "all-to-all"]
    waves = gc.sliding.cumulative_friction(contact.pressure, contact.displacement, grid, SPEED)
    return {
        "seconds": min(wall for wall, _ in seconds),
        "cpu": min(busy for _, busy in seconds),
        "pairs": float(contact.num_fft_pairs),
        "arguments": memory.argument_size_in_bytes / field,
        "outputs": memory.output_size_in_bytes / field,
        "temporaries": memory.temp_size_in_bytes / field,
        "bytes": memory.argument_size_in_bytes + memory.output_size_in_bytes
        + memory.temp_size_in_bytes,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "sent": sent * (1 - 1 / len(devices)),
        "other": max(others, default=0),
        "wrong": float(wrong),
        "size": float(np.sum(known**2)),
        "friction": float(waves.friction[-1]),
    }  # fmt: skip


def results_of(size, repeat, file, devices, processes):
    """The results of all processes of a case."""
    flags = f"--xla_force_host_platform_device_count={devices}"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    started = []
    for rank in range(processes):
        command = [sys.executable, __file__, "--case", str(size), str(repeat), str(file)]
        command += [address, str(processes), str(rank)] if processes > 1 else []
        environment = {**os.environ, "XLA_FLAGS": flags}
        started.append(
            subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        )
    outputs = [process.communicate()[0].splitlines() for process in started]
    if any(process.returncode for process in started):
        raise SystemExit(f"A case of {processes} processes with {devices} devices failed.")
    return [json.loads(lines[-1]) for lines in outputs]


def sharding(sizes=(1024, 2048), devices=(1, 2, 4), processes=(2, 4), repeat=2, case=()):
    """The table; the first of `--devices` is 1. `--case` is for the processes that this starts."""
    if case:
        size, times, file, *process = case
        print(json.dumps(measure(int(size), int(times), file, process)))
        return
    with tempfile.TemporaryDirectory() as folder:
        for size in sizes:
            file, alone = Path(folder, "pressure.npy"), None
            for count, processes_of in [(d, 1) for d in devices] + [(1, p) for p in processes]:
                each = results_of(size, repeat, file, count, processes_of)
                one = each[0]
                alone = alone or one["friction"]
                row = {
                    "N": size,
                    "devices": count * processes_of,
                    "processes": processes_of,
                    "CPU time [s]": sum(a["cpu"] for a in each),
                    "fields of a device": one["arguments"] + one["outputs"] + one["temporaries"],
                    "of a device [MB]": one["bytes"] / 1e6,
                    "peak of a process [MB]": max(a["peak"] for a in each) / 1e6,
                    "sent [MB/pair]": one["sent"] / 1e6,
                    "largest else [kB]": one["other"] / 1e3,
                    "pressure": (sum(a["wrong"] for a in each) / one["size"]) ** 0.5,
                    "friction": abs(one["friction"] / alone - 1),
                }
                keep("bench_sharding", row)
                more = ("seconds", "pairs", "arguments", "outputs", "temporaries")
                show(row | {name: one[name] for name in more})


if __name__ == "__main__":
    run(__doc__, sharding)
