"""A live view of a learning run: `ivl learn --live` serves one local page, and a stream for Foxglove.

Whoever flies tells the board, which only keeps what it is told. A thread of its own looks at the board 20 times a
second, and shows it. So no client, however slow, can delay a flight.

    board         what is known: told by the threads that run and fly
    vehicle       what a connected vehicle says of itself now
    room          surface, fence and shapes, for drawing
    history       policies, landings and belief, read from the run folder
    last_flight   the last flight, recorded and simulated; its replay, where nothing real flies
    pump          20 times a second: the parts of the page, and a row for Foxglove
    server        the page, its parts over a web socket, the stop button
    stream        topics of `ivl export`, for Foxglove
    view          all of these together, as one run has them
"""
