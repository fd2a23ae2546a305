"""Program: give random and mutated messages to all decoders, from a seed.

Prints JSON: the number of messages and of those that were refused, by decoder; faults;
the growth of the peak memory [MB]; the slowest message [s].
"""

import argparse
import hashlib
import json
import resource
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import gettempdir

from tests.hostile.decoders import Target, targets
from tests.hostile.mutation import Mutator

_WARM_UP = 500
"""Messages before memory is measured: libraries load parts at their first use."""
_MOST_FAULTS = 20


def peak_mb(pid: int | str = "self") -> float:
    """Return the peak memory of a process [MB]."""
    for line in Path(f"/proc/{pid}/status").read_text("utf-8").splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) / 1024.0
    raise OSError(f"/proc/{pid}/status: no VmHWM")


def decode_all(seed: int, messages: int) -> dict[str, object]:
    """Decode messages; return what was found."""
    mutator = Mutator(seed)
    known = [target for target in targets() for _ in range(target.share)]
    # Nothing else calls the decoders: they accept all samples.
    for target in dict.fromkeys(known):
        for sample in target.samples:
            _decode(target, sample)
    sent: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    faults: dict[tuple[str, str], str] = {}
    slowest: tuple[float, str] = (0.0, "")
    before_mb = 0.0
    began_s = time.monotonic()
    for number in range(messages):
        if number == min(_WARM_UP, messages // 2):
            before_mb = peak_mb()
        target = mutator.random.choice(known)
        data = mutator.message(target.samples)
        sent[target.name] += 1
        cpu_s = time.process_time()
        try:
            target.decode(data)
        except target.errors:
            refused[target.name] += 1
        except Exception as error:  # noqa: BLE001 - whatever it is, it is reported
            key = (target.name, type(error).__name__)
            if key not in faults and len(faults) < _MOST_FAULTS:
                name = hashlib.sha256(data).hexdigest()[:12]
                (Path(gettempdir()) / f"hostile-{name}.bin").write_bytes(data)
                faults[key] = f"{error!s:.300} (hostile-{name}.bin)"
        slowest = max(slowest, (time.process_time() - cpu_s, target.name))
    return {
        "messages": messages,
        "sent": dict(sorted(sent.items())),
        "refused": dict(sorted(refused.items())),
        "faults": [f"{'.'.join(key)}: {text}" for key, text in faults.items()],
        "growth_mb": round(peak_mb() - before_mb, 1),
        "slowest_s": [round(slowest[0], 3), slowest[1]],
        "wall_s": round(time.monotonic() - began_s, 1),
    }


def _decode(target: Target, sample: bytes) -> None:
    try:
        target.decode(sample)
    except target.errors as error:
        # Texts that are no robot at all are samples, too.
        if not target.name.startswith("robot_from") and target.name != "check_plugins":
            raise AssertionError(f"{target.name} refuses a sample: {error}") from error


def main() -> None:
    """Read the arguments; print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--messages", type=int, required=True)
    chosen = parser.parse_args()
    # A decoder that takes gigabytes fails here and not by the kernel's choice.
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    json.dump(decode_all(chosen.seed, chosen.messages), sys.stdout)


if __name__ == "__main__":
    main()
