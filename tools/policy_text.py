"""The section of docs/RESULTS.md on policies for every approach, as text made from docs/data/policies.json."""

import textwrap
from typing import Any

from ivl.analysis.campaign_text import table

Data = dict[str, Any]

_ASKED = (
    ("box, ideal sensing predicted", "ideal", "box", 0.95, 0.93),
    ("box, mocap", "mocap", "box", 0.92, 0.88),
    ("box, camera50_delay20, Kalman filter", "camera50_delay20", "box", 0.87, 0.82),
    ("plane, shaped, ideal sensing predicted", "ideal", "shaped", 0.99, 0.99),
    ("plane, shaped, camera50_delay20, Kalman filter", "camera50_delay20", "shaped", 0.97, 0.95),
)
"""Row, sensor set, region, asked landed, asked clean."""
_RATIO_ASKED = 0.97
_WHERE = "`habas2021`, `as_simulated`, Wide-Short"
_WIDTH = 158


def section(data: Data) -> str:
    """The text between the marks; a part that was not measured says so."""
    writers = {
        "sensors": _sensors,
        "go": _go,
        "gears": _gears,
        "family": _family,
        "forms": _forms,
        "one_class": _one_class,
    }
    parts = []
    for name, write in writers.items():
        part = data.get(name)
        parts += [*write(part["found"]), _made(name, part["made"])] if part else [f"*Part {name}: not measured.*"]
    if {"sensors", "gears"} <= data.keys():
        parts += _expected(data["sensors"]["found"], data["gears"]["found"])
    return "\n\n".join(parts) + "\n"


def verdict(value: float, asked: float, low: float, high: float, least: bool = True) -> str:
    """Whether a number meets what was asked; a miss says by how much, and whether the interval excludes it.

    Args:
        value: What was measured.
        asked: What was asked.
        low: Lower end of the interval of the value.
        high: Upper end.
        least: Whether the asked number is the least one, or the largest.
    """
    if value >= asked if least else value <= asked:
        return "yes"
    within = high >= asked if least else low <= asked
    return f"no, by {abs(value - asked):.3f}{' (within the interval)' if within else ''}"


def _sensors(found: Data) -> list[str]:
    rows = []
    for title, name, region, *asked in _ASKED:
        rates = found[name][region]
        met = [
            verdict(rates[what], least, *rates[f"{what}_interval"])
            for what, least in zip(("landed", "clean"), asked, strict=True)
        ]
        unchanged = found[name].get("of_ideal") if region == "box" else None
        rows.append(
            (
                title, f"{_rate(asked[0])} / {_rate(asked[1])}", _with(rates, "landed"), _with(rates, "clean"),
                "yes" if met == ["yes", "yes"] else " / ".join(met), _pair(unchanged) if unchanged else "-",
            )
        )  # fmt: skip
    return [
        "### What was asked of it",
        _paragraph(
            f"{_WHERE}, form `polynomial3`, 2,000 fresh approaches a figure, landed / clean, with 95 % intervals.",
            "Ideal sensing has the policy of the shipped experiment. Mocap and camera50_delay20 have a",
            "policy each, from",
            "a short search that begins with it; the last column is the policy of ideal sensing, flown",
            "unchanged there.",
        ),
        table(("", "asked", "landed", "clean", "met", "policy of ideal sensing"), rows),
        _paragraph(
            f"The plane as commanded, without a shaped approach: {_pair(found['ideal']['plane'])} with ideal sensing,",
            f"{_pair(found['camera50_delay20']['plane'])} with camera50_delay20.",
        ),
    ]


def _go(found: Data) -> list[str]:
    camera = found["camera50"]
    go, rows = camera["go"], []
    for name, asked, title in (("auc", 0.95, "AUC"), ("calibration_error", 0.03, "calibration error")):
        least = name == "auc"
        met = verdict(go[name], asked, go[name], go[name], least)
        rows.append((title, f"{'>=' if least else '<='} {_rate(asked)}", _rate(go[name]), met))
    for name, asked, title in (
        ("strikes_avoided", 0.75, "body strikes avoided"),
        ("refused_good", 0.04, "refused although they would land"),
    ):
        least = name == "strikes_avoided"
        met = verdict(go[name], asked, *go[f"{name}_interval"], least)
        rows.append((title, f"{'>=' if least else '<='} {_rate(asked)}", _with(go, name), met))
    n = go["level_out_contacts"]
    rows.append(("contacts in level-outs", "0", str(n), "yes" if n == 0 else f"no, by {n}"))
    return [
        "### Go / no-go",
        _paragraph(
            "Go / no-go with `camera50` and a Kalman filter over the plane: the thresholds of the shipped experiment's",
            "policy, and a go / no-go that was learned with this camera. Approaches below a probability of",
            f"{go['p_min']:.2f} are refused, which are {_rate(go['no_go'])} of all; of those that are flown",
            f"{_rate(go['landed_of_flown'])} land. Without refusals {_pair(camera['plane'])} do",
            f"(box {_pair(camera['box'])}).",
        ),
        table(("", "asked", "measured", "met"), rows),
        _paragraph(
            f"Of the refused approaches {go['contacts_before_no_go']} touched the ceiling before they were called off",
            "(without a distance there is no cue, and without a cue nothing is decided); the least clearance of those",
            f"that touched nothing was {100 * camera['clearance_m']:.1f} cm.",
        ),
    ]


def _gears(found: Data) -> list[str]:
    rows = []
    for name, row in found.items():
        landed, others = row["ratio"]["landed"], (row["ratio"][of]["value"] for of in ("clean", "score"))
        low, high = landed["interval"]
        rows.append(
            (
                name, f"{row['flights']:,}", _pair(row["box"]), _pair(row["best"]),
                f"{_rate(landed['value'])} ({_rate(low)} to {_rate(high)})", " / ".join(map(_rate, others)),
                verdict(landed["value"], _RATIO_ASKED, low, high),
            )
        )  # fmt: skip
    first = next(iter(found.values()))
    return [
        "### Every gear, and the vehicle that flew",
        _paragraph(
            "A policy was learned for each over the box with the *flights* given (`polynomial3`, unless the row",
            "names another form; ideal sensing for `habas2021`, its own sensors and battery for `crazyflie21`;",
            "cues predicted to the present tick). *Best of each cell*: the best (RREV_c, M_yd) in each of",
            f"{first['best']['cells']} cells of the box under the same sensing. It was chosen on other approaches,",
            f"from all over the cell. Both are judged on the same {first['box']['flights']:,} fresh approaches,",
            "landed / clean. *Ratio*: the policy over",
            "the best of each cell, with a 95 % interval; .97 in landings is asked. *Score* is what was searched for,",
            "the mean of landed and clean. Above 1 the best of each cell is not the best that there is: it was found",
            "with fewer approaches, and one policy serves all of its cell.",
        ),
        table(
            ("vehicle, gear", "flights", "policy", "best of each cell", "ratio, landed", "ratio, clean / score", "met"),
            rows,
        ),
    ]


def _family(found: Data) -> list[str]:
    rows, gains = [], []
    for name, row in found.items():
        drawn = f"{row['learned_over']} drawn vehicles"
        for which, title in (("nominal", "the vehicle of the files"), ("family", drawn)):
            of = row[which]
            rows.append((name, title, _pair(of), _rate(of["worst_tenth"]), _pair(of["nominal_box"])))
        gain = row["gain"]
        low, high = gain["landed"] - gain["half"], gain["landed"] + gain["half"]
        what = "gains" if low > 0 else "loses" if high < 0 else "makes no difference that these vehicles show:"
        gains.append(
            _paragraph(
                f"{name}: learning over the family {what} {gain['landed']:+.3f}",
                f"({low:+.3f} to {high:+.3f}) in landings;",
                f"it is better on {gain['better']} of {row['vehicles']} vehicles.",
            )
        )
    first = next(iter(found.values()))
    return [
        "### A family of vehicles",
        _paragraph(
            "Only the files of the vehicles that fly, and those of Table I, say how uncertain their numbers are",
            "(`sigma`), so this is `crazyflie21`. Two searches begin with the policy of the table above, and have",
            f"about as many flights: one on the vehicle of the files, one on {first['learned_over']} vehicles drawn",
            f"from them. Both are judged over the box on the same {first['vehicles']} vehicles drawn anew,",
            f"{first['flights']} approaches each, landed / clean. The flight core of a drawn vehicle knows the mass,",
            "inertia and thrust of that vehicle.",
        ),
        table(("vehicle, gear", "learned on", "drawn vehicles", "worst tenth, landed", "vehicle of the files"), rows),
        *gains,
    ]


def _forms(found: Data) -> list[str]:
    rows = [(f"`{name}`", f"{row['flights']:,}", _pair(row["box"]), _pair(row["plane"])) for name, row in found.items()]
    return [
        "### Forms at equal data",
        _paragraph(
            f"{_WHERE}, ideal sensing predicted, learned over box and plane with a",
            "small budget; 2,000 fresh approaches a",
            "figure, landed / clean. The constant policy is the best of a grid.",
        ),
        table(("form", "flights", "box", "plane"), rows),
    ]


def _one_class(found: Data) -> list[str]:
    of = found["box"]
    rows = [
        ("one-class SVM + network", _pair(of["svm"]), _rate(of["svm"]["silent"])),
        (f"`{of['name']}`, judged in the same way", _pair(of["form"]), _rate(of["form"]["silent"])),
        (f"`{of['name']}`, flown in the core", _pair(of["core"]), "-"),
    ]
    return [
        "### Beside the one-class SVM",
        _paragraph(
            "The trigger of the authors' later paper is a one-class SVM over (RREV, OF_y, d), with a",
            "network for the moment. It is",
            "no form of the flight core. Both were judged on the same",
            f"{of['judged_on']:,} recorded approaches of the box ({_WHERE}, ideal sensing predicted): the",
            "first tick at which a",
            "policy says flip is looked up, and the core flies the flip from the recorded state. The SVM",
            "was trained on the",
            f"{of['landings']:,} clean landings of a map; its share of outliers ({of['outliers']:g}) and its",
            "width (gamma",
            f"{of['gamma']:g}) are the best of 16 pairs, on other approaches, {of['flights']:,} flights in",
            "all. The form is that of",
            "the shipped experiment, which had more flights; the table above has forms that had as few.",
        ),
        table(("trigger", "landed / clean", "never triggers"), rows),
    ]


def _expected(sensors: Data, gears: Data) -> list[str]:
    ideal, camera = sensors["ideal"], sensors["camera50_delay20"]
    ratios = {name: row["ratio"]["landed"]["value"] for name, row in gears.items() if row["form"] == "polynomial3"}
    worst = min(ratios, key=lambda name: ratios[name])
    enough = sum(ratio >= _RATIO_ASKED for ratio in ratios.values())
    whole, shaped = ideal["plane"]["landed"] >= _RATIO_ASKED, ideal["shaped"]["landed"] >= _RATIO_ASKED
    on_board = camera["box"]["landed"] >= _ASKED[2][3] and camera["shaped"]["landed"] >= _ASKED[4][3]
    rows = (
        (
            "One policy from the augmented optical flow (RREV, OF_y, d) serves all approaches of the box.",
            f"{_pair(ideal['box'])}; at least {_rate(ratios[worst])} of the best policy of each cell ({worst})",
            "yes" if enough == len(ratios) else f"partly: {enough} of {len(ratios)} gears and vehicles reach .97",
        ),
        (
            "It serves approaches of all speeds and angles.",
            f"{_pair(ideal['plane'])} as commanded, {_pair(ideal['shaped'])} with a shaped approach",
            "yes" if whole else "with a shaped approach only" if shaped else "no",
        ),
        (
            "Sensors on board suffice.",
            f"camera50_delay20: box {_pair(camera['box'])}, plane, shaped {_pair(camera['shaped'])}",
            "yes" if on_board else "partly: below what was asked above",
        ),
    )
    return [
        "### What the paper expects of a general policy",
        _paragraph(
            "The paper leaves one policy for all approach conditions, from the",
            "augmented optical flow, to future work. In this",
            f"simulator ({_WHERE}, unless a row says otherwise):",
        ),
        table(("expectation", "here, landed / clean", "verdict"), rows),
    ]


def _made(part: str, made: Data) -> str:
    commit = (made["git_commit"] or "unknown")[:12]
    return f"(`tools/policy_results.py measure {part}`, commit {commit}, simulator {made['library_sha256'][:12]})"


def _paragraph(*lines: str) -> str:
    return textwrap.fill(" ".join(lines), _WIDTH, break_long_words=False, break_on_hyphens=False)


def _rate(value: float) -> str:
    text = f"{value:.3f}"
    return text[1:] if text.startswith("0.") else text


def _pair(rates: Data) -> str:
    return f"{_rate(rates['landed'])} / {_rate(rates['clean'])}"


def _with(rates: Data, name: str) -> str:
    low, high = rates[f"{name}_interval"]
    return f"{_rate(rates[name])} ({_rate(low)} to {_rate(high)})"
