"""A converter that costs nothing, so that the engine is tested apart from it; what a file says, it does."""

from __future__ import annotations

import errno
import hashlib
import os
import signal
import time
from dataclasses import replace

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.source import file_hash
from xosc_lateral.workflows.batch.jobs import Job
from xosc_lateral.workflows.batch.manifest import ManifestRow


def convert(job: Job) -> ManifestRow:
    """Write a text that depends on everything that may decide on an output, and on nothing else."""
    text = job.source.read_text()
    if "slow" in text:
        time.sleep(0.05)
    if "hold" in text:
        while not (job.source.parent / "go").exists():
            time.sleep(0.01)
    if "bad" in text:
        raise FormatError("nothing to play", path=job.source, line=1)
    if "bug" in text:
        raise ZeroDivisionError("by nought")
    if "hang" in text:
        time.sleep(0.5)  # a library's call
        while True:
            time.sleep(0.01)
    if "memory" in text:
        bytearray(2_000_000_000)
    if "crash" in text:
        os.kill(os.getpid(), signal.SIGKILL)
    if "full" in text:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.output))
    road = job.source.parent / "road.xodr"
    content = f"{text}{road.read_text()}{job.settings.seed} {job.variant} {dict(job.settings.parameters)}"
    write_atomically(job.output, content)
    inputs = {"road.xodr": file_hash(road), job.scenario: file_hash(job.source)}
    output_sha256 = hashlib.sha256(content.encode()).hexdigest()
    return replace(
        job.row(), output_sha256=output_sha256, inputs=inputs, road="road.xodr", road_sha256=inputs["road.xodr"]
    )


def convert_and_log(job: Job) -> ManifestRow:
    """The same; leaves the process id of each conversion behind."""
    with (job.base / "log.txt").open("a") as log:
        log.write(f"{os.getpid()} {job.name}\n")
    return convert(job)
