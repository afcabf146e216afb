"""Motion capture: poses from a tracking system to the vehicle, and what is done when they stop.

config     what a YAML file says: system, body, limits
child      the process that talks to the tracking system
frame      from the axes of the tracking system to the flight frame
tracker    starts, reads and ends that process
watch      whether poses are fresh and true: lost, frozen, jumping
stream     all of it in a thread: poses to the vehicle, state to whoever asks
guard      before the trigger a loss asks for an abort; in the flip nothing is interrupted
natnet     a small OptiTrack server, so that the simulator can be tracked like a vehicle in a room
simulated  the software vehicle's true pose, as such a server
"""
