"""The figures of a score as text."""

from typing import Any

SHOWN_SENTENCE = 110
"""Characters of an answer that a list of misses shows."""


def table(document: dict[str, Any]) -> str:
    """All blocks of a score, for a terminal."""
    lines: list[str] = []
    for block, figures in document["blocks"].items():
        lines += [*_block(block, figures), ""]
    return "\n".join(lines).rstrip()


def percent(figure: dict[str, Any]) -> str:
    """A rate with its interval, hits and n: `92.0 % (88.9-94.3), 368 of 400`."""
    if not figure["n"]:
        return "no case"
    low, high = 100 * figure["low"], 100 * figure["high"]
    share = 100 * figure["rate"]
    return f"{share:.1f} % ({low:.1f}-{high:.1f}), {figure['hits']} of {figure['n']}"


def judged(figure: dict[str, Any]) -> str:
    """A figure's target, and whether it is met; nothing where there is none."""
    if "target" not in figure:
        return ""
    word = {True: "met", False: "MISSED", None: "open"}[figure["met"]]
    return f"target {figure['target']}: {word}"


def listed(counts: dict[str, int]) -> str:
    """Counts by name: `creep 14, unknown 1`."""
    return ", ".join(f"{name} {n}" for name, n in counts.items())


def instead(off: dict[str, Any]) -> str:
    """What was named where a parameter that was off was not: `cable.stiffness 2, nothing 1`."""
    nothing = {"nothing": off["nothing_instead"]} if off["nothing_instead"] else {}
    return listed(off["instead"] | nothing) or "-"


def _block(block: str, figures: dict[str, Any]) -> list[str]:
    lines = [f"{block}, n = {figures['n']}"]
    for name, figure in figures["rates"].items():
        lines.append(f"  {name:46s}{percent(figure):36s} {judged(figure)}".rstrip())
    lines.append(f"  verdicts: {listed(figures['verdicts'])}")
    lines += _gap(figures["gap_closed"]) + _sizes(figures["sizes"])
    lines += _rounds(figures["rounds"]) + _kinds(figures["by_kind"])
    for name, off in figures["by_parameter_off"].items():
        lines.append(f"  {name} off, named {percent(off['named'])}; instead: {instead(off)}")
    seconds = figures["seconds"]
    if seconds["median"] is not None:
        lines.append(
            f"  seconds of a diagnosis: median {seconds['median']:.1f}, most {seconds['most']:.1f}"
        )
    lines.append("  hidden: what it was said to be")
    lines += [f"    {name:34s}{listed(said)}" for name, said in figures["confusion"].items()]
    if figures["misses"]:
        lines.append(f"  misses ({len(figures['misses'])})")
        lines += [f"    {_miss(miss)}" for miss in figures["misses"]]
    if figures["unanswered"]:
        lines.append(f"  without an answer: {len(figures['unanswered'])}")
        lines += [f"    {each['number']}: {each['sentence']}" for each in figures["unanswered"]]
    return lines


def _gap(gap: dict[str, Any]) -> list[str]:
    if not gap["n"]:
        return []
    label = "gap closed on trials left out"
    return [
        f"  {label}, {name}: {gap[key]['value']:.3f} (n {gap['n']}) {judged(gap[key])}".rstrip()
        for key, name in (("median", "median"), ("tenth_percentile", "tenth percentile"))
    ]


def _sizes(sizes: dict[str, Any]) -> list[str]:
    if sizes["median_error"]["value"] is None:
        return []
    error = sizes["median_error"]
    lines = [
        f"  fitted sizes, median error: {100 * error['value']:.1f} % {judged(error)}",
        f"  95 % intervals cover {percent(sizes['covered'])} {judged(sizes['covered'])}",
    ]
    for path, figure in sizes["by_parameter"].items():
        median = f"{100 * figure['median_error']:.1f} %"
        lines.append(f"    {path:44s}{median:>8s}   covered {percent(figure['covered'])}")
    return lines


def _kinds(kinds: dict[str, Any]) -> list[str]:
    return [
        f"  undecidable in {kind:20s}{percent(figure):34s} {listed(figure['verdicts'])}"
        for kind, figure in kinds.items()
    ]


def _rounds(rounds: dict[str, Any]) -> list[str]:
    choosers = [chooser for chooser in ("proposed", "random") if chooser in rounds]
    lines = [f"  an experiment was asked for: {percent(rounds['asked'])}"] if choosers else []
    for chooser in choosers:
        figures = rounds[chooser]
        settled = "; ".join(f"{k}: {percent(each)}" for k, each in figures["settled"].items())
        lines.append(f"  {chooser}, of these settled within rounds {settled}")
        text = f"    mean rounds {figures['mean_rounds']:.2f}, an effect named wrongly "
        lines.append(text + percent(figures["wrong"]))
    if choosers:
        lines.append(
            f"  proposed in fewer rounds than random {percent(rounds['faster'])}, in more "
            f"{percent(rounds['slower'])}"
        )
    return lines


def _miss(miss: dict[str, Any]) -> str:
    size = "" if miss["r"] is None else f" (r {miss['r']:.2f})"
    sentence = miss["sentence"][:SHOWN_SENTENCE]
    return f"{miss['number']}: {miss['hidden']}{size}, said {miss['said']}: {sentence}"
