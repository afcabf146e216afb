"""Learners of other libraries beside those of this package, on the same landing.

.venv/bin/python examples/optimisers.py               # pycma and Optuna; needs pip install 'ivl[optimisers]'
.venv/bin/python examples/optimisers.py --budget 40   # a shorter look
"""

import argparse
import tempfile
from pathlib import Path

import ivl

LEARNERS = ("ephe", "ivl.adapters.pycma:PyCMA", "ivl.adapters.optuna_tpe:Tpe")


def main() -> None:
    """Learn with each, and print how often its recommendation lands."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=int, default=160, help="rollouts of each trial")
    parser.add_argument("--trials", type=int, default=4, help="seeds")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in LEARNERS:
            out = Path(folder) / name.replace(":", "-")
            run = ivl.learn("paper_vertical", learner=name, budget=args.budget, trials=args.trials, out=out)
            trials = run.trials()
            rate = trials["check_rate_four_leg_norm"].mean()
            print(f"{name:32s} lands {100 * rate:5.1f} %, solved {int(trials['solved'].sum())} of {len(trials)}")


if __name__ == "__main__":
    main()
