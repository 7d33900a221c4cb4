"""Emulators for tests: the program in the variable COMMRAM, one instance per test."""

import os
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

import commram

# The soft-PLC is an example and a test.
sys.path.insert(0, str(Path(__file__).parents[2] / "tools" / "python"))

PROGRAM = os.environ.get("COMMRAM", "commram")


class Emulator:
    """A running `commram run`."""

    def __init__(self, *arguments):
        self.name = f"py{os.getpid()}-{uuid.uuid4().hex[:8]}"
        self.arguments = arguments
        self.start()

    def start(self):
        """Starts the instance, also once more after its end."""
        command = [PROGRAM, "run", *self.arguments, "-i", self.name]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        ready = self.process.stdout.readline()
        assert "ready" in ready, ready

    def command(self, name, *arguments):
        """Returns the output of a subcommand on this instance."""
        command = [PROGRAM, name, *arguments, "-i", self.name]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout

    def attach(self, writable=True):
        return commram.attach(self.name, "line", writable)

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(timeout=60)
        self.process.stdout.close()
        subprocess.run([PROGRAM, "stop", "--clean", "-i", self.name], capture_output=True, check=False)


@pytest.fixture
def emulator():
    """Starts emulators; all end with the test."""
    running = []

    def start(*arguments):
        running.append(Emulator(*arguments))
        return running[-1]

    yield start
    for one in running:
        one.stop()


@pytest.fixture
def stepped(emulator):
    """An emulator with the stepped clock."""
    return emulator("--clock", "stepped")
