"""What a campaign says, as small pure functions: tables or arrays in, numbers with their intervals out.

Nothing here draws, prints, reads or writes a file. A *cell* is one condition (V, phi) of one set-up (vehicle, gear,
learner); a *trial* is one learning run in a cell; its landing rate is that of its last three episodes.
"""
