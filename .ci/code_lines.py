"""Code lines of each room of src/radcal: lines with a token, without docstrings and comments.

    python .ci/code_lines.py [REVISION]

With a revision that git knows, its lines stand beside those of the working copy.
"""

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = "src/radcal"
NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
}  # fmt: skip


def code_lines(text: str) -> int:
    """Number of code lines of a module."""
    lines = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in NO_CODE
        for line in range(token.start[0], token.end[0] + 1)
    }
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            lines -= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return len(lines)


def of_rooms(files: dict[str, str]) -> Counter[str]:
    """Code lines of each package or top-level module, from the texts of its modules."""
    found: Counter[str] = Counter()
    for path, text in files.items():
        found[Path(path).relative_to(SOURCE).parts[0].removesuffix(".py")] += code_lines(text)
    return found


def at(revision: str) -> dict[str, str]:
    """Texts of all modules at a revision; empty if git does not know it."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout

    try:
        names = git("ls-tree", "-r", "--name-only", revision, SOURCE).split()
        return {name: git("show", f"{revision}:{name}") for name in names if name.endswith(".py")}
    except (subprocess.CalledProcessError, FileNotFoundError):
        return {}


def main() -> None:
    """Print the table."""
    now = of_rooms({str(p.relative_to(ROOT)): p.read_text(encoding="utf-8") for p in (ROOT / SOURCE).rglob("*.py")})
    before = of_rooms(at(sys.argv[1])) if len(sys.argv) > 1 else Counter[str]()
    for room in sorted({*now, *before}, key=lambda name: -now[name]):
        print(f"{room:14} {before[room] or '':>6} {now[room]:6}")
    print(f"{'all':14} {before.total() or '':>6} {now.total():6}")


if __name__ == "__main__":
    main()
