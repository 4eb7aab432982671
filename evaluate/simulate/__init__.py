"""An interactive simulation: a session in real time, its page in a browser, its recording.

In: a motion, a policy and what people do on the page. Out: a session's recording, which replays to the bit.
"""
