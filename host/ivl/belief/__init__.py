"""Belief over simulated vehicles: which member of a family is the one that flies.

The pipeline, one module each:

    recording     what a flight records of its flip, as a vector of features
    bank          simulated members of the family, their recordings and landings, made once and cached
    emulator      recording and landing rate as functions of member and policy, fitted to the bank
    posterior     what the flights so far say of the member
    decide        the landing rate of policies over the belief, with margin

Sources: docs/MODEL.md has the equations; docs/DESIGN.md says why it is built like this.
"""
