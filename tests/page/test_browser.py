"""The page in a browser: `pytest -m slow tests/page/test_browser.py`."""

import re
import shutil
import signal
import socket
import subprocess
import sys

import pytest
from scene_texts import TEXT
from waiting import SECONDS, until

pytestmark = pytest.mark.slow
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
MINUTES = 1000 * SECONDS  # ms
playwright.expect.set_options(timeout=MINUTES)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server's address, its folder, and its process."""
    folder = tmp_path_factory.mktemp("explored")
    scene = folder / "scene.toml"
    scene.write_text(TEXT.replace("[32, 32]", "[16, 16]").replace("8e4", "4e4"), encoding="utf-8")
    port = free_port()
    words = ["explore", scene, "--no-browser", "--port", port, "-o", folder / "out"]
    command = [sys.executable, "-m", "graded_contact", *map(str, words)]
    with open(folder / "terminal.txt", "wb") as terminal:
        process = subprocess.Popen(command, stderr=terminal)
    until(lambda: listens(port))
    yield f"http://127.0.0.1:{port}/", folder / "out", process
    process.kill()
    process.wait()


@pytest.fixture(scope="module")
def browser():
    if BROWSER is None:
        pytest.skip("there is no chromium here: the page was not tried in a browser")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def opened(browser, served):
    """Opens pages, which raise nothing and ask nobody but the server, and waits till they rest."""
    asked, raised = [], []

    def open_page():
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(MINUTES)
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: raised.append(str(error)))
        page.goto(served[0])
        rested(page)
        return page

    yield open_page
    elsewhere = [url for url in asked if not url.startswith((served[0], "data:", "blob:"))]
    assert elsewhere == [] and raised == []


def rested(page):
    page.get_by_text(re.compile(r"bars \d")).wait_for()


def area(page):
    """The contact area: on this grid friction is below its error, and its bound hardly changes."""
    return page.locator(".head b").nth(1)


def field_of(page):
    return page.get_by_role("textbox", name="pressure [kPa]")


def enter(page, text):
    field_of(page).fill(text)
    field_of(page).press("Enter")


def refusal(page):
    return page.locator(".say.error")


def test_a_key_turns_a_slider_and_the_numbers_follow(opened):
    page = opened()
    playwright.expect(page.locator(".bk-Figure")).to_have_count(7)
    before = area(page).inner_text()
    slider = page.get_by_role("slider", name="pressure")
    playwright.expect(slider).to_have_attribute("aria-valuetext", "400 kPa")
    slider.focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    playwright.expect(area(page)).not_to_have_text(before)
    until(lambda: slider.get_attribute("aria-valuetext") == f"{field_of(page).input_value()} kPa")
    page.close()


def test_a_refused_topography_is_tried_again_with_its_unit_and_size(opened, tmp_path):
    page = opened()
    page.get_by_text("Data", exact=True).click()
    heights = tmp_path / "heights.txt"
    row = [f"{(3 * i) % 7 + i % 3}" for i in range(16)]
    heights.write_text("\n".join(" ".join(row[i:] + row[:i]) for i in range(16)))
    page.locator("input[type=file]").nth(1).set_input_files(heights)
    playwright.expect(refusal(page)).to_contain_text("heights.txt")
    for name, text in (("unit of its heights", "um"), ("edge length [m]", "1e-3")):
        page.get_by_label(name).fill(text)
        page.get_by_label(name).press("Enter")
    page.locator(".title", has_text="on heights.txt").wait_for()
    playwright.expect(refusal(page)).to_have_count(0)
    page.close()


def test_a_table_of_moduli_is_tried_again_with_its_units(opened, tmp_path):
    page = opened()
    page.get_by_text("Data", exact=True).click()
    table = tmp_path / "dma.csv"
    table.write_text("f [Hz],E',E''\n" + "".join(f"{f},{2 * f},0.3\n" for f in (1, 3, 9, 27)))
    page.locator("input[type=file]").first.set_input_files(table)
    playwright.expect(refusal(page)).to_contain_text("fill in for instance “its units” modulus=Pa")
    page.get_by_label("its units").fill("modulus=MPa")
    page.get_by_label("its units").press("Enter")
    playwright.expect(refusal(page)).to_have_count(0)
    page.get_by_text("dma.csv", exact=False).first.wait_for()
    page.close()


def test_a_phone_shows_all_in_its_width_and_a_figure_above_its_sliders(opened):
    page = opened()
    page.set_viewport_size({"width": 400, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    assert page.locator(".bk-Figure").last.bounding_box()["width"] <= 400
    page.get_by_role("slider").last.scroll_into_view_if_needed()
    place, number = (page.locator(what).first.bounding_box() for what in (".bk-Figure", ".head b"))
    slider = page.get_by_role("slider").last.bounding_box()
    assert 0 < number["y"] < place["y"] and place["y"] + place["height"] < slider["y"] < 800
    page.close()


def test_two_users_have_a_scene_each_and_a_closed_tab_stops_nobody(opened):
    one, other = opened(), opened()
    before = area(other).inner_text()
    enter(one, "300")
    playwright.expect(area(one)).not_to_have_text(before)
    assert area(other).inner_text() == before
    one.close()
    enter(other, "350")
    playwright.expect(area(other)).not_to_have_text(before)
    other.close()


def test_a_tab_that_closes_in_a_solve_stops_nobody(opened):
    one, other = opened(), opened()
    before = area(other).inner_text()
    for text in ("310", "320", "330"):
        enter(one, text)
    one.close()
    enter(other, "340")
    playwright.expect(area(other)).not_to_have_text(before)
    other.close()


def test_each_of_four_quick_clicks_adds_a_layer(opened):
    page = opened()
    page.get_by_text("Layers", exact=True).click()
    page.get_by_label("name of the new material").fill("soft")
    box = page.get_by_role("button", name="Add layer").bounding_box()
    for _ in range(4):  # at one place, as with a mouse
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    playwright.expect(page.get_by_role("button", name="Remove")).to_have_count(5)
    for name in ("1 soft4", "2 soft3", "3 soft2", "4 soft", "5 coat"):
        playwright.expect(page.get_by_text(name, exact=True)).to_be_visible()
    page.close()


def test_bad_things_are_refused_on_the_page(opened, served, tmp_path):
    page = opened()
    for text in ("0", "much"):
        enter(page, text)
        message = f"`pressure`: {text} is refused"
        playwright.expect(refusal(page)).to_contain_text(message)
        # The refused text stays, marked, until it is right.
        playwright.expect(field_of(page)).to_have_value(text)
        playwright.expect(field_of(page)).to_have_attribute("aria-invalid", "true")
        enter(page, "0.4 MPa")
        playwright.expect(refusal(page)).to_have_count(0)
        playwright.expect(field_of(page)).to_have_value("400")
        playwright.expect(field_of(page)).to_have_attribute("aria-invalid", "false")
    page.get_by_text("Data", exact=True).click()
    bad, large = tmp_path / "bad.txt", tmp_path / "large.bin"
    bad.write_text("this is no topography\n")
    large.write_bytes(bytes(200_000_000))
    topography = page.locator("input[type=file]").nth(1)
    topography.set_input_files(bad)
    playwright.expect(refusal(page)).to_contain_text("bad.txt")
    topography.set_input_files(large)
    page.get_by_text("File is too large", exact=True).wait_for()
    assert not {"bad.txt", "large.bin"} & {path.name for path in served[1].iterdir()}
    page.close()


def test_ctrl_c_ends_the_server(served):
    process = served[2]
    process.send_signal(signal.SIGINT)
    assert process.wait(SECONDS) == 0
    # Tabs were closed, some of them in the middle of a solve.
    terminal = (served[1].parent / "terminal.txt").read_text()
    assert "Traceback" not in terminal and "WARNING" not in terminal
