"""Known spectra from noisy data: error, bias and coverage of fits, for `bench_fit.py`."""

import numpy as np
from prony_peers import goal, parts_of

import graded_contact as gc

PROBES = 25  # frequencies, evenly over the data; a range holds five of them
RANGES = ("lowest", "low", "middle", "high", "highest")


def known():
    """Material, frequencies, standard deviations of ln E' and ln E'', by name."""
    strengths, times = [4e8, 2e8, 1e8, 3e7, 5e6, 1e7], [2e-7, 1e-5, 3e-4, 1e-2, 0.3, 10.0]
    six, tread = gc.Prony(5e6, strengths, times), gc.tyre_tread()
    return {
        "six branches, 2 %": (six, np.geomspace(1e-2, 1e7, 80), 0.02, 0.02),
        "six branches, 2 and 5 %": (six, np.geomspace(1e-2, 1e7, 80), 0.02, 0.05),
        "tread, 8 decades, 1 and 3 %": (tread, np.geomspace(1e-2, 1e6, 100), 0.01, 0.03),
        "tread, 16 decades, 2 and 5 %": (tread, np.geomspace(1e-3, 1e13, 200), 0.02, 0.05),
        "tread, 3 decades, 2 and 5 %": (tread, np.geomspace(1e-1, 1e2, 30), 0.02, 0.05),
    }


def recovery(options):
    print(f"\n{options.draws} draws of data (bootstrap: {options.bootstrap}, of 200 refits each);")
    print("error: rms of ln(fit/true) over ranges of frequency and draws, %; bias: its mean;")
    print("coverage: how often 95 % limits enclose the truth, %")
    covered = {"Gauss-Newton": [], "bootstrap": []}
    fifths = {"Gauss-Newton": [], "bootstrap": []}
    for name, case in known().items():
        logs, inside, resampled, terms = draws_of(case, options)
        numbers, counts = np.unique(terms, return_counts=True)
        listing = ", ".join(f"{n} ({c})" for n, c in zip(numbers, counts, strict=True))
        print(f"\n{name}; terms: {listing}")
        print(f"{'':26s} {'all':>7s} " + " ".join(f"{r:>7s}" for r in RANGES))
        for channel, modulus in enumerate(("E'", "E''")):
            part = logs[:, channel]
            print_ranges(f"{modulus:3s} error", np.sqrt(np.mean(part**2, axis=0)), rms=True)
            print_ranges(f"{modulus:3s} bias", np.mean(part, axis=0))
            for method, hits in (("Gauss-Newton", inside), ("bootstrap", resampled)):
                if len(hits):
                    shares = np.mean(hits[:, channel], axis=0)
                    covered[method].append((np.mean(shares), f"{modulus} of {name}"))
                    fifths[method] += [np.mean(part) for part in np.split(shares, len(RANGES))]
                    print_ranges(f"{modulus:3s} coverage, {method}", shares)
    print()
    for method, shares in covered.items():
        if shares:
            (low, where_low), (high, where_high) = min(shares), max(shares)
            goal(
                f"95 % limits of E*, {method}: coverage of each channel 90 to 98 %",
                f"{low:.1%} ({where_low}) to {high:.1%} ({where_high}); in single fifths of the "
                f"frequencies {min(fifths[method]):.1%} to {max(fifths[method]):.1%}",
            )


def draws_of(case, options):
    """ln(fit/true), whether limits enclose the truth: by draw, channel, frequency; and terms."""
    material, omega, *noise = case
    rng = np.random.default_rng(options.seed)
    probe = np.geomspace(omega[0], omega[-1], PROBES)
    true, clean = (parts_of(material.modulus(w)) for w in (probe, omega))
    logs, inside, resampled, terms = [], [], [], []
    for draw in range(options.draws):
        noisy = clean * np.exp(np.array(noise)[:, None] * rng.standard_normal(clean.shape))
        found = gc.fit_prony(omega, noisy[0] + 1j * noisy[1])
        logs.append(np.log(parts_of(found.material.modulus(probe)) / true))
        terms.append(found.terms)
        inside.append(encloses(found.confidence(probe), true))
        if draw < options.bootstrap:
            limits = found.confidence(probe, resamples=200, seed=draw)
            resampled.append(encloses(limits, true))
    return np.array(logs), np.array(inside), np.array(resampled), terms


def encloses(limits, true):
    lower, upper = map(parts_of, limits)
    return (lower <= true) & (true <= upper)


def print_ranges(label, values, rms=False):
    """Prints values by frequency in %, over all and in each of five ranges."""
    power = 2 if rms else 1
    means = [np.mean(part**power) ** (1 / power) if rms else np.mean(part)
             for part in (values, *np.split(values, len(RANGES)))]  # fmt: skip
    print(f"{label:26s} " + " ".join(f"{100 * mean:7.2f}" for mean in means))
