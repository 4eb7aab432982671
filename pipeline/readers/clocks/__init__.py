"""The times of frames: columns of times or dates, numbers of frames at a rate, the rate that the user gives.
In: numbers beside the frames. Out: seconds that increase, and defects.
"""
