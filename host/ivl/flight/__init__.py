"""Recorded flights: imported from what people have, replayed through the flight core, compared with the simulator.

formats   logs of other programs -> one neutral schema
schema    the columns, with units and frames
store     a folder of flights: samples, one row block a flight, and what is known about each
replay    recorded states through the flight core, tick by tick
compare   recorded against simulated motion and outcome
identify  parameters of a vehicle from recorded motion
"""
