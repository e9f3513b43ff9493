"""Compare the sentences of the terminal that README and tutorials quote with those of finished cases.

python docs/quoted.py [FOLDER OF RESULTS]

Durations are not compared, counts must be equal. Angles may differ by one degree, other numbers by 1.5 units of their
last digit or 3 %: processors round sums differently, and the sampler of the posterior then takes other steps.
"""

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    "README.md": ("dyke",),
    "docs/tutorial_default.md": ("dyke",),
    "docs/tutorial_flevoland.md": ("flevoland",),
    "docs/tutorial_satellite.md": ("segura",),
    "docs/tutorial_simulator.md": ("command_python", "command_c"),
}
BEGIN = re.compile(r"\[ *\d+:\d\d\] |sigma0 of \d|[\w ]+: (?![\[{'\"]).*\d")
DURATION = re.compile(r"\d+(\.\d+)? s\b")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")
ANGLE = re.compile(r"(?: (?:and|to) \d+)? degrees")


def quotes(page: Path) -> list[str]:
    """Sentences in the indented blocks of a page that the terminal prints, each on one line."""
    found = [""]
    for text in map(str.strip, re.findall(r"(?m)^(?: {4}.*)?$", page.read_text(encoding="utf-8"))):
        if BEGIN.match(text) or not text:
            found.append(text)
        elif found[-1]:
            found[-1] += f" {text}"
    return [re.sub(r"^\[.*?\] *", "", text) for text in found if text]


def said(folder: Path) -> list[str]:
    """Sentences that a finished case has said, the verdict that of its summary."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    lines = [summary["verdict"]]
    lines += [text for one in summary["materials"].values() for text in (one["verdict"], one["sentence"]) if text]
    for path in sorted(folder.glob("logs/**/*.log")):
        text = path.read_text(encoding="utf-8")
        if path.stem == "summary":  # without earlier verdicts
            text = text.rpartition(summary["verdict"])[2]
        lines += re.findall(r"(?m)^.{23} [A-Z]+ \w+: (.*)$", text)
    return lines


def agree(quoted: str, angle: bool, given: str) -> bool:
    """Whether a number of a quote is that which the case gives."""
    digits, _, power = quoted.partition("e")
    decimals = digits.partition(".")[2]
    last = 10.0 ** (int(power or 0) - len(decimals))
    most = max(1.5 * last, 0.03 * abs(float(given))) if decimals else float(angle)
    return abs(float(quoted) - float(given)) <= most


def is_said(quote: str, sentences: list[str]) -> bool:
    """Whether a case has said a quote, in which three points stand for what is left out."""
    quote = DURATION.sub("TIME", quote)
    numbers = [(found[0], bool(ANGLE.match(quote, found.end()))) for found in NUMBER.finditer(quote)]
    parts = [f"({NUMBER.pattern})".join(map(re.escape, NUMBER.split(part))) for part in quote.split("...")]
    matches = (re.match(".*?".join(parts), DURATION.sub("TIME", sentence)) for sentence in sentences)
    return any(all(map(agree, *zip(*numbers, strict=True), found.groups())) for found in matches if found)


def main(results: Path) -> None:
    """Print which pages were compared, and exit with the quotes that their cases did not say."""
    wrong = []
    for page, cases in PAGES.items():
        if not all((results / case / "summary.json").exists() for case in cases):
            print(f"{page}: not compared, because not all of {', '.join(cases)} are calibrated")
            continue
        sentences = [sentence for case in cases for sentence in said(results / case)]
        found = [quote for quote in quotes(ROOT / page) if not quote.startswith("note: ")]  # of radcal check
        wrong += [
            f"not said by {', '.join(cases)}: {page}: {quote}" for quote in found if not is_said(quote, sentences)
        ]
        print(f"{page}: {len(found)} quotes compared")
    sys.exit("\n".join(wrong) or 0)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "results"))
