from __future__ import annotations

import os
import signal
import subprocess
import sys

from kinemimic.train.children import inherited


def test_a_child_is_born_deaf_to_ctrl_c_and_with_one_thread() -> None:
    ask = "import os, signal; print(signal.getsignal(signal.SIGINT).name, os.environ['OMP_NUM_THREADS'])"
    handler, threads = signal.getsignal(signal.SIGINT), os.environ.get("OMP_NUM_THREADS")
    with inherited():
        said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["SIG_IGN", "1"]
    assert signal.getsignal(signal.SIGINT) is handler
    assert os.environ.get("OMP_NUM_THREADS") == threads
