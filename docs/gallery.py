"""Write the page of the examples, docs/examples.md, and their pictures: python docs/gallery.py"""

import ast
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parent
PAGE = DOCS / "examples.md"
PICTURES = DOCS / "images" / "examples"
EXAMPLES = DOCS.parent / "examples"
HEAD = """# Examples

Fourteen programs of 20 to 60 lines, to be read from top to bottom and to start from. They are in
the repository's folder `examples`; each runs by itself, `python examples/01_own_robot.py`, and
draws its picture into the folder that it is started in.

This page is written by `docs/gallery.py`.
"""


def main() -> None:
    """Run the examples, keep their pictures, write the page."""
    from images import rounded

    PICTURES.mkdir(exist_ok=True)
    for example in examples():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, example], cwd=folder, check=True, capture_output=True)
            drawing = Path(folder, picture(example)).read_text(encoding="utf-8")
            (PICTURES / picture(example)).write_text(rounded(drawing), encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")


def examples() -> list[Path]:
    """Return the programs in their order."""
    return sorted(EXAMPLES.glob("*.py"))


def picture(example: Path) -> str:
    """Return the file name of an example's picture."""
    return f"{example.stem.partition('_')[2]}.svg"


def page() -> str:
    """Return the page."""
    return "\n".join(
        [HEAD, *(entry(number, example) for number, example in enumerate(examples(), 1))]
    )


def entry(number: int, example: Path) -> str:
    """Return an example's part of the page: what it is about, its picture, its code without what is
    said above it."""
    text = example.read_text(encoding="utf-8")
    title, _, about = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
    code = text.split('"""\n', 1)[1].strip()
    return f"""## {number} {title.rstrip(".")}

{about.strip()}

![{title}](images/examples/{picture(example)})

```py title="{example.parent.name}/{example.name}"
{code}
```
"""


if __name__ == "__main__":
    main()
