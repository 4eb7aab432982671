"""The page in the browser: its scene, its panel, and who may open it.

In: frames of a session. Out: what people do, as inputs of the session or requests to the loop, in a queue.
"""
