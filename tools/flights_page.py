"""The text of docs/FLIGHTS.md, from the figures in docs/data/flights.json."""

import textwrap
from typing import Any

from ivl import model

_NAMES = {"now": "`crazyflie21`", "before": "`crazyflie21` before these flights", "habas2021": "`habas2021`"}


def page(d: dict[str, Any]) -> str:
    """The whole page."""
    parts = (_head, _replay, _measured, _motion, _outcome, _fit, _feet, _wrong, _belief, _repeat)
    return "\n\n".join(_wrapped(part(d).strip()) for part in parts) + "\n"


def _wrapped(text: str) -> str:
    """Paragraphs and points of a list in lines of 118 characters; tables, code and headings as they are."""
    blocks = []
    for block in text.split("\n\n"):
        if block.startswith(("|", "#", "    ", "!")):
            blocks.append(block)
        elif block.startswith("- "):
            points = " ".join(block.split()).removeprefix("- ").split(" - ")
            blocks.append("\n".join(_fill(f"- {point}", "  ") for point in points))
        else:
            blocks.append(_fill(block, ""))
    return "\n\n".join(blocks)


def _fill(text: str, indent: str) -> str:
    return textwrap.fill(" ".join(text.split()), 118, subsequent_indent=indent, break_long_words=False,
                         break_on_hyphens=False)  # fmt: skip


def _table(head: str, rows: list[str]) -> str:
    return "\n".join([head, "|" + "---|" * (head.count("|") - 1), *rows])


def _head(d: dict[str, Any]) -> str:
    now, endings = d["compared"]["now"], d["endings"]
    rates = " and ".join(
        f"{p['rate']:.2f} at ({p['threshold_per_s']:g}, {p['moment_Nmm']:g})" for p in now["policies"][:2]
    )
    window = now["windows"][0]
    span, flown = window["simulated_threshold_per_s"], window["landed_threshold_per_s"]
    return f"""# Agreement with real flights

`tools/flights.py` writes this page; its figures are in docs/data/flights.json. The flights are those of the paper's authors
(public repository bhabas/sar_simulation, MIT licence): July 2021, a Crazyflie 2.1 with upgraded brushed motors, Wide-Short,
vertical approaches at 2.5 m/s, a learning run of 40 rollouts and 4 more. {d["n_usable"]} of {d["n_flights"]} can be used:
{endings["4"]} ended on three or four feet, {endings["2"]} on one or two, {endings["0"]} on none, as the study's own returns say.
The logs are not part of this repository. `habas2021` stays the simulation of the paper; `crazyflie21` is the vehicle that flew.

**Result.** The simulated `crazyflie21` turns as the real vehicle did: {now["pitch_rms_deg"]:.1f} degrees rms over the first 200 ms
of the flip ({d["compared"]["before"]["pitch_rms_deg"]:.0f} before these flights were known). No parameter was fitted to an outcome.
Its landing rates are {rates}, where real vehicles landed; at {window["moment_Nmm"]:.2f} N mm half of the simulated landings
succeed from RREV_c {span[0]:.2f} to {span[1]:.2f} 1/s, and real landings had {flown[0]:.2f} to {flown[1]:.2f}.

![Recorded and simulated flips](figures/flights.png)"""


def _replay(d: dict[str, Any]) -> str:
    r = d["replay"]
    return f"""## 1. Replay: cues and trigger

Recorded states were fed to the flight core, tick by tick ([REPLAY.md](REPLAY.md)). Of {r["n_samples"]} logged RREV of
{r["n_flights"]} approaches {100 * r["rrev"]["within_0_003"]:.1f} % agree within 0.003 1/s; the log has three digits. The trigger
falls within one 10 ms sample of the logged one in {100 * r["trigger"]["within_one_sample"]:.1f} % of the flights."""


def _measured(d: dict[str, Any]) -> str:
    s, b = d["spin_down"], d["battery"]
    rows = [
        f"| {row['speed_mps']:.1f} | {row['n']} | {row['recorded_mps2']:.2f} | {row['simulated_mps2']:.2f} |"
        for row in d["climb"]
    ]
    return f"""## 2. Measured without a flip

**Rotors that slow down.** {s["n_logs"]} spin-down logs follow a law in which {100 * s["law"]["drag_share"]:.0f} % of the drag grows with the
square of the speed (MODEL eq. 2.9), with tau_down {s["law"]["tau_down_s"]:.3f} s: {s["law"]["rms_radps"]:.0f} rad/s rms. A pure exponential
misses them by {s["exponential"]["rms_radps"]:.0f} rad/s. At M_yd = 6 N mm the front rotors hardly change their speed; how the rear ones die
makes the flip.

**Battery.** Medians: {b["rest_V"]:.2f} V at rest ({b["rest_spread_V"]:.2f} V from flight to flight), {b["full_V"]:.2f} V with four rotors at full
duty, {b["pair_V"]:.2f} V with the front pair alone. The fall is proportional to the thrust.

**Climb.** With the thrust saturated, the acceleration falls as the vehicle climbs faster: rotors lose thrust to the inflow.

{_table("| speed, m/s | samples | recorded, m/s^2 | simulated, m/s^2 |", rows)}"""


def _motion(d: dict[str, Any]) -> str:
    rows = [
        f"| {_NAMES[k]} | {c['pitch_rms_deg']:.1f} | {1e3 * c['height_rms_m']:.0f} | {c['rate_rms_radps']:.1f} | {_ms(c)} |"
        for k, c in d["compared"].items()
    ]
    head = "| vehicle | pitch, deg | height, mm | rate, rad/s | contact, simulated - recorded, ms |"
    return f"""## 3. Motion after the trigger

Each flip is flown once from its recorded state at the trigger. Root mean squares to 200 ms or to the contact, all flights; `crazyflie21` was fitted to
their motion (section 5 has flights that were not).

{_table(head, rows)}

The trigger's instant is known to 3 ms or so in these logs, and a flip turns by 5 degrees in 3 ms: much of the remaining
difference is time. Repeated rows of the log are left out."""


def _ms(c: dict[str, Any]) -> str:
    return "-" if c["t_contact_error_s"] is None else f"{1e3 * c['t_contact_error_s']:+.0f}"


def _outcome(d: dict[str, Any]) -> str:
    head = "| vehicle | AUC | Brier score | rate of flights that ended on 4 / 2 / 0 feet | endings on one or two feet |"
    rows = []
    for k, c in d["compared"].items():
        (alo, ahi), (blo, bhi) = c["landed_auc_95"], c["landed_brier_95"]
        by = " / ".join("-" if v is None else f"{v:.2f}" for v in c["rate_by_flown_legs"].values())
        rows.append(
            f"| {_NAMES[k]} | {c['landed_auc']:.2f} ({alo:.2f}-{ahi:.2f}) | {c['landed_brier']:.3f} ({blo:.3f}-{bhi:.3f}) | {by} | "
            f"{c['two_leg_share']['simulated']:.2f} |"
        )
    flown = d["compared"]["now"]["two_leg_share"]["flown"]
    policies = [
        f"| ({p['threshold_per_s']:g}, {p['moment_Nmm']:g}) | {told} | {p['rate']:.2f} | {b['rate']:.2f} | {h['rate']:.2f} |"
        for p, b, h, told in zip(
            *(d["compared"][k]["policies"] for k in ("now", "before", "habas2021")),
            ("the learning run converged here", "4 of 4 flights landed", "93.75 %, published"),
            strict=True,
        )
    ]
    return f"""## 4. Outcome

Each flip is flown many times from its recorded state, which is known to 8 mm, 5 cm/s, 0.1 rad/s and 1 % of the moment. The share
of landings on three or four feet is the prediction for that flight. In brackets 95 %, by resampling flights.

{_table(head, rows)}

Of the real flights {flown:.2f} ended on one or two feet. Landing rates from a hover, by policy (RREV_c in 1/s, M_yd in N mm):

{_table("| policy | flown | `crazyflie21` | before | `habas2021` |", policies)}"""


def _fit(d: dict[str, Any]) -> str:
    f, good = d["fit"], d["good_fits"]
    rows = []
    for name, p in f["parameters"].items():
        low, high = p["interval_95"]
        rows.append(
            f"| `{name}` | {p['prior']:.3f} +- {p['prior_sigma']:.3f} | {p['value']:.4f} | {low:.4f} to {high:.4f} | {p['unit']} |"
        )
    out_before, out_after = f["before"]["held_out"], f["after"]["held_out"]
    ranges = [f"| {name} | {low:.2f} to {high:.2f} |" for name, (low, high) in good.items() if "," in name]
    words = " ".join((*f["words"], _correlations(list(f["parameters"]), f["correlation"])))
    return f"""## 5. What was fitted, and what was held out

`ivl flight identify` fitted three parameters to pitch, rate, height, time of contact and hanging height of {f["n_flights"]} flights with
M_yd between 5.7 and 6.3 N mm, with these numbers as they were before and wide priors. Everything else is as in `crazyflie21` now, some
of it measured in the same logs (section 2), so the held-out flights are new to these three numbers alone. {len(f["held_out"])} flights with other
moments (3.8 to 7.6 N mm) were held out.

{_table("| parameter | before | identified | 95 % | unit |", rows)}

{words} Pitch rms: fitted flights {f["before"]["fitted"]["pitch_rms_deg"]:.1f} degrees before, {f["after"]["fitted"]["pitch_rms_deg"]:.1f} after; held-out flights
{out_before["pitch_rms_deg"]:.1f} before, {out_after["pitch_rms_deg"]:.1f} after. {_shipped(f["parameters"])}

**Equally good fits.** Resampled flights give fits that explain the motion as well. What they predict, 5th to 95th percentile: AUC
{_span(good["landed_auc"])}, Brier score {_span(good["landed_brier"])}, endings on one or two feet {_span(good["two_leg_share"])}, pitch rms {good["pitch_rms_deg"][0]:.1f} to
{good["pitch_rms_deg"][1]:.1f} degrees, and landing rates from a hover:

{_table("| policy | rate |", ranges)}"""


def _correlations(names: list[str], correlation: list[list[float]]) -> str:
    pairs = [f"`{names[j]}` and `{names[i]}` {correlation[i][j]:.2f}" for i in range(len(names)) for j in range(i)]
    return f"Correlations of the estimates: {', '.join(pairs)}."


def _shipped(parameters: dict[str, Any]) -> str:
    """Whether the shipped numbers, which are of a fit to all flights, agree with the fit to some."""
    shipped = {name: q.value for name, q in model.load_vehicle("crazyflie21").quantities.items()}
    outside = [n for n, p in parameters.items() if not p["interval_95"][0] <= shipped[n] <= p["interval_95"][1]]
    told = "all lie within these intervals" if not outside else f"outside these intervals: {', '.join(outside)}"
    numbers = ", ".join(f"{shipped[name]:g}" for name in parameters)
    return f"`crazyflie21` holds the numbers of a fit to all flights, rounded ({numbers}): {told}."


def _span(pair: list[float]) -> str:
    return f"{pair[0]:.2f} to {pair[1]:.2f}"


def _feet(d: dict[str, Any]) -> str:
    rows = [f"| {row['gear']} | {row['median_rms_deg']:.1f} |" for row in d["feet"]]
    return f"""## 6. Why a landing ends on two feet

Flights that ended on two feet turned too far: their rear feet touched first, at some 220 degrees, and the body did not swing back
far enough for the front feet. Others touched too early, at 100 degrees. The simulated vehicle ends on two feet in the same places,
with feet as they were: an ideal ball joint that never comes off. Difference of pitch between 200 and 420 ms, through contact and
swing, median over {d["feet"][0]["n"]} flights:

{_table("| landing gear | pitch rms, deg |", rows)}

The recorded swing does not tell a foot damping of 0 from one of 8e-4 N m s/rad. An adhesion of 1 N contradicts it, 5 N does
not. A hip of 0.14 N m/rad explains how the legs ring better than the 0.08 of the authors' simulation; it changes the rates of section
4 by 0.02 at most. The gear files keep the authors' numbers, and their sigma says how far each is known."""


def _wrong(d: dict[str, Any]) -> str:
    now = d["compared"]["now"]
    published = now["policies"][2]["rate"]
    share = now["two_leg_share"]
    return f"""## 7. What is still wrong

- At (4.0, 8.12) the paper reports 93.75 % of its flights; the simulated vehicle lands {published:.2f}. It turns somewhat too far there.
  Those flights were flown later, with another airframe, and their logs are not at hand.
- Endings on one or two feet are {share["simulated"]:.2f} in the simulation and {share["flown"]:.2f} in flight: the simulated swing from two feet to four is
  still a little too easy, or some flights were worse off than their recorded state tells.
- `sense.latency` and `world.sensed_gap_offset` act alike on the window at one speed; flights at two speeds would
  separate them.
- Within the window, real flights a few hundredths of 1/s apart ended differently. The simulation says as much, and cannot say which.
- One vehicle, one gear, one speed, one angle. Nothing here says that oblique approaches agree as well."""


def _belief(d: dict[str, Any]) -> str:
    b = d["belief"]
    low, high = b["flown_per_s"]
    window = "none" if b["window_per_s"] is None else f"{b['window_per_s'][0]:.2f} to {b['window_per_s'][1]:.2f} 1/s"
    return f"""## 8. Learning from these flights, as if they were flown now

`ephe_belief`, the learner of `make learn`, was told the {b["n_flights"]} flights in the order in which they were flown. It began with
`crazyflie21` as it was before they were known, and with the spreads of `experiments/transfer.yaml`; rotor decay, latency and the
plane of the cues had the wide spreads of section 5. {_when(b)} After the last flight it expects half of the landings to succeed at
{window}, the most at {b["best_per_s"]:.2f} 1/s ({b["rate"]:.2f}), and {b["rate_in_flown"]:.2f} on average from {low:.2f} to {high:.2f}
1/s, where real flights landed. Its surprise fell to {b["least_surprise"]:.1f} at least; below -2.2 it says that no member fits. The
vehicle that it began with has no battery, no loss of thrust in a climb, and rotors that stop exponentially, so no member of that
family is the vehicle that flew.

Which guard does that need? Each was taken away in turn, and then all of them. They are those of every run (MODEL, section 17):
the motion of flights counts like that of three at most, any model has errors that all flights share, an outcome may say nothing,
and what no member explains is learned from outcomes near by. Their idea and
some of their sizes come from an earlier study of these very flights, so they are no independent choice; they were not changed here.

{_table("| guards | window reaches flown landings after flight | stays from flight | rate expected where flights landed |", _guards(b))}

So none of them is needed for these flights: without any, the window is right from flight {b["guards"]["none of them"]["first"]} on. With all of
them the belief takes longer, since single outcomes count less. It is one run of each, so small differences say nothing.

![What the belief expects after each real flight](figures/flights_belief.png)"""


def _guards(b: dict[str, Any]) -> list[str]:
    return [
        f"| {name} | {_number(row['first'])} | {_number(row['stays'])} | {row['rate_in_flown']:.2f} |"
        for name, row in b["guards"].items()
    ]


def _number(n: int | None) -> str:
    return "never" if n is None else str(n)


def _when(b: dict[str, Any]) -> str:
    low, high = b["flown_per_s"]
    if b["first"] is None:
        return f"Its window at 6.04 N mm never reached the flown landings, {low:.2f} to {high:.2f} 1/s."
    told = f"Its window at 6.04 N mm reaches the flown landings, {low:.2f} to {high:.2f} 1/s, after flight {b['first']}"
    if not b["missed"]:
        return f"{told}, and stays there to the end."
    missed = f"it left them after {len(b['missed'])} of the later ones"
    return f"{told}; {missed}" + (f", and stays there from flight {b['stays']} on." if b["stays"] is not None else ".")


def _repeat(d: dict[str, Any]) -> str:
    names = ", ".join(str(item["file"]).rpartition("/")[2] for item in d["sources"])
    return f"""## 9. Do it with your own flights

    ivl flight import mylog.csv --format cfclient --out flights/mine --rrev 4.0 --moment 8 --speed 2.5 --angle 90
    ivl flight replay flights/mine
    ivl flight compare flights/mine --vehicle crazyflie21 --gear wide_short
    ivl flight identify flights/mine --fit rotor.tau_down,sense.latency,world.sensed_gap_offset --out my.yaml
    ivl learn experiments/paper_flight.yaml --set vehicle=my.yaml

Forms of logs: [FLIGHT_DATA.md](FLIGHT_DATA.md). How often the intervals of `identify` hold on vehicles whose numbers are known:
`tools/identify_study.py` (50 repetitions of 8 landings: 149 of 150 held; the vehicle there has the model that is fitted, so errors of the
model are not in it). The figures here are of {names}. Windows and rates are of
64 and 1000 simulated landings a point, so a window's ends are known to 0.05 1/s."""
