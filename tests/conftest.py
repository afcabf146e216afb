"""For all tests."""

import signal

# Who starts the tests in the background may have told them to ignore Ctrl-C; programs under test would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
