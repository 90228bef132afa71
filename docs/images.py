"""Draw the pictures of the README: python docs/images.py"""

from pathlib import Path

from linkwork.views.overlays import summary_figure
from linkwork.views.reproduction import robot_figure, study
from linkwork.views.style import svg

FOLDER = Path(__file__).parent / "images"


def main() -> None:
    comparison = study()
    for name, figure in {"reproduction": summary_figure(comparison), "prr3": robot_figure(comparison)}.items():
        (FOLDER / f"{name}.svg").write_text(svg(figure), encoding="utf-8")


if __name__ == "__main__":
    main()
