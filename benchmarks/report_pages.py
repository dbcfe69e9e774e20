"""Pictures of finished reports, and what axe-core finds on their pages: the first page, a walk, its page in 3D.

usage: python -m benchmarks.report_pages OUT PROJECT ...      (also the FOLDER of `benchmarks.report`)

Each page at 1440, 1024 and 390 px, light and dark, OUT/<project>.<page>.<width>.<light|dark>.png, the first three
screens of it. The table says by which rules it cannot be read by everybody, how much wider than the window it is, and
how far down the first page the details begin. `benchmarks.troubles FOLDER` makes projects with troubles.
"""

import sys
from pathlib import Path

from tests import axe
from tests.studio import browser

SIZES = ((1440, 900), (1024, 768), (390, 844))
SCREENS = 3
DETAILS = "document.querySelector('details.part')?.getBoundingClientRect().top + scrollY"


def pages(project):
    """{name: path} of the first page, of a walk outdoors if there is one, and of its 3D."""
    report = next(path for path in (Path(project) / "results/report", Path(project) / "report") if path.is_dir())
    walks = [path for path in sorted((report / "sequences").glob("*.html")) if not path.name.endswith(".3d.html")]
    walk = next((path for path in reversed(walks) if path.name.startswith("outdoor")), walks[-1])
    return {"index": report / "index.html", "walk": walk, "3d": walk.with_suffix(".3d.html")}


def main(out, *projects):
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    print(f"{'project':<20}{'page':<8}{'width':>6}{'colours':>9}{'wider':>7}{'details at':>12}  axe-core")
    with browser.opened() as chromium:
        for project in projects:
            for name, path in pages(project).items():
                for width, height in SIZES:
                    for colours in ("light", "dark"):
                        shown = look(chromium, path, width, height, colours, out / f"{Path(project).name}.{name}")
                        print(f"{Path(project).name:<20}{name:<8}{width:>6}{colours:>9}{shown}", flush=True)


def look(chromium, path, width, height, colours, stem):
    """Take the picture of a page; the rest of its line."""
    context = chromium.new_context(viewport={"width": width, "height": height}, color_scheme=colours)
    page = context.new_page()
    page.goto(path.resolve().as_uri())
    page.wait_for_timeout(400)
    wide, high = (page.evaluate(f"document.documentElement.scroll{one}") for one in ("Width", "Height"))
    details = page.evaluate(DETAILS)
    page.screenshot(
        path=f"{stem}.{width}.{colours}.png",
        clip={"x": 0, "y": 0, "width": width, "height": min(SCREENS * height, high)}, full_page=True,
    )  # fmt: skip
    broken = axe.violations(page)
    context.close()
    at = f"{details:.0f}" if path.name == "index.html" else "-"
    rules = "; ".join(f"{rule} ({len(nodes)}): {nodes[0]}" for rule, _, nodes in broken) or "none"
    return f"{wide - width:>7}{at:>12}  {rules}"


if __name__ == "__main__":
    main(*sys.argv[1:])
