"""Optimisers of other libraries as learners of this package.

| name | what | needs |
|---|---|---|
| `ivl.adapters.pycma:PyCMA` | CMA-ES of pycma | `pip install 'ivl[optimisers]'` |
| `ivl.adapters.optuna_tpe:Tpe` | a sampler of Optuna, TPE unless told otherwise | the same |
| a subclass of `ivl.adapters.suggest:Suggest` | a function from all data to the next policies, as BoTorch does it | - |

They are used as any learner: `ivl learn paper_vertical --learner ivl.adapters.pycma:PyCMA`. One for another library
that has `ask` and `tell` is a subclass of `ivl.adapters.replayed.Replayed`.
"""
