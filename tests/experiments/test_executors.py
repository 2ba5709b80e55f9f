from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from patience import PATIENCE_S

PARENT = """
import multiprocessing, time
from peaking.experiments.executors import end_with_parent

def work():
    end_with_parent()
    print("ready", multiprocessing.current_process().pid, flush=True)
    time.sleep(600)

if __name__ == "__main__":
    process = multiprocessing.get_context("spawn").Process(target=work)
    process.start()
    process.join()
"""


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_worker_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    command = [sys.executable, str(script)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline().split()[1])
        assert is_alive(worker)
        parent.kill()
    deadline_s = time.monotonic() + PATIENCE_S
    while is_alive(worker) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert not is_alive(worker)
