"""The onboard camera: surfaces to look at, pictures of them, the estimator's readings, and how wrong they are."""
