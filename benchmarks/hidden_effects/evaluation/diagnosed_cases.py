"""Every case through `pma-gym diagnose`, as a user would call it."""

import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

COMMAND = (sys.executable, "-m", "pma_gym.cli", "diagnose")


def judge(
    folder: Path,
    jobs: int,
    options: Sequence[str] = (),
    limit: float = 900.0,
    command: Sequence[str] = COMMAND,
) -> None:
    """Diagnose the cases that have no answer; answers go to `folder/answers`.

    Args:
        folder: what `draw` wrote.
        jobs: how many at once.
        options: more options of the command.
        limit: seconds after which a case is given up.
        command: the diagnosis.
    """
    cases = sorted(path for path in (folder / "cases").iterdir() if path.name.startswith("case_"))
    answers = folder / "answers"
    answers.mkdir(exist_ok=True)
    missing = [case for case in cases if not (answers / case.name / "diagnosis.json").is_file()]
    print(f"{len(cases) - len(missing)} of {len(cases)} have an answer", file=sys.stderr)

    def ask(case: Path) -> str:
        out, began = answers / case.name, time.monotonic()
        call = [*command, str(case), "--out", str(out), *options]
        try:
            done = subprocess.run(call, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return f"{case.name} gave no answer in {limit:.0f} s"
        took = time.monotonic() - began
        out.mkdir(exist_ok=True)
        (out / "log.txt").write_text(done.stdout + done.stderr, "utf-8")
        (out / "seconds.txt").write_text(f"{took:.2f}\n", "utf-8")
        return f"{case.name} {'answered' if done.returncode == 0 else 'FAILED'} in {took:.0f} s"

    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(ask, case) for case in missing]
        for count, future in enumerate(as_completed(futures), 1):
            print(f"{count}/{len(missing)}  {future.result()}", file=sys.stderr, flush=True)
