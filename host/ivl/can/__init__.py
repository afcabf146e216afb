"""CRTP over a CAN bus: a bench link between a host and a vehicle, or a node with the vehicle's processor.

ident      the 29 bits of a frame's identifier
fragments  one packet as frames, and back
requests   which packets ask for an answer, and which answer is theirs
repeat     requests whose answer was lost, again
telemetry  what people see who look at the bus: state, policy and heartbeat frames of ivl.dbc
gateway    a process between UDP and the bus

python-can and cantools are optional (`pip install 'ivl[link]'`).
"""
