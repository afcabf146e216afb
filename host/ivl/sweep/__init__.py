"""Sweeps: conditions x gears x trials as tasks on this machine's cores or a cluster, and the tables they leave."""
