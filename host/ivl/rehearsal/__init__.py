"""The day in the flying cage, rehearsed: what goes wrong on it is a script, and the hands that mend it are software.

script   the file: battery, faults and their rollouts
day      what happens to the software vehicle, and when
hands    what the operator says, and what the operator's hands do then
cameras  motion capture in a time that goes step by step
"""
