"""A learner of your own in BoTorch's way: fit a Gaussian process, maximise an acquisition function, fly, repeat.

    PYTHONPATH=examples .venv/bin/ivl learn paper_vertical --learner suggest_gp:Ucb

With BoTorch, `suggest` would make tensors of `theta` and `returns`, fit a `SingleTaskGP`, and return the candidates of
`optimize_acqf(qUpperConfidenceBound(...), bounds=..., q=n, ...)` as an array; nothing else would change. Here
scikit-learn's Gaussian process does it, since the package has it already.
"""

import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern, WhiteKernel

from ivl.adapters.suggest import Suggest


class Ucb(Suggest):
    """Gaussian process with an upper confidence bound."""

    def suggest(self, theta: np.ndarray, returns: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
        """The policies of a random thousand with the largest bound; each is believed before the next one is chosen."""
        kernel = Matern(np.full(self.dim, 0.2), (0.03, 2.0), nu=2.5) + WhiteKernel(0.3, (0.01, 2.0))
        model = GaussianProcessRegressor(kernel, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound is a result here
            model.fit(theta, returns)
        kernel, chosen = model.kernel_, []
        for _ in range(n):
            points = rng.random((1000, self.dim))
            mean, deviation = model.predict(points, return_std=True)
            chosen.append(points[np.argmax(mean + 2.0 * deviation)])
            theta, returns = np.vstack([theta, chosen[-1]]), np.append(returns, model.predict(chosen[-1][None, :]))
            model = GaussianProcessRegressor(kernel, optimizer=None).fit(theta, returns)
        return np.array(chosen)
