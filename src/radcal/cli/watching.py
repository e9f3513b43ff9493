"""Cases at work, shown again and again at the terminal or as a page that renews itself."""

from __future__ import annotations

import html
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import typer

from radcal.config import load
from radcal.forecast.runs_and_time import Standing, standing
from radcal.products.showing import show
from radcal.storage.files import atomic
from radcal.storage.lock import holder

_EVERY_S = 5.0
_CLEAR = "\x1b[2J\x1b[H"  # the terminal
_PAGE = """\
<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">{renew}
<title>radcal: {name}</title>
<style>:root {{ color-scheme: light dark }} body {{ font: 1rem/1.5 sans-serif; max-width: 60rem; margin: 2rem auto;
padding: 0 1rem; overflow-wrap: anywhere }} progress {{ width: 100% }}</style></head>
<body><h1>{name}</h1>{bar}{paragraphs}<h2>Latest lines of the jobs</h2><ul>{jobs}</ul></body></html>
"""


def watched(cases: Mapping[Path, str], page: bool) -> None:
    """Show cases until no command works on them.

    Parameters
    ----------
    cases : mapping
        Name, results folder or YAML file of each case, by its results folder.
    page : bool
        Whether each case is also shown as a page, ``live.html`` in its results folder.

    Raises
    ------
    ConfigError, StoreError
        A case cannot be read, or the page cannot be written.
    """
    configured = {folder: load([Path(case)]) for folder, case in cases.items() if Path(case).is_file()}
    before: dict[Path, float] = {}
    while True:
        at_work = [folder for folder in cases if holder(folder) is not None]
        lines = []
        for folder in cases:
            now = standing(configured[folder], folder) if folder in configured and folder in at_work else None
            of_case = [*show(folder), *[f"simulator: {now}."] * (now is not None)]
            if page:
                with atomic(folder / "live.html") as partial:
                    partial.write_text(live_page(folder, of_case, now, folder in at_work), encoding="utf-8")
                of_case.append(f"live page: {folder / 'live.html'}")
            lines += of_case
        text = "\n".join(lines)
        news = {path: path.stat().st_mtime for folder in cases for path in (folder / "logs").rglob("*.progress")}
        if sys.stdout.isatty():
            typer.echo(f"{_CLEAR}{text}")
        elif news != before or not at_work:
            typer.echo(f"{text}\n")
        before = news
        if not at_work:
            return
        time.sleep(_EVERY_S)


def live_page(folder: Path, lines: Sequence[str], now: Standing | None, at_work: bool) -> str:
    """Page on a case, which a browser reads again from the disk as long as a command works on the case.

    Parameters
    ----------
    folder : Path
        Results folder of the case.
    lines : sequence of str
        Lines of ``radcal show``.
    now : Standing or None
        How far the runs are, if this is known.
    at_work : bool
        Whether a command works on the case.
    """
    latest = sorted((folder / "logs").rglob("*.progress"), key=lambda path: path.stat().st_mtime)
    jobs = [path.read_text("utf-8", "replace") for path in reversed(latest)]
    paragraphs = [html.escape(line) for line in lines]
    if (folder / "report.html").exists() and not at_work:
        paragraphs.insert(0, '<a href="report.html">Report</a>')
    most = 0 if now is None else now.expected or now.done
    return _PAGE.format(
        name=html.escape(folder.name),
        renew=f'<meta http-equiv="refresh" content="{_EVERY_S:g}">' * at_work,
        bar="" if now is None else f'<progress aria-label="runs" value="{now.done}" max="{most}"></progress>',
        paragraphs="".join(f"<p>{text}</p>" for text in paragraphs),
        jobs="".join(f"<li>{html.escape(text)}</li>" for text in jobs),
    )
