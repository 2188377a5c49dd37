#!/usr/bin/env python3
"""Holds the documentation to its rules, and prints the measures of each page.

    python3 scripts/check_docs.py            # what breaks a rule; exit code 1 if anything does
    python3 scripts/check_docs.py --table    # words a sentence, figures in 100 words and longest line of each page as well
    python3 scripts/check_docs.py PAGE...    # these pages only, with their longest sentences

Rules by the kind of a page (KINDS): length of sentences, figures, pictures, phrases that belong into the notebook. Everywhere: links lead somewhere, pages of docs/
are in docs/SUMMARY.md, pictures of docs/images are shown by a page, and pages that code and messages name are there. Python's own library is enough."""
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST_LINE = 120


@dataclass
class Kind:
    """Bounds of a kind of page; None: no bound."""
    words: float | None = None  # words a sentence, mean
    density: float | None = None  # figures in 100 words
    figures: int | None = None  # figures in all
    picture: bool = False  # whether it needs one
    present: bool = True  # whether it tells what is, without its history and machines
    lines: bool = True  # whether lines are wrapped


KINDS = {
    "guide": Kind(words=18, density=3, figures=5, picture=True),
    "reference": Kind(words=20, density=5),
    "generated": Kind(words=20),
    "design": Kind(words=20, density=5),
    "results": Kind(present=False, lines=False),
    "notebook": Kind(present=False),
    "top": Kind(words=18, density=4),
}
# pages outside docs/ and the generated ones
NOTEBOOK_PHRASES = {
    "the version before": r"\bthe version before\b",
    "since then": r"\bsince then\b",
    "now": r"\bnow\b",
    "a commit's hash": r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{8,40}\b",
    "a CPU's or GPU's model": r"\b(?:EPYC|Xeon|Ryzen|Zen \d|H100|H200|[Mm]odel \d{2,3})\b",
}
# what stands before a number that is a name and no figure
NAMED = re.compile(
    r"(?:Vulkan|glTF|Rust|Debian|Mesa|Python|OpenEXR|Blender|bookworm|pbrt(?:-v\d)?|[Cc]hapter|[Ss]ection|[Ss]tep|[Ff]igure|[Aa]lgorithm|[Pp]age|version|code|Ctrl\+|BC|UTF-|SPIR-V|MIT|Apache-)\s*$"
)
ABBREVIATIONS = re.compile(r"\b(?:e\.g|i\.e|et al|vs|approx|cf|Eq|Fig|vol|pp|No)\.", re.I)


@dataclass
class Page:
    """A page and its prose: text of paragraphs and list items without code, tables and headings."""
    path: Path
    kind: str
    text: str
    prose: list[str] = field(default_factory=list)
    captions: list[str] = field(default_factory=list)

    @property
    def name(self):
        return self.path.relative_to(ROOT).as_posix()


def kind_of(path):
    parts = path.relative_to(ROOT).parts
    if parts[0] != "docs" or len(parts) == 2:
        return "top"
    if parts[1:3] == ("reference", "commands"):
        return "generated"
    return parts[1] if parts[1] in KINDS else "top"


def without_code(text):
    """The text with code blocks as empty lines: fenced ones, and indented ones after an empty line."""
    lines, fence, indented, blank = [], None, False, True
    for line in text.split("\n"):
        mark = re.match(r"\s*(```+|~~~+)", line)
        if fence:
            fence = None if mark and line.strip().startswith(fence) else fence
            lines.append("")
            continue
        if mark:
            fence = mark.group(1)
            lines.append("")
            continue
        indented = line.startswith("    ") and (blank or indented) and not re.match(r"\s*(?:[-*]|\d+\.) ", line)
        blank = not line.strip()
        lines.append("" if indented else line)
    return "\n".join(lines)


def plain(text):
    """Prose as it is read: a link is its text, code a word."""
    text = re.sub(r"<!--.*?-->", " ", text, flags=re.S)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", " ", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`", "code", text)
    text = re.sub(r"<https?://[^>]*>|https?://\S+", "address", text)
    return re.sub(r"[*_]{1,2}(\S.*?\S|\S)[*_]{1,2}", r"\1", text)


def read(path):
    text = path.read_text()
    page = Page(path, kind_of(path), text)
    after_image = False
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", without_code(text)):
        block = block.strip()
        if not block or block.startswith(("#", "|", "<")):
            continue
        is_image = bool(re.fullmatch(r"(?:\[?!\[[^\]]*\]\([^)]*\)(?:\]\([^)]*\))?\s*)+", block))
        lines = [line for line in block.split("\n") if not line.lstrip().startswith(("|", "#"))]
        if not is_image:
            (page.captions if after_image else page.prose).append(plain(re.sub(r"^\s*(?:[-*]|\d+\.) ", "", "\n".join(lines))))
        after_image = is_image
    return page


def sentences(page):
    """Sentences as lists of words."""
    found = []
    for block in page.prose + page.captions:
        block = ABBREVIATIONS.sub(lambda m: m.group().replace(".", ""), " ".join(block.split()))
        for sentence in re.split(r"(?<=[.!?])[\"')\]*]*\s+", block):
            words = [w for w in sentence.split() if re.search(r"\w", w)]
            if words:
                found.append(words)
    return found


def figures(page):
    """Numbers in prose that are neither years nor parts of names. Captions say how a picture was made: theirs are not counted."""
    found = []
    for block in page.prose:
        block = " ".join(block.split())
        for m in re.finditer(r"(?<![\w.-])[-+]?\d[\d.,]*(?:e[-+]?\d+)?(?![\w])", block):
            number = m.group().rstrip(".,")
            if re.fullmatch(r"(?:19|20)\d\d", number) or NAMED.search(block[: m.start()]):
                continue
            found.append(number)
    return found


def slug(heading):
    """The anchor of a heading as forges and mdbook make it."""
    heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.strip().lower()))


def anchors(path):
    headings = re.findall(r"^#{1,6} (.*)$", without_code(path.read_text()), flags=re.M)
    return {slug(h) for h in headings} | set(re.findall(r'<a (?:id|name)="([^"]+)"', path.read_text()))


def links(page):
    """Targets of links and pictures."""
    text = re.sub(r"`[^`\n]*`", "", without_code(page.text))
    return re.findall(r"\]\(\s*<?([^)\s>]+)", text) + re.findall(r'(?:src|href|srcset)="([^"]+)"', text)


def dead_links(page):
    for target in links(page):
        if re.match(r"(?:https?|mailto):", target):
            continue
        file, _, anchor = target.partition("#")
        to = (page.path.parent / file).resolve() if file else page.path
        if not to.exists():
            yield f"a link leads nowhere: {target}"
        elif anchor and to.suffix == ".md" and anchor not in anchors(to):
            yield f"a link's heading is not there: {target}"


def long_lines(page):
    """Lines that are too long, but for tables and what has no space to break at."""
    for number, line in enumerate(without_code(page.text).split("\n"), 1):
        if len(line) > LONGEST_LINE and not line.lstrip().startswith(("|", "#", "![", "[!", "<")) and " " in line.strip()[:LONGEST_LINE].lstrip("-* "):
            yield number, len(line)


def measures(page):
    lengths = [len(s) for s in sentences(page)]
    words, count = sum(lengths), max(1, len(lengths))
    return words / count, len(figures(page)), 100 * len(figures(page)) / max(1, words)


def problems(page):
    kind = KINDS[page.kind]
    mean, count, density = measures(page)
    if kind.words and mean > kind.words:
        yield f"{mean:.1f} words a sentence: at most {kind.words}"
    if kind.figures is not None and count > kind.figures:
        yield f"{count} figures ({', '.join(figures(page)[:12])}): at most {kind.figures} on a page"
    if kind.density and density > kind.density and count > 5:
        yield f"{density:.1f} figures in 100 words: at most {kind.density}"
    if kind.picture and not re.search(r"!\[[^\]]*\]\(", page.text) and "<img" not in page.text:
        yield "no picture"
    if kind.lines:
        for number, length in long_lines(page):
            yield f"line {number} has {length} columns: at most {LONGEST_LINE}"
    if kind.present and page.path.name != "CHANGELOG.md":
        for phrase, pattern in NOTEBOOK_PHRASES.items():
            for block in page.prose + page.captions:
                for m in re.finditer(pattern, block):
                    yield f"{phrase}: ... {block[max(0, m.start() - 30): m.end() + 30]!r}"
    yield from dead_links(page)


def stray(pages):
    """Pages that the book leaves out, and pictures that no page shows."""
    summary = ROOT / "docs/SUMMARY.md"
    if summary.exists():
        listed = {(summary.parent / link.split("#")[0]).resolve() for link in links(read(summary))}
        for page in pages:
            if ROOT / "docs" in page.path.parents and page.path != summary and page.path not in listed:
                yield f"{page.name}: not in docs/SUMMARY.md"
    shown = {(page.path.parent / link.split("#")[0]).resolve() for page in pages for link in links(page) if "://" not in link}
    for picture in sorted((ROOT / "docs/images").iterdir()):
        if picture not in shown:
            yield f"{picture.relative_to(ROOT)}: no page shows it"


def missing_pages():
    """Pages that code, scripts and messages name and that are not there."""
    folders = [ROOT / name for name in ("src", "shaders", "tests", "benches", "examples", "fuzz", "scripts", ".github")]
    files = [f for folder in folders for f in folder.rglob("*") if f.suffix in (".rs", ".glsl", ".py", ".sh", ".toml", ".yml", ".cpp", ".js")]
    for file in files + [ROOT / "Dockerfile", ROOT / "justfile", ROOT / "Cargo.toml", ROOT / "build.rs"]:
        if file == Path(__file__).resolve() or not file.exists():
            continue
        for name in re.findall(r"\bdocs/(?:(?:guide|reference|design|results|notebook)/)?(?:commands/)?[a-z0-9-]+\.md\b", file.read_text(errors="replace")):
            if not (ROOT / name).exists():
                yield f"{file.relative_to(ROOT)}: names {name}, which is not there"


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    top = [ROOT / f"{name}.md" for name in ("README", "ARCHITECTURE", "CONTRIBUTING", "SECURITY", "CHANGELOG")]
    paths = [Path(a).resolve() for a in arguments] or [p for p in top if p.exists()] + sorted((ROOT / "docs").rglob("*.md"))
    pages = [read(p) for p in paths if p.name != "SUMMARY.md"]
    if "--table" in sys.argv or arguments:
        print(f"{'page':52} words  figures  in 100")
        for page in pages:
            mean, count, density = measures(page)
            print(f"{page.name:52} {mean:5.1f}  {count:7}  {density:6.1f}")
    if arguments:
        for page in pages:
            for words in sorted(sentences(page), key=len, reverse=True)[:5]:
                print(f"  {len(words):3} {' '.join(words)[:200]}")
    found = [f"{page.name}: {problem}" for page in pages for problem in problems(page)]
    if not arguments:
        found += stray(pages)
        found += missing_pages()
    print("\n".join(found))
    print(f"docs: {len(pages)} pages, {len(found)} breaches of the rules")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
