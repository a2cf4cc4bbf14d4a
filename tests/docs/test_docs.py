"""The documentation: its site builds without a warning, its notebooks run, its links lead
somewhere, what it says to type works.

`make test-docs` (HEXAPOD_SITE=computed) builds the site, runs the notebooks and computes the
validation; `make test` checks the sources of the pages.
"""

from __future__ import annotations

import csv
import ctypes
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
from browser import FLAGS, PATIENCE, launcher
from pages import blocks, run, typed

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
PAGES = [
    ROOT / name for name in ("README.md", ".github/CONTRIBUTING.md", "benchmarks/README.md")
] + sorted([*DOCS.rglob("*.md"), *(ROOT / "extensions").glob("*/README.md")])
SHORT = "duration=2"
COMPUTED = os.environ.get("HEXAPOD_SITE") == "computed"
of_the_site = pytest.mark.skipif(not COMPUTED, reason="built by make test-docs")


class Page(HTMLParser):
    """The links and anchors of a built page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := values.get(name))}
        self.links += [value for name in ("href", "src") if (value := values.get(name))]


@pytest.fixture(scope="session")
def site(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole site, with its notebooks run and its validation computed."""
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "tools.docs"]
    done = subprocess.run(
        [*words, "-o", str(folder / "html"), "--work", str(folder / "pages")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "html"


@pytest.fixture(scope="module")
def reference() -> dict[str, str]:
    """The sources of the pages that are made from code and tables, by name."""
    from tools.docs.__main__ import generated  # noqa: PLC0415  takes seconds

    return dict(generated(ROOT))


@pytest.fixture(scope="module")
def reader(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The empty folder in which a reader types."""
    return tmp_path_factory.mktemp("reader")


# the site


@of_the_site
def test_every_link_and_anchor_of_the_site_leads_somewhere(site: Path) -> None:
    pages = {path: Page(path) for path in site.rglob("*.html")}
    broken = []
    for path, page in pages.items():
        for link in page.links:
            name, _, anchor = unquote(link).partition("#")
            if "://" in link or link.startswith(("mailto:", "data:")):
                continue
            target = (path.parent / name.partition("?")[0]).resolve() if name else path
            if not target.exists() or (
                anchor and target in pages and anchor not in pages[target].anchors
            ):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert not broken


@of_the_site
def test_the_site_needs_no_network(site: Path) -> None:
    """No page fetches a script, a style, a font or a picture from elsewhere."""
    kinds = (
        "<(?:script|img|iframe)[^>]+src=",
        "<link[^>]+(?:stylesheet|preload|icon)[^>]+href=",
        r"url\(",
    )
    fetched = re.compile("|".join(f"""{kind}["']?https?:""" for kind in kinds))
    for path in [*site.rglob("*.html"), *site.rglob("*.css")]:
        assert not fetched.search(path.read_text(encoding="utf-8")), path


@of_the_site
def test_the_front_page_of_the_site_walks(site: Path) -> None:
    """Its robot is a page in a frame, opened from the disk without a network."""
    with launcher() as launch:
        page = launch(*FLAGS).new_context(offline=True).new_page()
        page.set_default_timeout(PATIENCE)
        page.goto((site / "index.html").as_uri())
        frame = page.wait_for_selector("iframe.walk").content_frame()
        frame.wait_for_function("window.hexapod && window.hexapod.shown.frame")
        frame.locator("canvas").first.click()
        page.keyboard.down("w")
        frame.wait_for_function("window.hexapod.shown.frame.position[0] > 0.03")


@of_the_site
def test_formulas_of_the_site_are_drawn_and_numbered_without_a_network(site: Path) -> None:
    with launcher() as launch:
        page = launch(*FLAGS).new_context(offline=True).new_page()
        page.set_default_timeout(PATIENCE)
        page.goto((site / "equations.html").as_uri())
        page.evaluate("MathJax.startup.promise")
        assert page.locator("mjx-container svg").count() > 200
        assert page.locator(".math:not(:has(svg))").count() == 0
        assert page.locator("[data-mjx-error]").count() == 0
        tags = page.locator("[id^='mjx-eqn']").evaluate_all("found => found.map(one => one.id)")
    assert tags == [f"mjx-eqn:{number}" for number in range(1, 60)]


def test_every_variable_is_in_the_reference(reference: dict[str, str]) -> None:
    for component, folder in (("plant", "plant_fmu"), ("controller", "controller/fmu")):
        table = tomllib.loads((ROOT / folder / "interface.toml").read_text(encoding="utf-8"))
        names = [
            entry["name"]
            for causality in ("input", "output", "parameter", "local")
            for entry in table.get(causality, [])
            if "record" not in entry
        ]
        text = reference[f"reference/{component}.md"]
        assert len(names) > 40
        assert not [name for name in names if f"| `{name}` |" not in text]


@of_the_site
def test_the_validation_has_all_its_results(site: Path) -> None:
    text = (site / "validation.html").read_text(encoding="utf-8")
    assert "<!-- result" not in text
    assert text.count("<table") >= 6
    for law, delivered in (("exact restitution", "0.5000"), ("Hunt-Crossley", "0.6630")):
        assert re.search(rf"{law}</p></td>.*?{delivered}", text, flags=re.DOTALL)


# the pages


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_anchors_of_a_page_lead_somewhere(page: Path) -> None:
    text = re.sub(
        r"^```.*?^```|`[^`\n]+`",
        "",
        page.read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    )
    for shown, link in re.findall(r"(?:\[([^\[\]]*))?\]\(([^)\s]+)\)", text):
        if re.fullmatch(r"[\w/]+\.(py|c|h|md|toml)", shown):  # the name of a file, which may move
            assert shown.rpartition("/")[2] == link.partition("#")[0].rpartition("/")[2]
        if "://" not in link:
            name, _, anchor = link.partition("#")
            target = page.parent / name if name else page
            if is_of_a_deleted_extension(target):
                continue
            assert target.exists(), link
            assert not anchor or anchor in headings(target), link


def is_of_a_deleted_extension(path: Path) -> bool:
    inside = path.resolve().relative_to(ROOT).parts
    return inside[0] == "extensions" and not ROOT.joinpath(*inside[:2]).is_dir()


def headings(page: Path) -> set[str]:
    """Anchors of a page's headings, as the repository's host makes them."""
    titles = re.findall(r"^#+ (.*)", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


# what they say to type


@pytest.mark.usefixtures("undrawn")  # README's commands draw all figures
def test_the_tutorial_works_as_typed_from_top_to_bottom(reader: Path) -> None:
    done = 0
    for kind, text in blocks(DOCS / "tutorial.md"):
        if kind == "python":
            assert run(reader, sys.executable, "-c", text).strip().endswith(("work", "m"))
            done += 1
        elif not kind:
            for line in text.splitlines():
                typed(reader, *shlex.split(line.replace("--show-plot", "")))
                done += 1
    assert done >= 9


@pytest.mark.usefixtures("undrawn")
def test_the_five_minutes_of_the_page_on_controllers_work_as_typed(reader: Path) -> None:
    page = blocks(DOCS / "howto" / "my-controller.md")
    (shell,) = (text for kind, text in page if kind == "sh")
    lines = shell.splitlines()
    assert len(lines) == 3
    for line in lines:
        more = ["--seeds", "2"] if line.startswith("hexapod compare") else []
        typed(reader, *shlex.split(line), *more)
    assert (reader / "out" / "mine" / "report.html").is_file()


def test_the_sweep_of_the_page_on_clusters_leaves_a_table(reader: Path) -> None:
    (sweep,) = (text for kind, text in blocks(DOCS / "howto" / "cluster.md") if kind == "python")
    (reader / "sweep.py").write_text(sweep.replace("duration=6", SHORT), encoding="utf-8")
    run(reader, sys.executable, "sweep.py")
    assert len((reader / "sweep.csv").read_text(encoding="utf-8").splitlines()) == 7


def test_the_steps_to_a_new_contact_law_fit_the_code(tmp_path: Path) -> None:
    """Applied to a copy as a reader applies them in a clone: the C compiles, has the law under
    its number, and the twin agrees.
    """
    for folder in ("plant_fmu", "models", "tests"):
        shutil.copytree(
            ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    patches = [text for kind, text in blocks(DOCS / "howto" / "contact-law.md") if kind == "diff"]
    assert len(patches) == 5
    subprocess.run(["git", "init", "--quiet", str(tmp_path)], check=True)
    for patch in patches:
        done = subprocess.run(
            ["git", "apply", "-"],
            cwd=tmp_path,
            input=patch,
            text=True,
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, f"{done.stderr}\n{patch}"
    table = tomllib.loads((tmp_path / "plant_fmu" / "interface.toml").read_text(encoding="utf-8"))[
        "enumeration"
    ]["ContactLaw"]
    items = [name for name in table if name != "prefix"]
    assert items[-1] == "hu_guo"
    got = compiled_scale(tmp_path, law=len(items), restitution=0.4)
    assert got == pytest.approx(twin_chi(tmp_path, "hu_guo", 0.4), rel=1e-15)
    assert got == pytest.approx(1.5 * 0.6 / 0.4, rel=1e-15)


def compiled_scale(tree: Path, *, law: int, restitution: float) -> float:
    """The constant that a tree's contact_law.c computes for a law by number."""
    (tree / "ask.c").write_text(
        '#include "contact_law.h"\n'
        "double ask(int law, double e) { hxDefinition d = {0}; d.contact.law = law; "
        "d.contact.restitution = e;"
        " return hx_contact(law)->scale(&d); }\n",
        encoding="utf-8",
    )
    source = [
        tree / "ask.c",
        *(
            tree / "plant_fmu" / "src" / name
            for name in (
                "contact_law.c",
                "elementary.c",
                "shared.c",
                "message.c",
                "ground/soil.c",
                "ground/surface.c",
            )
        ),
    ]
    includes = [f"-I{tree / 'plant_fmu' / name}" for name in ("src", "include")]
    includes += [f"-DHX_CONTACT_HU_GUO={law}"]  # as tools/generate.py numbers it
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-std=c11", "-o", tree / "ask.so", *source, *includes, "-lm"],
        check=True,
    )
    library = ctypes.CDLL(str(tree / "ask.so"))
    library.ask.restype, library.ask.argtypes = ctypes.c_double, [ctypes.c_int, ctypes.c_double]
    return float(library.ask(law, restitution))


def twin_chi(tree: Path, law: str, restitution: float) -> float:
    """chi of a law in a tree's models/, which is looked at in a process of its own."""
    code = (
        "import sys, types; sys.meta_path[:] = "
        "[finder for finder in sys.meta_path if 'Redirect' not in type(finder).__name__]\n"
        "package = types.ModuleType('hexapod_cosim'); package.__path__ = ['.']; "
        "sys.modules['hexapod_cosim'] = package\n"
        "from hexapod_cosim.models.contact.law import CHI\n"
        f"print(repr(CHI[{law!r}]({restitution})))"
    )
    return float(run(tree, sys.executable, "-c", code))


def written_table(page: Path, name: str) -> dict[str, dict[str, str]]:
    """Cells by row and heading of a table between its markers, written by `make figures`."""
    text = page.read_text(encoding="utf-8").split(f"control:{name} -->")[1]
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    headings = lines[0][-len(lines[2]) + 1 :]
    return {cells[0]: dict(zip(headings, cells[1:], strict=True)) for cells in lines[2:]}


def changes(law: str, control: str, *rows: str) -> list[str]:
    """Changes from kinematic control on flat ground that docs/comparison.md shows, in percent."""
    table = written_table(DOCS / "comparison.md", f"flat {law}")
    return [re.findall(r"\(([+-]\d+) %\)", table[row][control])[0].lstrip("+-") for row in rows]


def test_the_readme_quotes_the_table_of_the_comparison() -> None:
    slip, loading = "slip per metre", "loading rate at touch-down"
    cost, roll = "electrical cost, with copper loss", "roll RMS"
    paper = changes("tanh", "paper", slip, loading, cost)
    own = changes("tanh", "compliant", roll, loading, slip, cost)
    own.insert(3, changes("bristle", "compliant", slip)[0])
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert (
        "slips {} % less than kinematic control, lands {} % more softly and costs {} %".format(
            *paper
        )
        in text
    )
    assert (
        "rolls {} % less, lands {} % more softly and slips {} % less "
        "(where the ground holds a foot {} %), for {} %.".format(*own)
    ) in text


def test_the_page_of_the_papers_control_quotes_the_table_of_the_comparison() -> None:
    rows = ("slip per metre", "loading rate at touch-down", "electrical cost, with copper loss")
    walks = [
        [int(change) for change in changes(law, control, *rows)]
        for law in ("tanh", "bristle")
        for control in ("paper", "paper@chosen")
    ]
    slip, loading, cost = [f"{min(found)} to {max(found)} %" for found in zip(*walks, strict=True)]
    text = " ".join((DOCS / "control" / "paper.md").read_text(encoding="utf-8").split())
    assert f"feet slip by {slip} less than under kinematic control in the same gait" in text
    assert f"loading rates fall by {loading}, and electrical energy rises by {cost}" in text


def test_the_page_of_compliant_control_quotes_the_table_of_the_course() -> None:
    table = written_table(DOCS / "control.md", "compliant")
    cost = {name: int(row["electr. %"].split()[0]) for name, row in table.items()}
    slip = {name: -int(row["slip %"].split()[0]) for name, row in table.items()}
    grip = ("flat", "slope", "soil", "friction", "payload", "servos", "sensors")
    least, most = min(slip[name] for name in grip), max(slip[name] for name in grip)
    more = [value for value in cost.values() if value > 0]
    text = " ".join((DOCS / "control.md").read_text(encoding="utf-8").split())
    assert f"feet slip by {least} to {most} % less" in text
    assert (
        f"needs {min(more)} to {max(more)} % more than kinematic control, except on rough ground "
        f"and stairs, where it needs {-cost['rough']} and {-cost['stairs']} % less"
    ) in text
    assert [name for name, value in cost.items() if value < 0] == ["rough", "stairs"]


def test_the_page_of_lost_legs_has_the_shares_that_the_benchmark_wrote() -> None:
    with (ROOT / "benchmarks" / "results" / "loss.csv").open(encoding="utf-8") as file:
        found = list(csv.DictReader(file))
    flat = [row for row in found if row["ground"] == "flat" and row["lost"] != "two legs"]
    assert [row["noticed"] for row in flat] == ["100"] * 6
    rows = [row for row in found if row["control"] == "compliant"]
    assert [row["regained"] for row in flat if row in rows] == ["100"] * 3
    expected: dict[str, list[str]] = {}
    for row in rows:
        share = "{arrives} ({path}, {peak})".format(**row)
        expected.setdefault(row["lost"], []).append(share)
    page = (DOCS / "control" / "loss.md").read_text(encoding="utf-8").splitlines()
    table = [line for line in page if line.startswith("| a ") or line.startswith("| two ")]
    assert table == [f"| {' | '.join([lost, *cells])} |" for lost, cells in expected.items()]
    assert len(table) == 4
